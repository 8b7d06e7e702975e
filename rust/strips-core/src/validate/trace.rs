//! Whether the states that a text says are the true ones.

use super::lookup::Lookup;
use crate::pddl::ast::{GroundAtom, PredicateId};
use crate::task::{OperatorId, Task};
use crate::text::TextAtom;

/// How a trace of states compares with the true one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Trace {
    /// How many states the text says.
    pub states: usize,
    /// How many of them are the true state after their step; a state after a step that cannot be applied is not.
    pub right: usize,
    /// The step, from 1, after which the first wrong state stands.
    pub first_wrong: Option<usize>,
    /// What is true there and not said, as PDDL, sorted; empty if there is no true state.
    pub missing: Vec<String>,
    /// What is said there and not true, as PDDL, sorted.
    pub surplus: Vec<String>,
}

/// Compares what a text says after each step with the states that the operators lead to.
///
/// `operators` are the steps that can be applied one after another, from the first; `states[i]` is what the text says
/// after step `i`, if anything. States are whole (static atoms too, derived ones not); order and repetition in them do not
/// matter.
pub fn check_trace(task: &Task, operators: &[OperatorId], states: &[Option<Vec<TextAtom>>]) -> Trace {
    compare(task, &Lookup::new(task), operators, states.iter().map(Option::as_deref), &|_| None)
}

/// The predicate of a word that is no predicate's name, where there is one.
pub(super) type PredicateWords<'w> = dyn Fn(&str) -> Option<PredicateId> + 'w;

pub(super) fn compare<'s, 't: 's>(
    task: &Task,
    lookup: &Lookup,
    operators: &[OperatorId],
    states: impl Iterator<Item = Option<&'s [TextAtom<'t>]>>,
    words: &PredicateWords<'_>,
) -> Trace {
    let mut trace = Trace::default();
    let mut state = task.init.clone();
    for (step, said) in states.enumerate() {
        let operator = operators.get(step).map(|id| &task.operators[id.index()]);
        if let Some(operator) = operator {
            state = task.apply(operator, &state);
        }
        let Some(said) = said else { continue };
        trace.states += 1;
        let truth = if operator.is_some() { task.atoms_by_reference(&state) } else { Vec::new() };
        if operator.is_some() && is_rendered(task, &truth, said) {
            trace.right += 1;
            continue;
        }
        let difference = Difference::of(task, &|atom| resolve(task, lookup, atom, words), &truth, said);
        if operator.is_some() && difference.is_none() {
            trace.right += 1;
        } else if trace.first_wrong.is_none() {
            trace.first_wrong = Some(step + 1);
            if let Some(difference) = difference {
                (trace.missing, trace.surplus) = (difference.missing, difference.surplus);
            }
        }
    }
    trace
}

/// Whether a state is said as it is rendered in the domain's own words: then nothing needs to be looked up.
fn is_rendered(task: &Task, truth: &[&GroundAtom], said: &[TextAtom]) -> bool {
    let same = |atom: &GroundAtom, said: &TextAtom| {
        let names = atom.args.iter().map(|id| task.problem.objects[id.index()].name.as_str());
        task.domain.predicates[atom.predicate.index()].name == said.name && names.eq(said.args.iter().copied())
    };
    truth.len() == said.len() && truth.iter().zip(said).all(|(atom, said)| same(atom, said))
}

struct Difference {
    missing: Vec<String>,
    surplus: Vec<String>,
}

impl Difference {
    /// What two states differ in; none if they are the same.
    fn of(
        task: &Task,
        resolve: &dyn Fn(&TextAtom) -> Option<GroundAtom>,
        truth: &[&GroundAtom],
        said: &[TextAtom],
    ) -> Option<Self> {
        let mut known = Vec::with_capacity(said.len());
        let mut surplus = Vec::new();
        for atom in said {
            match resolve(atom) {
                Some(atom) => known.push(atom),
                None => surplus.push(format!("({})", [&[atom.name], atom.args.as_slice()].concat().join(" "))),
            }
        }
        known.sort_unstable();
        known.dedup();
        if surplus.is_empty() && known.iter().eq(truth.iter().copied()) {
            return None;
        }
        let name = |atom: &GroundAtom| super::explain::atom_text(atom, task);
        surplus.extend(known.iter().filter(|atom| truth.binary_search(atom).is_err()).map(name));
        let missing = truth.iter().filter(|atom| known.binary_search(atom).is_err()).map(|atom| name(atom));
        let mut missing: Vec<String> = missing.collect();
        missing.sort_unstable();
        surplus.sort_unstable();
        surplus.dedup();
        Some(Self { missing, surplus })
    }
}

fn resolve(task: &Task, lookup: &Lookup, atom: &TextAtom, words: &PredicateWords<'_>) -> Option<GroundAtom> {
    let name = atom.name.to_ascii_lowercase();
    let predicate = task.domain.predicate(&name).or_else(|| words(atom.name))?;
    let args = atom.args.iter().map(|arg| lookup.object(arg)).collect::<Option<Vec<_>>>()?;
    (task.domain.predicates[predicate.index()].parameters.len() == args.len()).then_some(GroundAtom { predicate, args })
}
