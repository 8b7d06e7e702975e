//! Problems that ask for something to be as it was, which a plan would otherwise leave changed.
//!
//! Goals that are drawn from what differs never ask for what holds already: a box to be shut that has to be opened on the
//! way. A model that never saw such a goal takes no notice of one.

use super::problems::{Workshop, goal_states, shape};
use super::shape::{Shape, hash_of};
use crate::negative::Goal;
use crate::task::LimitError;

/// The same problem with one literal more, of a fact that one of its plans leaves changed, solved; none where the problem
/// is not drawn, has no literals for a goal, or cannot be solved so.
///
/// # Errors
/// When the work is interrupted.
pub(super) fn kept(workshop: &Workshop, whole: &Shape) -> Result<Option<Shape>, LimitError> {
    let (task, Goal::Literals(literals)) = (&whole.task, &whole.goal) else { return Ok(None) };
    let mut random = workshop.random(&format!("kept {:x}", whole.hash));
    if !random.chance(workshop.config.kept_share) {
        return Ok(None);
    }
    let mut state = task.init.clone();
    for operator in random.choice::<Vec<_>>(&whole.plans) {
        state = task.apply(&task.operators[operator.index()], &state);
    }
    let left_changed = |&id: &usize| {
        let fact = &task.facts[id];
        let derived = task.domain.predicates[fact.predicate.index()].derived;
        let asked = literals.iter().any(|(literal, _)| literal == fact);
        !derived && !asked && task.init.holds(id.into()) != state.holds(id.into())
    };
    let changed: Vec<usize> = (0..task.facts.len()).filter(left_changed).collect();
    if changed.is_empty() {
        return Ok(None);
    }
    let id = *random.choice(&changed);
    let mut literals = literals.clone();
    literals.push((task.facts[id].clone(), task.init.holds(id.into())));
    literals.sort_unstable();
    let goal = Goal::Literals(literals);
    let Some((exploration, shortest, states)) = goal_states(workshop, usize::MAX, task, &goal)? else {
        return Ok(None);
    };
    let hash = hash_of(task, &goal);
    let ends = (&exploration, shortest, &states[..]);
    shape(workshop, whole.source, task, goal, ends, (hash, whole.family), &mut random)
}
