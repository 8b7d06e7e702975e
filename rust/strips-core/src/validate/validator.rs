//! Many plans of one task, fast and in parallel.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::explain::{explain_operators, explain_text, plan_cost};
use super::lookup::Lookup;
use super::operator_index::OperatorIndex;
use super::program::{End, Program};
use super::{Outcome, Verdict};
use crate::task::{LimitError, Limits, OperatorId, Task};

/// A task prepared for validating many plans.
///
/// Building it is linear in the task; the index of names is built with the first text.
pub struct Validator {
    task: Arc<Task>,
    program: Program,
    lookup: OnceLock<Lookup>,
    index: OnceLock<OperatorIndex>,
}

impl Validator {
    /// Prepares the task.
    pub fn new(task: Arc<Task>) -> Self {
        let program = Program::new(&task);
        Self { task, program, lookup: OnceLock::new(), index: OnceLock::new() }
    }

    /// The task that plans are validated against.
    pub fn task(&self) -> &Arc<Task> {
        &self.task
    }

    pub(super) fn lookup(&self) -> &Lookup {
        self.lookup.get_or_init(|| Lookup::new(&self.task))
    }

    /// The verdict on a plan text; equal to that of [`super::validate`].
    pub fn validate(&self, text: &str) -> Verdict {
        match self.usual(text) {
            Some((steps, cost)) => Verdict::valid(steps, cost),
            None => explain_text(&self.task, self.lookup(), text),
        }
    }

    /// The verdict on each plan text, in order, computed in parallel.
    ///
    /// # Errors
    /// When the time of `limits` is up or the work is interrupted.
    pub fn validate_many<S: AsRef<str> + Sync>(
        &self,
        texts: &[S],
        limits: &Limits,
    ) -> Result<Vec<Verdict>, LimitError> {
        in_time(
            texts.par_iter().with_min_len(64),
            |text| self.validate(text.as_ref()),
            || Verdict::valid(0, 0.0),
            limits,
        )
    }

    /// The outcome of each plan text, without its evidence, in parallel.
    ///
    /// # Errors
    /// As [`Self::validate_many`].
    pub fn outcomes<S: AsRef<str> + Sync>(&self, texts: &[S], limits: &Limits) -> Result<Vec<Outcome>, LimitError> {
        let outcome = |text: &str| {
            let usual = self.usual_outcome(text);
            usual.unwrap_or_else(|| explain_text(&self.task, self.lookup(), text).outcome)
        };
        in_time(texts.par_iter().with_min_len(64), |text| outcome(text.as_ref()), || Outcome::Valid, limits)
    }

    /// The verdict on a sequence of operators; equal to that of [`super::validate_operators`].
    pub fn validate_operators(&self, operators: &[OperatorId]) -> Verdict {
        match self.program.run(&self.task, operators.iter().map(|id| id.0)) {
            End::Valid => Verdict::valid(operators.len(), plan_cost(&self.task, operators)),
            _ => explain_operators(&self.task, operators),
        }
    }

    /// Outcome and step (0 where it has no meaning) of many sequences of operators, in parallel.
    ///
    /// Sequence `i` is `operators[offsets[i]..offsets[i + 1]]`. None if the offsets do not ascend within `operators`.
    ///
    /// # Errors
    /// As [`Self::validate_many`].
    pub fn outcomes_of_operators(
        &self,
        operators: &[u32],
        offsets: &[i64],
        limits: &Limits,
    ) -> Result<Option<Vec<(Outcome, u32)>>, LimitError> {
        let run = |bounds: &[i64]| {
            let plan = operators.get(usize::try_from(bounds[0]).ok()?..usize::try_from(bounds[1]).ok()?)?;
            Some(outcome(self.program.run(&self.task, plan.iter().copied())))
        };
        let outcomes = in_time(offsets.par_windows(2).with_min_len(256), run, || None, limits)?;
        Ok(outcomes.into_iter().collect())
    }

    /// Length and cost, if the text is a valid plan spelt the usual way; none also where that is not clear yet.
    fn usual(&self, text: &str) -> Option<(usize, f64)> {
        let mut steps = self.steps(text);
        let end = self.program.run(&self.task, &mut steps);
        let cost = if steps.priced.is_some() { steps.cost } else { steps.count as f64 };
        (end == End::Valid && steps.clear).then_some((steps.count, cost))
    }

    /// The outcome, if the whole text is spelt the usual way: what cannot be read counts before what cannot be applied.
    fn usual_outcome(&self, text: &str) -> Option<Outcome> {
        let mut steps = self.steps(text);
        let end = self.program.run(&self.task, &mut steps);
        steps.by_ref().for_each(drop);
        steps.clear.then(|| outcome(end).0)
    }

    fn steps<'a>(&'a self, text: &'a str) -> UsualSteps<'a> {
        let index = self.index.get_or_init(|| OperatorIndex::new(&self.task));
        let priced = self.task.problem.minimizes_cost.then_some(&*self.task);
        UsualSteps { text: text.as_bytes(), at: 0, index, priced, count: 0, cost: 0.0, clear: true }
    }
}

/// Maps in parallel. Once the time is up, which it then stays, the rest is filled with `nothing`, so that it ends soon.
fn in_time<I: IndexedParallelIterator, T: Send>(
    items: I,
    one: impl Fn(I::Item) -> T + Sync + Send,
    nothing: impl Fn() -> T + Sync + Send,
    limits: &Limits,
) -> Result<Vec<T>, LimitError> {
    let watch = limits.start();
    let done = items.map(|item| if watch.check().is_ok() { one(item) } else { nothing() }).collect();
    watch.check().map(|()| done)
}

/// The verdict on each plan text against a task of its own, in order, computed in parallel.
pub fn validate_each<S: AsRef<str> + Sync>(plans: &[(&Validator, S)]) -> Vec<Verdict> {
    plans.par_iter().map(|(validator, text)| validator.validate(text.as_ref())).collect()
}

fn outcome(end: End) -> (Outcome, u32) {
    match end {
        End::Valid => (Outcome::Valid, 0),
        End::Unknown(step) => (Outcome::UnknownAction, step as u32),
        End::Inapplicable(step) => (Outcome::Inapplicable, step as u32),
        End::GoalNotReached(step) => (Outcome::GoalNotReached, step as u32),
    }
}

/// The operators of a text in which every line is `(action object …)` or blank; ends where it is not.
struct UsualSteps<'a> {
    text: &'a [u8],
    at: usize,
    index: &'a OperatorIndex,
    /// The task, if the operators' costs matter.
    priced: Option<&'a Task>,
    count: usize,
    cost: f64,
    /// Whether everything so far was spelt the usual way and named an operator.
    clear: bool,
}

impl Iterator for UsualSteps<'_> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        while matches!(self.text.get(self.at), Some(b'\n' | b' ' | b'\r' | b'\t')) {
            self.at += 1;
        }
        let rest = &self.text[self.at..];
        if rest.is_empty() {
            return None;
        }
        let end = rest.iter().position(|&byte| byte == b')').filter(|_| rest[0] == b'(');
        let operator = end.and_then(|end| self.index.find(&rest[1..end]));
        self.at += end.unwrap_or(0) + 1;
        self.count += 1;
        self.clear &= operator.is_some();
        if let (Some(task), Some(id)) = (self.priced, operator) {
            self.cost += task.operators[id as usize].cost;
        }
        operator
    }
}
