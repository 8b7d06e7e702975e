//! Verdicts in the words of VAL, the validator of the planning competitions, for tools that read its output.

use std::fmt::Write as _;

use super::{Outcome, Verdict};
use crate::task::{OperatorId, Task};

/// What VAL prints about a plan file with this verdict; `value` is that of a valid plan, see [`plan_value`].
pub fn val_report(name: &str, verdict: &Verdict, value: f64) -> String {
    let mut out = format!("Checking plan: {name}\n");
    let body = match verdict.outcome {
        Outcome::Valid => format!("Plan executed successfully - checking goal\nPlan valid\nFinal value: {value} \n"),
        Outcome::GoalNotReached => {
            "Plan executed successfully - checking goal\nGoal not satisfied\nPlan invalid\n".to_owned()
        }
        Outcome::Inapplicable => format!(
            "Plan failed because of unsatisfied precondition in:\n{}\n\nPlan failed to execute\n",
            step(verdict)
        ),
        _ => format!("Bad plan description!\n{}\n", verdict.reason),
    };
    out.push_str(&body);
    let summary = match verdict.outcome {
        Outcome::Valid => format!("\nSuccessful plans:\nValue: {value}\n {name} {value} \n\n"),
        _ => format!("\nFailed plans:\n {name} \n\n"),
    };
    write!(out, "{summary}").expect("writing to a string never fails");
    out
}

/// The step at fault as the reason names it.
fn step(verdict: &Verdict) -> &str {
    let start = verdict.reason.find('(').unwrap_or(0);
    let end = verdict.reason[start..].find(')').map_or(verdict.reason.len(), |at| start + at + 1);
    &verdict.reason[start..end]
}

/// The value of a plan: its cost where the problem minimizes `total-cost`, else its length.
pub fn plan_value(task: &Task, steps: &[OperatorId]) -> f64 {
    if task.problem.minimizes_cost {
        steps.iter().map(|id| task.operators[id.index()].cost).sum()
    } else {
        steps.len() as f64
    }
}
