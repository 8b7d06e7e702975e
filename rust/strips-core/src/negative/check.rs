//! Whether steps are right: actions applicable, states true, goal reached.

use super::Step;
use crate::pddl::ast::{ActionId, ObjectId};
use crate::task::{Fact, GroundCondition, OperatorId, State, Task};

/// What the last state must satisfy.
#[derive(Clone, Debug, PartialEq)]
pub enum Goal {
    /// It is exactly this state.
    State(State),
    /// It satisfies the literals; false facts have `false`.
    Literals(Vec<(Fact, bool)>),
}

impl Goal {
    /// Whether the state satisfies the goal.
    pub fn holds(&self, task: &Task, state: &State) -> bool {
        match self {
            Goal::State(wanted) => wanted == state,
            Goal::Literals(literals) => literals.iter().all(|(fact, value)| holds(task, state, fact) == *value),
        }
    }

    /// The goal as a condition on the task's facts; unsatisfiable where a literal contradicts a static fact.
    pub fn condition(&self, task: &Task) -> GroundCondition {
        let mut condition = GroundCondition::default();
        for (fact, value) in self.literals(task) {
            match task.fact(&fact) {
                Some(id) if value => condition.positive.push(id),
                Some(id) => condition.negative.push(id),
                None if task.static_facts.binary_search(&fact).is_ok() == value => {}
                None => condition.clauses.push(crate::task::Formula::Or(Vec::new())),
            }
        }
        condition.positive.sort_unstable();
        condition.negative.sort_unstable();
        condition
    }

    /// The goal spelled out: for a state each fact that can change, true or false.
    pub fn literals(&self, task: &Task) -> Vec<(Fact, bool)> {
        match self {
            Goal::Literals(literals) => literals.clone(),
            Goal::State(state) => {
                let basic = |fact: &Fact| !task.domain.predicates[fact.predicate.index()].derived;
                let value = |(id, fact): (usize, &Fact)| (fact.clone(), state.holds(id.into()));
                task.facts.iter().enumerate().filter(|(_, fact)| basic(fact)).map(value).collect()
            }
        }
    }
}

/// Whether the fact is true in the state, static facts included.
fn holds(task: &Task, state: &State, fact: &Fact) -> bool {
    task.fact(fact).map_or_else(|| task.static_facts.binary_search(fact).is_ok(), |id| state.holds(id))
}

/// What is wrong with steps, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What is wrong.
    pub kind: FaultKind,
    /// The step that proves it, from 1; one more than the steps where the goal is not reached.
    pub step: usize,
}

/// What can be wrong with steps. The plan's own faults come first: a wrong state is reported for valid plans only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultKind {
    /// An argument is not of the parameter's type.
    Type,
    /// An action's precondition does not hold.
    Inapplicable,
    /// The last state does not satisfy the goal.
    GoalNotReached,
    /// The plan is valid, but a state is not the one that it leads to.
    WrongState,
}

impl FaultKind {
    /// The fault's name in data sets: the validator's word where it has one.
    pub fn name(self) -> &'static str {
        match self {
            FaultKind::Type => "type",
            FaultKind::Inapplicable => "inapplicable",
            FaultKind::GoalNotReached => "goal_not_reached",
            FaultKind::WrongState => "wrong_state",
        }
    }
}

/// The first fault of the steps; none when all of it is right.
pub fn check(task: &Task, goal: &Goal, steps: &[Step<'_>]) -> Option<Fault> {
    let mut state = task.init.clone();
    let mut wrong_state = None;
    for (number, step) in steps.iter().enumerate() {
        match applicable(task, &state, step.action, &step.args) {
            Ok(operator) => state = task.apply(&task.operators[operator.index()], &state),
            Err(kind) => return Some(Fault { kind, step: number + 1 }),
        }
        if wrong_state.is_none() && !is_state(task, &state, &step.state) {
            wrong_state = Some(Fault { kind: FaultKind::WrongState, step: number + 1 });
        }
    }
    let reached = goal.holds(task, &state);
    if reached { wrong_state } else { Some(Fault { kind: FaultKind::GoalNotReached, step: steps.len() + 1 }) }
}

fn applicable(task: &Task, state: &State, action: ActionId, args: &[ObjectId]) -> Result<OperatorId, FaultKind> {
    let parameters = &task.domain.actions[action.index()].parameters;
    let fits = parameters
        .iter()
        .zip(args)
        .all(|(parameter, object)| task.domain.accepts(&parameter.types, &task.problem.objects[object.index()]));
    if !fits {
        return Err(FaultKind::Type);
    }
    let operator = task.operator(action, args).ok_or(FaultKind::Inapplicable)?;
    let holds = task.operators[operator.index()].applicable(state);
    if holds { Ok(operator) } else { Err(FaultKind::Inapplicable) }
}

/// Whether the atoms are those of the state, in their order.
fn is_state(task: &Task, state: &State, atoms: &[&Fact]) -> bool {
    let same = |own: &Fact, atom: &Fact| std::ptr::eq(own, atom) || own == atom;
    let mut atoms = atoms.iter();
    task.atoms_of(state).all(|own| atoms.next().is_some_and(|atom| same(own, atom))) && atoms.next().is_none()
}
