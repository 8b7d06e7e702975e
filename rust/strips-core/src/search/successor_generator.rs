//! Which operators a packed state allows, and where they lead.
//!
//! Every operator is filed under one fact that it needs: of its positive preconditions, the one that the fewest
//! operators share. For a state, only the files of its true facts are read, and the rest of each precondition is a few
//! masked comparisons. Operators that need no positive fact are always read. In blocksworld a state's true facts lead
//! to little more than the applicable operators themselves. A full decision tree tests less where many operators share
//! all their facts, but costs a dependent load per node; the flat files were faster on every domain measured.
//!
//! Conditional effects and axioms take a slower way through [`SuccessorGenerator::successor`]; clauses are evaluated
//! after the masks have passed.

use super::condition::{Change, Masks, Test, changes, position, satisfied};
use crate::task::{FactId, Formula, GroundEffect, Operator, OperatorId, State, Task};

/// Finds applicable operators and successor states of packed states.
#[derive(Clone, Debug)]
pub struct SuccessorGenerator {
    width: usize,
    /// Facts under which operators are filed, as bits.
    watched: Vec<u64>,
    /// For each fact, where its file begins in `entries`; the operators without such a fact come last.
    files: Vec<u32>,
    entries: Vec<Entry>,
    tests: Vec<Test>,
    clauses: Vec<Vec<Formula>>,
    effects: Vec<Outcome>,
    changes: Vec<Change>,
    axioms: Vec<Vec<(FactId, Masks)>>,
    derived: Vec<Change>,
}

/// An operator in a file: its remaining tests are `tests[first..last]`.
#[derive(Clone, Copy, Debug)]
struct Entry {
    operator: u32,
    first: u32,
    last: u32,
    /// Position in `clauses`, or `u32::MAX`.
    clauses: u32,
}

/// What an operator does: `changes[first..last]`, and then what fires of `conditional`.
#[derive(Clone, Debug)]
struct Outcome {
    first: u32,
    last: u32,
    conditional: Vec<(Masks, Vec<Change>)>,
}

impl SuccessorGenerator {
    /// Compiles the operators and axioms of a task; linear in their size.
    pub fn new(task: &Task) -> Self {
        let width = words_for(task.facts.len());
        let mut generator = Self::without_operators(task, width);
        generator.file_operators(task);
        task.operators.iter().for_each(|operator| generator.add_outcome(operator));
        generator
    }

    fn without_operators(task: &Task, width: usize) -> Self {
        let derived = GroundEffect { del_effects: task.axioms.derived.clone(), ..GroundEffect::default() };
        let compile = |(head, body): &(FactId, _)| (*head, Masks::new(body));
        Self {
            width,
            watched: vec![0; width],
            files: Vec::new(),
            entries: Vec::new(),
            tests: Vec::new(),
            clauses: Vec::new(),
            effects: Vec::with_capacity(task.operators.len()),
            changes: Vec::new(),
            axioms: task.axioms.layers.iter().map(|layer| layer.iter().map(compile).collect()).collect(),
            derived: changes(std::iter::once(&derived)),
        }
    }

    /// Sorts the operators into files and writes these one after the other.
    fn file_operators(&mut self, task: &Task) {
        let keys = watched_facts(task);
        let mut order: Vec<u32> = (0..task.operators.len() as u32).collect();
        order.sort_by_key(|&operator| keys[operator as usize].map_or(u32::MAX, |fact| fact.0));
        self.files = vec![0; task.facts.len() + 1];
        for operator in order {
            let key = keys[operator as usize];
            self.add_entry(operator, &task.operators[operator as usize], key);
            if let Some(fact) = key {
                let (word, bit) = position(fact);
                self.watched[word as usize] |= bit;
                self.files[fact.index() + 1] = self.entries.len() as u32;
            }
        }
        (1..self.files.len()).for_each(|fact| self.files[fact] = self.files[fact].max(self.files[fact - 1]));
    }

    fn add_entry(&mut self, operator: u32, source: &Operator, key: Option<FactId>) {
        let masks = Masks::new(&source.precondition);
        let first = self.tests.len() as u32;
        self.tests.extend(masks.tests.iter().filter_map(|&test| without(test, key)));
        let clauses = if masks.clauses.is_empty() { u32::MAX } else { self.clauses.len() as u32 };
        if !masks.clauses.is_empty() {
            self.clauses.push(masks.clauses);
        }
        self.entries.push(Entry { operator, first, last: self.tests.len() as u32, clauses });
    }

    fn add_outcome(&mut self, operator: &Operator) {
        let (always, sometimes): (Vec<_>, Vec<_>) =
            operator.effects.iter().partition(|effect| effect.condition.is_empty());
        let first = self.changes.len() as u32;
        self.changes.extend(changes(always.into_iter()));
        let compile = |effect: &GroundEffect| (Masks::new(&effect.condition), changes(std::iter::once(effect)));
        let conditional = sometimes.into_iter().map(compile).collect();
        self.effects.push(Outcome { first, last: self.changes.len() as u32, conditional });
    }

    /// Words of a packed state.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The operators that may be applied in `state`, ascending.
    pub fn applicable(&self, state: &State) -> Vec<OperatorId> {
        let mut found = Vec::new();
        self.applicable_in(&state.0, &mut found);
        found.into_iter().map(OperatorId).collect()
    }

    /// The state after `operator`, which must be applicable in `state`.
    pub fn successor(&self, state: &State, operator: OperatorId) -> State {
        let mut next = state.clone();
        self.apply(operator.0, &state.0, &mut next.0);
        next
    }

    /// Replaces the content of `found` by the applicable operators, ascending.
    #[inline]
    pub(crate) fn applicable_in(&self, words: &[u64], found: &mut Vec<u32>) {
        found.clear();
        for (word, (&state, &watched)) in words.iter().zip(&self.watched).enumerate() {
            let mut bits = state & watched;
            while bits != 0 {
                let fact = word * 64 + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                self.read_file(self.files[fact], self.files[fact + 1], words, found);
            }
        }
        let rest = self.files.last().copied().unwrap_or(0);
        self.read_file(rest, self.entries.len() as u32, words, found);
        found.sort_unstable();
    }

    /// The first operator that leads from one packed state to the other.
    pub(super) fn operator_between(&self, from: &[u64], to: &[u64]) -> u32 {
        let mut applicable = Vec::new();
        self.applicable_in(from, &mut applicable);
        let leads = |&operator: &u32| {
            let mut next = from.to_vec();
            self.apply(operator, from, &mut next);
            next == to
        };
        applicable.into_iter().find(leads).expect("the second state was found by expanding the first")
    }

    #[inline]
    fn read_file(&self, first: u32, last: u32, words: &[u64], found: &mut Vec<u32>) {
        for entry in &self.entries[first as usize..last as usize] {
            let tests = &self.tests[entry.first as usize..entry.last as usize];
            if tests.iter().all(|test| test.passes(words)) && self.clauses_hold(entry, words) {
                found.push(entry.operator);
            }
        }
    }

    #[inline]
    fn clauses_hold(&self, entry: &Entry, words: &[u64]) -> bool {
        entry.clauses == u32::MAX || self.clauses[entry.clauses as usize].iter().all(|clause| satisfied(clause, words))
    }

    /// Writes the state after `operator` to `next`, which must hold a copy of `words`.
    #[inline]
    pub(crate) fn apply(&self, operator: u32, words: &[u64], next: &mut [u64]) {
        let outcome = &self.effects[operator as usize];
        let changes = &self.changes[outcome.first as usize..outcome.last as usize];
        if outcome.conditional.is_empty() {
            for change in changes {
                change.make(next);
            }
        } else {
            apply_conditional(outcome, changes, words, next);
        }
        if !self.axioms.is_empty() {
            self.derive(next);
        }
    }

    /// Recomputes the derived facts, stratum by stratum to the fixed point.
    fn derive(&self, words: &mut [u64]) {
        self.derived.iter().for_each(|change| change.make(words));
        for layer in &self.axioms {
            while layer.iter().fold(false, |changed, (head, body)| fire(*head, body, words) || changed) {}
        }
    }
}

impl Change {
    #[inline]
    fn make(&self, words: &mut [u64]) {
        let word = &mut words[self.word as usize];
        *word = *word & !self.delete | self.add;
    }
}

/// Conditions are read in the state before; over all that fires, deletes come before adds.
fn apply_conditional(outcome: &Outcome, always: &[Change], words: &[u64], next: &mut [u64]) {
    let firing = || outcome.conditional.iter().filter(|(condition, _)| condition.hold(words)).flat_map(|(_, c)| c);
    always.iter().chain(firing()).for_each(|change| next[change.word as usize] &= !change.delete);
    always.iter().chain(firing()).for_each(|change| next[change.word as usize] |= change.add);
}

/// Makes the head true if its body holds; whether that changed anything.
fn fire(head: FactId, body: &Masks, words: &mut [u64]) -> bool {
    let (word, bit) = position(head);
    let fires = words[word as usize] & bit == 0 && body.hold(words);
    if fires {
        words[word as usize] |= bit;
    }
    fires
}

/// The test without the fact that the file already guarantees; nothing if it tests no more.
fn without(test: Test, key: Option<FactId>) -> Option<Test> {
    let bit = key.map(position).filter(|&(word, _)| word == test.word).map_or(0, |(_, bit)| bit);
    let rest = Test { mask: test.mask & !bit, value: test.value & !(bit & test.mask), ..test };
    (rest.mask != 0 || rest.value != 0).then_some(rest)
}

/// For each operator the positive precondition that the fewest operators share.
fn watched_facts(task: &Task) -> Vec<Option<FactId>> {
    let mut uses = vec![0u32; task.facts.len()];
    let needed = || task.operators.iter().flat_map(|operator| &operator.precondition.positive);
    needed().for_each(|fact| uses[fact.index()] += 1);
    let rarest = |operator: &Operator| {
        operator.precondition.positive.iter().copied().min_by_key(|fact| (uses[fact.index()], *fact))
    };
    task.operators.iter().map(rarest).collect()
}

/// Words that hold this many facts. A task without facts still has states of one word, so that states have a size.
pub(super) fn words_for(facts: usize) -> usize {
    facts.div_ceil(64).max(1)
}
