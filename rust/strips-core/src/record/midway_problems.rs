//! Problems from midway: the goal of a trained problem, from a state on the way to it.
//!
//! Templates start from a few initial states each, so that a model may learn what such a problem always takes (open the
//! box, then fetch) instead of reading whether the box is open. From midway it has to look.

use std::sync::Arc;

use super::problems::{Workshop, goal_states, shape, started_from};
use super::shape::{Shape, hash_of};
use crate::negative::Goal;
use crate::task::{LimitError, State, Task};

/// As many states as this are drawn, if it can be, on the way of all problems of a template together.
const ENOUGH: usize = 200;

/// The most states that are drawn on the way of one problem.
const MOST: usize = 16;

/// States to draw on the way of each problem, of so many that come from one place: where there are few, a model knows
/// by heart what each takes, unless it is asked from every state on the way.
pub(super) fn draws(problems: usize) -> usize {
    (ENOUGH / problems.max(1)).clamp(1, MOST)
}

/// The same goal from a drawn state strictly between both ends of one of the problem's plans, solved, for the `number`th
/// time; none where the problem is not drawn, or has no such state.
///
/// # Errors
/// When the work is interrupted.
pub(super) fn midway(workshop: &Workshop, whole: &Shape, number: usize) -> Result<Option<Shape>, LimitError> {
    // The first draw has the name it had when there was but one: data sets keep their bytes.
    let again = if number == 0 { String::new() } else { format!(" {number}") };
    let mut random = workshop.random(&format!("midway {:x}{again}", whole.hash));
    if !random.chance(workshop.config.midway_share) {
        return Ok(None);
    }
    let plan = random.choice(&whole.plans);
    if plan.len() < 2 {
        return Ok(None);
    }
    let mut state = whole.task.init.clone();
    for operator in &plan[..=random.below(plan.len() - 1)] {
        state = whole.task.apply(&whole.task.operators[operator.index()], &state);
    }
    let task = Arc::new(started_from(workshop, &whole.task, whole.task.atoms(&state))?);
    let goal = match &whole.goal {
        Goal::State(state) => Goal::State(carried(&whole.task, state, &task)),
        literals @ Goal::Literals(_) => literals.clone(),
    };
    let Some((exploration, shortest, states)) = goal_states(workshop, usize::MAX, &task, &goal)? else {
        return Ok(None);
    };
    let hash = hash_of(&task, &goal);
    let ends = (&exploration, shortest, &states[..]);
    shape(workshop, whole.source, &task, goal, ends, (hash, whole.family), &mut random)
}

/// A state of one task as a state of another that can reach it.
fn carried(from: &Task, state: &State, to: &Task) -> State {
    let mut carried = State::empty(to.facts.len());
    for atom in from.atoms_of(state) {
        if let Ok(id) = to.facts.binary_search(atom) {
            carried.set(id.into(), true);
        }
    }
    to.derive(&mut carried);
    carried
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_problems_get_several_states_and_many_get_one() {
        assert_eq!([6, 48, 95, 200, 400].map(draws), [MOST, 4, 2, 1, 1]);
        assert!((1..1000).all(|problems| draws(problems) * problems <= ENOUGH.max(problems)));
        assert_eq!(draws(0), MOST);
    }
}
