//! Whether a prompt asks what its problem asks.

use rustc_hash::FxHashMap;

use super::{RecordFault, Written};
use crate::pddl::ast::{GroundAtom, ObjectId};
use crate::task::Task;
use crate::text::{Goal, GoalStyle, Naming, Prompt, Style, TextAtom, parse_prompt, render_prompt};

/// What the prompt should ask.
pub(super) struct Asked<'k> {
    pub style: Style,
    pub goal_style: GoalStyle,
    pub goal: &'k [(GroundAtom, bool)],
}

/// Checks the prompt; whether the record's text calls actions by its `words`.
pub(super) fn check(
    task: &Task,
    asked: &Asked<'_>,
    record: &Written<'_>,
    slots: &FxHashMap<&str, ObjectId>,
) -> Result<bool, RecordFault> {
    let prompt = parse_prompt(record.prompt).map_err(|_| RecordFault::PromptText)?;
    check_style(task, asked.style, &prompt, record)?;
    let goal = literals(task, &prompt.goal, slots).ok_or(RecordFault::Goal)?;
    let init = prompt.init.iter().map(|atom| ground_atom(task, atom, slots)).collect::<Option<Vec<_>>>();
    let init = init.ok_or(RecordFault::Init)?;
    if sorted(&init) != sorted(&task.problem.init) {
        return Err(RecordFault::Init);
    }
    check_goal(task, asked, &goal)?;
    let uses_words = asked.style == Style::Paper || prompt.vocab.is_some();
    let words = uses_words.then_some(&record.words[..]);
    let naming = Naming { domain: &task.domain, objects: &task.problem.objects, names: Some(&record.names[..]), words };
    let atoms: Vec<GroundAtom> = goal.iter().map(|(atom, _)| atom.clone()).collect();
    let goal = match asked.goal_style {
        GoalStyle::State => Goal::State(&atoms),
        GoalStyle::Problem => Goal::Problem(&goal),
    };
    let mut printed = String::with_capacity(record.prompt.len());
    render_prompt(&naming, asked.style, goal, &init, &mut printed);
    if printed == record.prompt { Ok(uses_words) } else { Err(RecordFault::PromptText) }
}

/// The typed style says the objects, with the record's names, and words unless they are the domain's own.
fn check_style(task: &Task, style: Style, prompt: &Prompt<'_>, record: &Written<'_>) -> Result<(), RecordFault> {
    if prompt.objects.is_some() != (style == Style::Typed) {
        return Err(RecordFault::Style);
    }
    let names = prompt.objects.as_ref().map(|objects| objects.iter().map(|&(name, _)| name).collect::<Vec<_>>());
    if names.is_some_and(|names| names != record.names) {
        return Err(RecordFault::Objects);
    }
    let own = || task.domain.actions.iter().map(|action| action.name.as_str());
    let said: Vec<&str> = match &prompt.vocab {
        Some(pairs) => pairs.iter().map(|&(_, word)| word).collect(),
        None if style == Style::Paper => return Ok(()),
        None => own().collect(),
    };
    if said == record.words { Ok(()) } else { Err(RecordFault::Words) }
}

fn check_goal(task: &Task, asked: &Asked<'_>, said: &[(GroundAtom, bool)]) -> Result<(), RecordFault> {
    if asked.goal_style == GoalStyle::Problem {
        return if sorted(said) == sorted(asked.goal) { Ok(()) } else { Err(RecordFault::Goal) };
    }
    let basic = |atom: &&GroundAtom| !task.domain.predicates[atom.predicate.index()].derived;
    if asked.goal.len() != task.facts.iter().filter(basic).count() {
        return Err(RecordFault::GoalStyle);
    }
    let wanted = asked.goal.iter().filter(|(_, value)| *value).map(|(atom, _)| atom);
    let mut wanted: Vec<(GroundAtom, bool)> =
        wanted.chain(&task.static_facts).map(|atom| (atom.clone(), true)).collect();
    wanted.sort_unstable();
    if sorted(said) == wanted { Ok(()) } else { Err(RecordFault::Goal) }
}

fn literals(
    task: &Task,
    said: &[(TextAtom<'_>, bool)],
    slots: &FxHashMap<&str, ObjectId>,
) -> Option<Vec<(GroundAtom, bool)>> {
    said.iter().map(|(atom, value)| Some((ground_atom(task, atom, slots)?, *value))).collect()
}

fn ground_atom(task: &Task, atom: &TextAtom<'_>, slots: &FxHashMap<&str, ObjectId>) -> Option<GroundAtom> {
    let predicate = task.domain.predicate(atom.name)?;
    let args = atom.args.iter().map(|name| slots.get(name).copied()).collect::<Option<Vec<ObjectId>>>()?;
    Some(GroundAtom { predicate, args })
}

fn sorted<T: Ord + Clone>(items: &[T]) -> Vec<T> {
    let mut items = items.to_vec();
    items.sort_unstable();
    items
}
