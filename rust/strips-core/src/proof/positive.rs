//! Whether the completion is the recorded plan with its true states, to the letter.

use rustc_hash::FxHashMap;

use super::{RecordFault, Written};
use crate::negative::trace;
use crate::pddl::ast::ObjectId;
use crate::task::{OperatorId, Task};
use crate::text::{Naming, render_completion};

/// Replays `plan` and prints its trace anew. `said` is how many of `words` the text says.
pub(super) fn check(
    task: &Task,
    record: &Written<'_>,
    slots: &FxHashMap<&str, ObjectId>,
    said: usize,
) -> Result<(), RecordFault> {
    let lines: Vec<&str> = record.plan.split('\n').collect();
    let plan = lines.iter().map(|line| operator(task, line, slots)).collect::<Option<Vec<OperatorId>>>();
    let plan = plan.ok_or(RecordFault::Plan)?;
    if plan.len() != record.steps {
        return Err(RecordFault::Steps);
    }
    let (steps, _) = trace(task, &plan);
    let naming = Naming::new(&task.domain, &task.problem.objects, &record.names, &record.words[..said]);
    let mut printed = String::with_capacity(record.completion.len());
    render_completion(&naming, steps.iter().map(|step| (step.action, &step.args[..], &step.state[..])), &mut printed);
    if printed == record.completion { Ok(()) } else { Err(RecordFault::Completion) }
}

/// The operator that `(action name…)` says, words parted by single spaces.
fn operator(task: &Task, line: &str, slots: &FxHashMap<&str, ObjectId>) -> Option<OperatorId> {
    let mut words = line.strip_prefix('(')?.strip_suffix(')')?.split(' ');
    let action = task.domain.action(words.next()?)?;
    let args = words.map(|name| slots.get(name).copied()).collect::<Option<Vec<ObjectId>>>()?;
    task.operator(action, &args)
}
