//! Wrong completions that look right, each proven wrong.
//!
//! A [`Corruption`] changes a positive's steps; [`check`] replays the result against the task: the actions must be
//! applicable and reach the goal, and each state must be the one that they lead to. What turns out right is drawn again
//! and counted. Knows nothing of names or text. Price: a replay of a plan for each try.

mod check;
mod corruption;

pub use check::{Fault, FaultKind, Goal, check};
pub use corruption::{Corruption, Negative, draw_negative};

use std::borrow::Cow;

use crate::pddl::ast::{ActionId, ObjectId};
use crate::task::{Fact, OperatorId, State, Task};

/// One action and the state that is said to follow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step<'t> {
    /// The action.
    pub action: ActionId,
    /// Its arguments; they are the task's own where nothing is wrong with them.
    pub args: Cow<'t, [ObjectId]>,
    /// The atoms of the state after it, in canonical order.
    pub state: Vec<&'t Fact>,
}

/// The steps of a plan that is applicable in `task`, with the true states, and the last state.
pub fn trace<'t>(task: &'t Task, plan: &[OperatorId]) -> (Vec<Step<'t>>, State) {
    let mut state = task.init.clone();
    let mut step = |&id: &OperatorId| {
        let operator = &task.operators[id.index()];
        state = task.apply(operator, &state);
        Step { action: operator.action, args: Cow::from(&operator.args), state: task.atoms_by_reference(&state) }
    };
    let steps = plan.iter().map(&mut step).collect();
    (steps, state)
}
