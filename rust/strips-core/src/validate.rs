//! Whether a plan works, and if not, where and why.
//!
//! A wrong plan is a value: every text and every sequence of operators gets a [`Verdict`], and nothing here fails or
//! panics on what a plan says. The order of judgement: the whole text must be a plan (`syntax`); then step by step the
//! action, its arguments' number, the objects and their types, and the precondition; at last the goal. The first thing
//! wrong is the verdict.
//!
//! Two ways lead to the same verdict. The fast one (`program`, `operator_index`) runs operator ids over packed states
//! and only says *whether*; where it says no, the slow one evaluates the lifted PDDL (`lifted`) and says why, also for
//! operators that grounding left out because nothing can ever make them applicable.

mod blame;
mod explain;
mod judge;
mod lifted;
mod lookup;
mod operator_index;
mod program;
mod trace;
mod validator;

use crate::task::{OperatorId, Task};
pub use judge::{Judge, JudgeError, Judgement, judge};
pub use trace::{Trace, check_trace};
pub use validator::{Validator, validate_each};

/// How a plan fares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Outcome {
    /// Every step applies and the goal holds at the end.
    Valid,
    /// The text is no plan.
    Syntax,
    /// A step names no action of the domain.
    UnknownAction,
    /// A step names no object of the problem.
    UnknownObject,
    /// A step has too many or too few arguments.
    Arity,
    /// An argument is not of the parameter's type.
    Type,
    /// A step's precondition does not hold.
    Inapplicable,
    /// Every step applies, and the goal does not hold at the end.
    GoalNotReached,
}

impl Outcome {
    /// All outcomes, in the order of their codes.
    pub const ALL: [Outcome; 8] = [
        Outcome::Valid,
        Outcome::Syntax,
        Outcome::UnknownAction,
        Outcome::UnknownObject,
        Outcome::Arity,
        Outcome::Type,
        Outcome::Inapplicable,
        Outcome::GoalNotReached,
    ];

    /// The outcome's name on the command line and in data sets.
    pub fn name(self) -> &'static str {
        match self {
            Self::Valid => "valid",
            Self::Syntax => "syntax",
            Self::UnknownAction => "unknown_action",
            Self::UnknownObject => "unknown_object",
            Self::Arity => "arity",
            Self::Type => "type",
            Self::Inapplicable => "inapplicable",
            Self::GoalNotReached => "goal_not_reached",
        }
    }

    /// The outcome's position in [`Outcome::ALL`].
    pub fn code(self) -> u8 {
        self as u8
    }
}

/// The judgement of one plan, with its evidence.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// How the plan fares.
    pub outcome: Outcome,
    /// The step at fault, from 1; the plan's length + 1 for the goal; none for `valid` and `syntax`.
    pub step: Option<usize>,
    /// The line of the text at fault, from 1; none for the goal and for plans that are no text.
    pub line: Option<usize>,
    /// For `inapplicable` and `goal_not_reached`: the literals that do not hold, as PDDL, sorted.
    pub missing: Vec<String>,
    /// Of a valid plan: what it raises `total-cost` by where the problem minimizes that, else its length.
    pub cost: Option<f64>,
    /// One sentence: what is wrong, and which earlier step made it so.
    pub reason: String,
}

impl Verdict {
    /// Whether the plan works.
    pub fn is_valid(&self) -> bool {
        self.outcome == Outcome::Valid
    }

    fn valid(steps: usize, cost: f64) -> Self {
        let plural = if steps == 1 { "" } else { "s" };
        let reason = format!("every step applies and the goal holds after {steps} step{plural}");
        Self { cost: Some(cost), ..Self::wrong(Outcome::Valid, reason) }
    }

    fn wrong(outcome: Outcome, reason: String) -> Self {
        Self { outcome, step: None, line: None, missing: Vec::new(), cost: None, reason }
    }
}

/// Validates one plan text. For many plans of one task, [`Validator`] is faster.
///
/// ```
/// use std::sync::Arc;
/// use strips_core::pddl::{Source, parse_domain, parse_problem};
/// use strips_core::task::{Limits, ground};
/// use strips_core::validate::{Outcome, validate};
///
/// let domain = "(define (domain d) (:predicates (p) (q)) (:action a :precondition (p) :effect (and (q) (not (p)))))";
/// let problem = "(define (problem x) (:domain d) (:init (p)) (:goal (q)))";
/// let domain = parse_domain(&Source::new("d", domain))?;
/// let problem = parse_problem(&Source::new("p", problem), &domain, None)?;
/// let task = ground(Arc::new(domain), Arc::new(problem), &Limits::default())?;
/// assert!(validate(&task, "(a)").is_valid());
/// let verdict = validate(&task, "(a)\n(a)");
/// assert_eq!((verdict.outcome, verdict.step, verdict.line), (Outcome::Inapplicable, Some(2), Some(2)));
/// assert_eq!(verdict.missing, ["(p)"]);
/// assert_eq!(verdict.reason, "step 2, (a), cannot be applied: (p) does not hold, since step 1, (a), made it false");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn validate(task: &Task, text: &str) -> Verdict {
    explain::explain_text(task, &lookup::Lookup::new(task), text)
}

/// Validates one sequence of operators. An id that the task does not have is an unknown action.
pub fn validate_operators(task: &Task, operators: &[OperatorId]) -> Verdict {
    explain::explain_operators(task, operators)
}
