//! Whether a prompt asks what its problem asks.

use rustc_hash::FxHashMap;

use super::{RecordFault, Written};
use crate::pddl::ast::{GroundAtom, ObjectId, PredicateId};
use crate::task::Task;
use crate::text::{Goal, GoalStyle, Naming, Prompt, Style, TextAtom, parse_prompt, render_prompt};

/// What the prompt should ask.
pub(super) struct Asked<'k> {
    pub style: Style,
    pub goal_style: GoalStyle,
    pub goal: &'k [(GroundAtom, bool)],
}

/// Checks the prompt; how many of the record's `words` its texts say: none, the actions', or all.
pub(super) fn check(
    task: &Task,
    asked: &Asked<'_>,
    record: &Written<'_>,
    slots: &FxHashMap<&str, ObjectId>,
) -> Result<usize, RecordFault> {
    let prompt = parse_prompt(record.prompt).map_err(|_| RecordFault::PromptText)?;
    check_objects(asked.style, &prompt, record)?;
    let said = check_words(task, asked.style, &prompt, record)?;
    let reader = Reader::new(task, slots, record.words[..said].get(task.domain.actions.len()..).unwrap_or_default())?;
    let goal = reader.literals(&prompt.goal).ok_or(RecordFault::Goal)?;
    let init = prompt.init.iter().map(|atom| reader.atom(atom)).collect::<Option<Vec<_>>>();
    let init = init.ok_or(RecordFault::Init)?;
    if sorted(&init) != sorted(&task.problem.init) {
        return Err(RecordFault::Init);
    }
    check_goal(task, asked, &goal)?;
    let naming = Naming::new(&task.domain, &task.problem.objects, &record.names, &record.words[..said]);
    let atoms: Vec<GroundAtom> = goal.iter().map(|(atom, _)| atom.clone()).collect();
    let goal = match asked.goal_style {
        GoalStyle::State => Goal::State(&atoms),
        GoalStyle::Problem => Goal::Problem(&goal),
    };
    let mut printed = String::with_capacity(record.prompt.len());
    render_prompt(&naming, asked.style, goal, &init, &mut printed);
    if printed == record.prompt { Ok(said) } else { Err(RecordFault::PromptText) }
}

/// The typed style says the objects, with the record's names.
fn check_objects(style: Style, prompt: &Prompt<'_>, record: &Written<'_>) -> Result<(), RecordFault> {
    if prompt.objects.is_some() != (style == Style::Typed) {
        return Err(RecordFault::Style);
    }
    let names = prompt.objects.as_ref().map(|objects| objects.iter().map(|&(name, _)| name).collect::<Vec<_>>());
    if names.is_some_and(|names| names != record.names) {
        return Err(RecordFault::Objects);
    }
    Ok(())
}

/// The legend says words for all actions or for all actions and predicates; the words that it does not say are the
/// domain's own, but for the actions' in the report's style.
fn check_words(task: &Task, style: Style, prompt: &Prompt<'_>, record: &Written<'_>) -> Result<usize, RecordFault> {
    let (domain, words) = (&task.domain, &record.words);
    let legend: Vec<&str> = prompt.vocab.iter().flatten().map(|&(_, word)| word).collect();
    let said = match &prompt.vocab {
        Some(pairs) => pairs.len(),
        None if style == Style::Paper => domain.actions.len(),
        None => 0,
    };
    let is_whole = [0, domain.actions.len(), words.len()].contains(&said);
    let own = domain.actions.iter().map(|action| &action.name);
    let own = own.chain(domain.predicates.iter().map(|predicate| &predicate.name));
    let others_are_own = own.zip(words).skip(said).all(|(own, word)| own == word);
    if is_whole && words.starts_with(&legend) && others_are_own { Ok(said) } else { Err(RecordFault::Words) }
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

/// Reads the atoms of a text.
struct Reader<'k> {
    task: &'k Task,
    slots: &'k FxHashMap<&'k str, ObjectId>,
    /// The predicate of each word; empty where all go by their names.
    predicates: FxHashMap<&'k str, PredicateId>,
}

impl<'k> Reader<'k> {
    /// `words` has a word for each predicate, all different, or none.
    fn new(task: &'k Task, slots: &'k FxHashMap<&'k str, ObjectId>, words: &[&'k str]) -> Result<Self, RecordFault> {
        let predicates: FxHashMap<_, _> =
            words.iter().enumerate().map(|(id, &word)| (word, PredicateId::from(id))).collect();
        if predicates.len() == words.len() { Ok(Self { task, slots, predicates }) } else { Err(RecordFault::Words) }
    }

    fn literals(&self, said: &[(TextAtom<'_>, bool)]) -> Option<Vec<(GroundAtom, bool)>> {
        said.iter().map(|(atom, value)| Some((self.atom(atom)?, *value))).collect()
    }

    fn atom(&self, atom: &TextAtom<'_>) -> Option<GroundAtom> {
        let own = self.predicates.is_empty();
        let predicate = if own { self.task.domain.predicate(atom.name)? } else { *self.predicates.get(atom.name)? };
        let args = atom.args.iter().map(|name| self.slots.get(name).copied()).collect::<Option<Vec<ObjectId>>>()?;
        Some(GroundAtom { predicate, args })
    }
}

fn sorted<T: Ord + Clone>(items: &[T]) -> Vec<T> {
    let mut items = items.to_vec();
    items.sort_unstable();
    items
}
