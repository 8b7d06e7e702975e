//! A problem without names, solved.

use std::sync::Arc;

use crate::augment::{Structure, canonical_hash};
use crate::negative::Goal;
use crate::pddl::ast::{Atom, Condition, Domain, Problem, Term};
use crate::task::{Fact, OperatorId, Task};
use crate::text::GoalStyle;

/// Where a problem comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The template with this number.
    Template(usize),
    /// A problem that was given, with its own goal.
    Given,
    /// The random generator.
    Random,
    /// The generator of large problems.
    Large,
}

/// A problem without names, and the plans that its records are drawn from.
#[derive(Clone, Debug)]
pub struct Shape {
    /// Where it comes from.
    pub source: Source,
    /// The task, whose own goal is left open: many shapes share one initial state.
    pub task: Arc<Task>,
    /// The goal.
    pub goal: Goal,
    /// Plans for the goal, ascending; none is empty.
    pub plans: Vec<Vec<OperatorId>>,
    /// How many plans there are of which `plans` are all, or a sample.
    pub plan_count: u128,
    /// Steps of a shortest plan, where that is proven.
    pub shortest: Option<usize>,
    /// Stands for initial state and goal up to names.
    pub hash: u128,
    /// The hash of the problem that this one is a variant of; decides what is held out.
    pub family: u128,
}

impl Shape {
    /// How the goal is said.
    pub fn goal_style(&self) -> GoalStyle {
        match self.goal {
            Goal::State(_) => GoalStyle::State,
            Goal::Literals(_) => GoalStyle::Problem,
        }
    }

    /// The problem in PDDL, its objects by their slot names.
    pub fn problem(&self, name: &str) -> Problem {
        let goal = self.goal.literals(&self.task).into_iter().map(|(fact, value)| literal(&fact, value)).collect();
        Problem { name: name.to_owned(), goal: Condition::And(goal), ..(*self.task.problem).clone() }
    }
}

fn literal(fact: &Fact, value: bool) -> Condition {
    let terms = fact.args.iter().map(|&object| Term::Object(object)).collect();
    let atom = Condition::Atom(Atom { predicate: fact.predicate, terms });
    if value { atom } else { Condition::Not(Box::new(atom)) }
}

/// The hash of an initial state and goal that is the same for all namings.
pub(super) fn hash_of(task: &Task, goal: &Goal) -> u128 {
    canonical_hash(&structure(task, goal))
}

/// The same hash for a goal of literals, which needs no task.
pub(super) fn hash_before_grounding(domain: &Domain, problem: &Problem, goal: &[(Fact, bool)]) -> u128 {
    let mut structure = start(domain, problem);
    structure.tuples.extend(goal.iter().map(literal_tuple));
    canonical_hash(&structure)
}

/// What an isomorphism of problems must keep: each object's types, each atom of the initial state and of the goal.
pub(crate) fn structure(task: &Task, goal: &Goal) -> Structure {
    let mut structure = start(&task.domain, &task.problem);
    match goal {
        Goal::State(state) => structure.tuples.extend(task.atoms_of(state).map(|fact| tuple(fact, 1))),
        Goal::Literals(literals) => structure.tuples.extend(literals.iter().map(literal_tuple)),
    }
    structure
}

/// Objects and initial state.
fn start(domain: &Domain, problem: &Problem) -> Structure {
    let constants = domain.constants.len() + domain.pending.len();
    let types = domain.types.len() as u32;
    // A constant is itself, whatever it is called elsewhere; other objects are what their types make them.
    let colour = |(id, object): (usize, &crate::pddl::ast::Object)| {
        if id < constants { types + id as u32 } else { object.types[0].0 }
    };
    let colours = problem.objects.iter().enumerate().map(colour).collect();
    let mut tuples: Vec<(u32, Vec<u32>)> = problem.init.iter().map(|fact| tuple(fact, 0)).collect();
    // An object of several types has the first for its colour and each other one as a property.
    let first_label = 4 * domain.predicates.len() as u32;
    for (id, object) in problem.objects.iter().enumerate() {
        tuples.extend(object.types[1..].iter().map(|kind| (first_label + kind.0, vec![id as u32])));
    }
    Structure { colours, tuples }
}

fn literal_tuple((fact, value): &(Fact, bool)) -> (u32, Vec<u32>) {
    tuple(fact, if *value { 2 } else { 3 })
}

fn tuple(fact: &Fact, role: u32) -> (u32, Vec<u32>) {
    (fact.predicate.0 * 4 + role, fact.args.iter().map(|object| object.0).collect())
}
