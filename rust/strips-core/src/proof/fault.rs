//! What can be wrong with a written record or problem.

use crate::pddl::PddlError;
use crate::task::LimitError;

/// Why a problem cannot be used.
#[derive(Clone, Debug, thiserror::Error)]
pub enum ProblemFault {
    /// There is no such row.
    #[error("there is no such problem")]
    Missing,
    /// It is no PDDL.
    #[error("the problem cannot be read: {0}")]
    Pddl(#[from] PddlError),
    /// It is too large.
    #[error("the problem cannot be grounded: {0}")]
    Limit(#[from] LimitError),
    /// Its goal is no conjunction of literals.
    #[error("the problem's goal is no conjunction of literals")]
    Goal,
}

/// What does not hold of a record.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RecordFault {
    /// The problem.
    #[error("{0}")]
    Problem(ProblemFault),
    /// `names` is not one name for each object, all different, constants by their own.
    #[error("`names` does not name the problem's objects")]
    Names,
    /// `words` is not one word for each action (and perhaps each predicate), or the prompt does not go by it.
    #[error("`words` are not the words that the prompt gives for the actions and predicates")]
    Words,
    /// `style` is no style, or not the prompt's.
    #[error("`style` is not the prompt's")]
    Style,
    /// `goal_style` is no way of saying goals, or not the problem's.
    #[error("`goal_style` does not fit the problem's goal")]
    GoalStyle,
    /// The prompt cannot be read, or would be printed otherwise.
    #[error("the prompt is not as it would be printed")]
    PromptText,
    /// The prompt's objects are others.
    #[error("the prompt's objects are not those of the problem")]
    Objects,
    /// The prompt asks for another goal.
    #[error("the prompt's goal is not the problem's")]
    Goal,
    /// The prompt says another initial state.
    #[error("the prompt's initial state is not the problem's")]
    Init,
    /// `plan` cannot be read, or an action of it is not possible.
    #[error("`plan` is not a plan for the problem")]
    Plan,
    /// `steps` is another number.
    #[error("`steps` is not the plan's length")]
    Steps,
    /// The completion is not the trace of `plan`.
    #[error("the completion is not the plan with its states")]
    Completion,
    /// The validator refuses the positive.
    #[error("the positive is not valid: {0}")]
    Positive(String),
    /// The negative cannot be read, or would be printed otherwise.
    #[error("the negative is not as it would be printed")]
    NegativeText,
    /// The negative is wrong for another reason, or right.
    #[error("the negative is {verdict} at step {step}, not as recorded")]
    Negative {
        /// What the validator says.
        verdict: String,
        /// Where.
        step: usize,
    },
    /// The negative is not made of the positive in the recorded way.
    #[error("the negative is not made as `negative_kind` says")]
    Kind,
}
