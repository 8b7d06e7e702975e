//! Proving written records again, from their columns and the problems' PDDL alone: nothing of how they were made is used.
//!
//! A [`Prover`] reads the problems once; [`Prover::check`] then holds every column of a record against the problem: the
//! prompt asks what the problem asks, the plan is valid, the completion is its true trace to the letter, the negative is
//! wrong for the recorded reason and made as its kind says. Price: a grounding for each problem that occurs, two
//! replays and two renderings a record.

mod fault;
mod kinds;
mod positive;
mod prompt;

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use rustc_hash::{FxBuildHasher, FxHashMap};

pub use fault::{ProblemFault, RecordFault};

use crate::augment::canonical_hash;
use crate::pddl::ast::{Domain, GroundAtom, ObjectId};
use crate::pddl::{Source, parse_problem};
use crate::record::structure_of;
use crate::task::{Limits, Task, ground};
use crate::text::{GoalStyle, Style, TextAtom, goal_literals, parse_completion};
use crate::validate::{Validator, judge};

/// One record as its columns have it.
#[derive(Clone, Debug)]
pub struct Written<'a> {
    /// The row of the problems table.
    pub problem_id: usize,
    /// The prompt.
    pub prompt: &'a str,
    /// The right completion.
    pub completion: &'a str,
    /// The wrong completion.
    pub negative: &'a str,
    /// The plan in IPC form.
    pub plan: &'a str,
    /// How the negative was made.
    pub negative_kind: &'a str,
    /// What is wrong with it.
    pub negative_verdict: &'a str,
    /// The step that proves it.
    pub negative_step: usize,
    /// Object names, constants first.
    pub names: Vec<&'a str>,
    /// Action words and, in data sets where predicates have words too, predicates' words after them.
    pub words: Vec<&'a str>,
    /// The prompt's style.
    pub style: &'a str,
    /// How the goal is said.
    pub goal_style: &'a str,
    /// Steps of the plan.
    pub steps: usize,
}

/// A problem, read and grounded.
struct Known {
    validator: Validator,
    goal: Vec<(GroundAtom, bool)>,
}

/// Checks records against their problems.
pub struct Prover {
    domain: Arc<Domain>,
    problems: Vec<String>,
    known: Vec<OnceLock<Result<Known, ProblemFault>>>,
}

impl Prover {
    /// A prover over the problems of one domain, each in PDDL, by their rows.
    pub fn new(domain: Arc<Domain>, problems: Vec<String>) -> Self {
        let known = problems.iter().map(|_| OnceLock::new()).collect();
        Self { domain, problems, known }
    }

    /// For each problem the canonical hash of its initial state and goal as 32 hexadecimal digits, and how many objects it
    /// has. `state_goals[i]` says whether problem `i` asks for a whole state.
    ///
    /// # Errors
    /// The first problem that cannot be read or grounded, or whose goal is no conjunction of literals.
    pub fn hashes(&self, state_goals: &[bool]) -> Result<Vec<(String, usize)>, (usize, ProblemFault)> {
        let hash = |id: usize| {
            let known = self.known(id).map_err(|fault| (id, fault.clone()))?;
            let task = known.validator.task();
            let hash = canonical_hash(&structure_of(task, &asked(task, &known.goal, state_goals[id])));
            Ok((format!("{hash:032x}"), task.problem.objects.len()))
        };
        (0..self.problems.len()).into_par_iter().map(hash).collect()
    }

    /// What is wrong with each record, in order; in parallel.
    pub fn check_many(&self, records: &[Written<'_>]) -> Vec<Option<RecordFault>> {
        records.par_iter().map(|record| self.check(record).err()).collect()
    }

    /// Checks one record.
    ///
    /// # Errors
    /// The first thing that does not hold.
    pub fn check(&self, record: &Written<'_>) -> Result<(), RecordFault> {
        let known = self.known(record.problem_id).map_err(|fault| RecordFault::Problem(fault.clone()))?;
        let task = known.validator.task();
        let slots = slots(task, &record.names)?;
        let actions = self.domain.actions.len();
        if ![actions, actions + self.domain.predicates.len()].contains(&record.words.len()) {
            return Err(RecordFault::Words);
        }
        let prompt = prompt::Asked {
            style: Style::from_name(record.style).ok_or(RecordFault::Style)?,
            goal_style: GoalStyle::from_name(record.goal_style).ok_or(RecordFault::GoalStyle)?,
            goal: &known.goal,
        };
        let said = prompt::check(task, &prompt, record, &slots)?;
        positive::check(task, record, &slots, said)?;
        self.check_verdicts(known, record)
    }

    /// What the validator says of both completions, and whether the negative is of its kind.
    fn check_verdicts(&self, known: &Known, record: &Written<'_>) -> Result<(), RecordFault> {
        let words = self.words(record);
        let objects: FxHashMap<&str, &str> = (record.names.iter().copied())
            .zip(known.validator.task().problem.objects.iter().map(|object| object.name.as_str()))
            .collect();
        let [mut positive, mut negative] = [record.completion, record.negative].map(parse_completion);
        if !kinds::is_printed(&negative, record.negative) {
            return Err(RecordFault::NegativeText);
        }
        for completion in [&mut positive, &mut negative] {
            for step in &mut completion.steps {
                rename(&mut step.action, &objects);
                step.state.iter_mut().flatten().for_each(|atom| rename(atom, &objects));
            }
        }
        let right = judge(&known.validator, &positive, &words);
        if !right.verdict.is_valid() || !right.finished || right.trace.first_wrong.is_some() {
            return Err(RecordFault::Positive(right.verdict.reason));
        }
        let wrong = judge(&known.validator, &negative, &words);
        let (verdict, step) = match wrong.trace.first_wrong {
            Some(step) if wrong.verdict.is_valid() => ("wrong_state", Some(step)),
            _ => (wrong.verdict.outcome.name(), wrong.verdict.step),
        };
        if verdict != record.negative_verdict || step != Some(record.negative_step) {
            let (verdict, step) = (verdict.to_owned(), step.unwrap_or(0));
            return Err(RecordFault::Negative { verdict, step });
        }
        let followed = wrong.executable_steps == wrong.steps && wrong.trace.first_wrong.is_none();
        let made = kinds::is_made(record.negative_kind, &positive, &negative, followed);
        if made { Ok(()) } else { Err(RecordFault::Kind) }
    }

    /// The domain's action or predicate for each word of the record.
    fn words(&self, record: &Written<'_>) -> HashMap<String, String, FxBuildHasher> {
        let actions = self.domain.actions.iter().map(|action| &action.name);
        let names = actions.chain(self.domain.predicates.iter().map(|predicate| &predicate.name));
        record.words.iter().zip(names).map(|(word, name)| ((*word).to_owned(), name.clone())).collect()
    }

    fn known(&self, id: usize) -> Result<&Known, &ProblemFault> {
        static MISSING: ProblemFault = ProblemFault::Missing;
        let slot = self.known.get(id).ok_or(&MISSING)?;
        slot.get_or_init(|| read(&self.domain, &self.problems[id])).as_ref()
    }
}

fn read(domain: &Arc<Domain>, text: &str) -> Result<Known, ProblemFault> {
    let problem = parse_problem(&Source::new("problem", text), domain, None)?;
    let goal = goal_literals(domain, &problem).ok_or(ProblemFault::Goal)?;
    let task = ground(Arc::clone(domain), Arc::new(problem), &Limits::default())?;
    Ok(Known { validator: Validator::new(Arc::new(task)), goal })
}

/// The goal as a prompt says it: the literals, or all atoms of the state that they single out.
fn asked(task: &Task, goal: &[(GroundAtom, bool)], state: bool) -> crate::negative::Goal {
    if !state {
        return crate::negative::Goal::Literals(goal.to_vec());
    }
    let mut wanted = crate::task::State::empty(task.facts.len());
    goal.iter().filter(|(_, value)| *value).filter_map(|(atom, _)| task.fact(atom)).for_each(|id| wanted.set(id, true));
    crate::negative::Goal::State(wanted)
}

/// The object that each name stands for; names must be as many as the objects and differ, constants keep theirs.
fn slots<'n>(task: &Task, names: &[&'n str]) -> Result<FxHashMap<&'n str, ObjectId>, RecordFault> {
    let fixed = task.domain.constants.len() + task.domain.pending.len();
    let objects = &task.problem.objects;
    let kept = names.len() == objects.len() && (0..fixed).all(|id| names[id] == objects[id].name);
    let slots: FxHashMap<&str, ObjectId> =
        names.iter().enumerate().map(|(id, &name)| (name, ObjectId::from(id))).collect();
    if kept && slots.len() == names.len() { Ok(slots) } else { Err(RecordFault::Names) }
}

fn rename<'a>(atom: &mut TextAtom<'a>, objects: &FxHashMap<&str, &'a str>) {
    for arg in &mut atom.args {
        if let Some(&name) = objects.get(arg) {
            *arg = name;
        }
    }
}
