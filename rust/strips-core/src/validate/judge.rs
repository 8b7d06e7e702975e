//! A generated text, judged: its plan against its problem, its states against the true ones.

use std::collections::HashMap;
use std::hash::BuildHasher;
use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::explain::Run;
use super::lookup::Unresolved;
use super::trace::{Trace, compare};
use super::{Outcome, Validator, Verdict};
use crate::pddl::ast::Domain;
use crate::pddl::{PddlError, Source, parse_problem};
use crate::task::{LimitError, Limits, OperatorId, Task, ground};
use crate::text::{Completion, parse_completion};

/// The judgement of one completion.
#[derive(Clone, Debug, PartialEq)]
pub struct Judgement {
    /// The verdict on the plan; `syntax` where the text is malformed.
    pub verdict: Verdict,
    /// The plan in IPC form, a step a line, in the domain's action names.
    pub plan: String,
    /// Whether the text came to its end token.
    pub finished: bool,
    /// How many steps the text has.
    pub steps: usize,
    /// How many of them can be applied, from the first.
    pub executable_steps: usize,
    /// The states that the text says, against the true ones.
    pub trace: Trace,
}

/// Why a batch could not be judged.
#[derive(Debug, thiserror::Error)]
pub enum JudgeError {
    /// A problem is wrong.
    #[error(transparent)]
    Pddl(#[from] PddlError),
    /// Grounding a problem hit a limit.
    #[error(transparent)]
    Limit(#[from] LimitError),
    /// The lists are not of one length.
    #[error("{problems} problems and {words} word lists do not go together")]
    Lengths {
        /// Number of problems.
        problems: usize,
        /// Number of word lists.
        words: usize,
    },
}

/// Judges one completion. `words` gives the domain's action or predicate for a word of the text; a word that it does not
/// hold, and a predicate's own name, stands for itself.
pub fn judge<S: BuildHasher>(
    validator: &Validator,
    completion: &Completion,
    words: &HashMap<String, String, S>,
) -> Judgement {
    let task = validator.task();
    let action = |word| words.get(word).map_or(word, String::as_str);
    let steps: Vec<(&str, &[&str])> =
        completion.steps.iter().map(|step| (action(step.action.name), step.action.args.as_slice())).collect();
    let (operators, verdict) = run(validator, &steps);
    let states = completion.steps.iter().map(|step| step.state.as_deref());
    let predicate = |word: &str| words.get(word).and_then(|name| task.domain.predicate(name));
    let trace = compare(task, validator.lookup(), &operators, states, &predicate);
    let verdict = completion.malformed.map_or(verdict, |malformed| {
        Verdict::wrong(Outcome::Syntax, format!("the text makes no sense from {malformed}"))
    });
    Judgement {
        verdict,
        plan: steps.iter().map(|(name, args)| plan_line(name, args)).collect(),
        finished: completion.finished,
        steps: steps.len(),
        executable_steps: operators.len(),
        trace,
    }
}

/// The steps that apply one after another, and the verdict on all of them.
fn run(validator: &Validator, steps: &[(&str, &[&str])]) -> (Vec<OperatorId>, Verdict) {
    let task = validator.task();
    let (mut run, mut operators) = (Run::new(task), Vec::new());
    for (name, args) in steps {
        let failed = match validator.lookup().resolve(task, name, args.iter().copied()) {
            Ok(resolved) => {
                let failed = run.step(&resolved);
                operators.extend(resolved.operator.filter(|_| failed.is_none()));
                failed
            }
            Err(error) => Some(unresolved(operators.len() + 1, &plan_line(name, args), &error)),
        };
        if let Some(verdict) = failed {
            return (operators, verdict);
        }
    }
    let verdict = run.finish();
    (operators, verdict)
}

fn unresolved(step: usize, line: &str, error: &Unresolved) -> Verdict {
    let reason = format!("step {step}, {}: {}", line.trim_end(), error.reason);
    Verdict { step: Some(step), ..Verdict::wrong(error.outcome, reason) }
}

fn plan_line(name: &str, args: &[&str]) -> String {
    format!("({})\n", [&[name], args].concat().join(" ").to_ascii_lowercase())
}

/// Prompts' problems, read and grounded once, and what the words of each prompt's texts stand for.
pub struct Judge<S = std::hash::RandomState> {
    validators: Vec<Arc<Validator>>,
    words: Vec<HashMap<String, String, S>>,
}

impl<S: BuildHasher + Sync> Judge<S> {
    /// Reads and grounds the problems in parallel, equal ones once. `words[i]` gives the domain's action or predicate for
    /// a word of a text for problem `i`, as for [`judge`].
    ///
    /// # Errors
    /// When a problem cannot be read or grounded within `limits`, the lists differ in length, or the work is interrupted.
    pub fn new(
        domain: &Arc<Domain>,
        problems: &[&str],
        words: Vec<HashMap<String, String, S>>,
        limits: &Limits,
    ) -> Result<Self, JudgeError> {
        if problems.len() != words.len() {
            return Err(JudgeError::Lengths { problems: problems.len(), words: words.len() });
        }
        let known = validators(domain, problems, limits)?;
        Ok(Self { validators: problems.iter().map(|problem| known[problem].clone()).collect(), words })
    }

    /// How many problems there are.
    pub fn len(&self) -> usize {
        self.validators.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.validators.is_empty()
    }

    /// Judges completions in parallel, each by the number of its problem.
    ///
    /// # Errors
    /// When the work is interrupted or its time is up.
    ///
    /// # Panics
    /// Where there is no problem of a number.
    pub fn judge(&self, completions: &[(usize, &str)], limits: &Limits) -> Result<Vec<Judgement>, LimitError> {
        let watch = limits.start();
        let one = |&(number, text): &(usize, &str)| {
            watch.check()?;
            Ok(judge(&self.validators[number], &parse_completion(text), &self.words[number]))
        };
        completions.par_iter().map(one).collect()
    }
}

fn validators<'p>(
    domain: &Arc<Domain>,
    problems: &[&'p str],
    limits: &Limits,
) -> Result<FxHashMap<&'p str, Arc<Validator>>, JudgeError> {
    let mut distinct = problems.to_vec();
    distinct.sort_unstable();
    distinct.dedup();
    let prepared: Result<Vec<_>, JudgeError> = distinct
        .into_par_iter()
        .map(|problem| Ok((problem, Arc::new(Validator::new(Arc::new(prepare(domain, problem, limits)?))))))
        .collect();
    prepared.map(|prepared| prepared.into_iter().collect())
}

fn prepare(domain: &Arc<Domain>, problem: &str, limits: &Limits) -> Result<Task, JudgeError> {
    let problem = parse_problem(&Source::new("problem", problem), domain, None)?;
    Ok(ground(Arc::clone(domain), Arc::new(problem), limits)?)
}
