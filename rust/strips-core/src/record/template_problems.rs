//! Problems from templates: each expanded, those equal up to names dropped, the others grounded and solved.

use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::problems::{Workshop, open_task};
use super::shape::{Shape, Source, hash_before_grounding, hash_of};
use crate::augment::Template;
use crate::negative::Goal;
use crate::pddl::ast::{Condition, Problem, Term};
use crate::random::Random;
use crate::task::{Fact, LimitError, Task};

/// Most final states of one template problem that become problems of their own.
const FINAL_STATES: usize = 2;

/// The solved problems of one template, in the order of its expansion.
pub(super) fn shapes(workshop: &Workshop, number: usize, template: &Template) -> Result<Vec<Shape>, LimitError> {
    let mut random = workshop.random(&format!("template {}", template.name));
    let mut problems: Vec<Problem> = template.expand(&workshop.domain).collect();
    // A template with very many problems is thinned before anything is solved: eight in one are enough to choose from.
    thin(&mut problems, 8 * workshop.config.problems_per_template, &mut random);
    let prepared = problems.into_par_iter().map(|problem| prepare(workshop, problem)).collect::<Result<Vec<_>, _>>()?;
    let mut seen = FxHashSet::default();
    let mut fresh: Vec<_> = prepared.into_iter().filter(|(_, _, hash)| seen.insert(*hash)).collect();
    thin(&mut fresh, workshop.config.problems_per_template, &mut random);
    let solve = |(problem, goal, hash): Prepared| {
        let task = Arc::new(open_task(workshop, problem)?);
        let random = workshop.random(&format!("plans {hash:x}"));
        solve(workshop, (Source::Template(number), usize::MAX), &task, &goal, hash, random)
    };
    let solved: Vec<Vec<Shape>> = fresh.into_par_iter().map(solve).collect::<Result<_, _>>()?;
    Ok(solved.into_iter().flatten().collect())
}

/// A problem, its goal, and what stands for both up to names.
type Prepared = (Problem, Goal, u128);

/// Keeps a random choice of `most` items, in their order.
fn thin<T>(items: &mut Vec<T>, most: usize, random: &mut Random) {
    let mut order: Vec<usize> = (0..items.len()).collect();
    random.shuffle(&mut order);
    let kept: FxHashSet<usize> = order.into_iter().take(most).collect();
    let mut index = 0;
    items.retain(|_| {
        index += 1;
        kept.contains(&(index - 1))
    });
}

fn prepare(workshop: &Workshop, problem: Problem) -> Result<Prepared, LimitError> {
    workshop.limits.start().check()?;
    let literals = literals(&problem.goal);
    let hash = hash_before_grounding(&workshop.domain, &problem, &literals);
    Ok((problem, Goal::Literals(literals), hash))
}

/// The literals of a template's goal, which is a conjunction of them.
fn literals(goal: &Condition) -> Vec<(Fact, bool)> {
    let Condition::And(parts) = goal else { unreachable!("templates fill goals with conjunctions") };
    parts.iter().map(literal).collect()
}

fn literal(part: &Condition) -> (Fact, bool) {
    match part {
        Condition::Not(inner) => (literal(inner).0, false),
        Condition::Atom(atom) => {
            let object = |term: &Term| match term {
                Term::Object(object) => *object,
                Term::Variable(_) => unreachable!("templates fill goals with objects"),
            };
            (Fact { predicate: atom.predicate, args: atom.terms.iter().map(object).collect() }, true)
        }
        _ => unreachable!("templates fill goals with literals"),
    }
}

/// The problem itself and, for some of the states its plans end in, the problem of reaching exactly that state; none where
/// about `most` states do not lead to the goal.
///
/// # Errors
/// When the work is interrupted.
pub(super) fn solve(
    workshop: &Workshop,
    (source, most): (Source, usize),
    task: &Arc<Task>,
    goal: &Goal,
    family: u128,
    mut random: Random,
) -> Result<Vec<Shape>, LimitError> {
    let ends = super::problems::goal_states(workshop, most, task, goal)?;
    let Some((exploration, shortest, mut states)) = ends else { return Ok(Vec::new()) };
    let shape = |goal: Goal, states: &[usize], random: &mut Random| {
        let hash = hash_of(task, &goal);
        super::problems::shape(workshop, source, task, goal, (&exploration, shortest, states), (hash, family), random)
    };
    let mut shapes = Vec::new();
    if workshop.config.state_goal_share < 1.0 {
        shapes.extend(shape(goal.clone(), &states, &mut random)?);
    }
    if workshop.config.state_goal_share > 0.0 {
        random.shuffle(&mut states);
        for &state in states.iter().take(FINAL_STATES) {
            shapes.extend(shape(Goal::State(exploration.states[state].clone()), &[state], &mut random)?);
        }
    }
    Ok(shapes)
}
