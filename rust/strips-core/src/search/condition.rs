//! Conditions and effects compiled to masks over the words of a packed state.

use crate::task::{FactId, Formula, GroundCondition, GroundEffect};

/// Wants `words[word] & mask == value`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Test {
    pub word: u32,
    pub mask: u64,
    pub value: u64,
}

impl Test {
    /// Whether the test passes.
    #[inline]
    pub fn passes(&self, words: &[u64]) -> bool {
        words[self.word as usize] & self.mask == self.value
    }
}

/// A condition as masks, one for each word it reads, and what is left of its disjunctions.
#[derive(Clone, Debug, Default)]
pub(super) struct Masks {
    pub tests: Vec<Test>,
    pub clauses: Vec<Formula>,
}

impl Masks {
    /// Compiles a condition. One that wants a fact both true and false gets a test that never passes.
    pub fn new(condition: &GroundCondition) -> Self {
        let mut masks = Self { tests: Vec::new(), clauses: condition.clauses.clone() };
        condition.positive.iter().for_each(|&fact| masks.want(fact, true));
        condition.negative.iter().for_each(|&fact| masks.want(fact, false));
        masks
    }

    /// Adds one literal.
    fn want(&mut self, fact: FactId, value: bool) {
        let (word, bit) = position(fact);
        let known = self.tests.iter_mut().find(|test| test.word == word && test.mask != 0);
        match known {
            Some(test) if test.mask & bit == 0 => {
                test.mask |= bit;
                test.value |= if value { bit } else { 0 };
            }
            Some(test) if (test.value & bit != 0) == value => {}
            Some(_) => self.tests.push(Test { word, mask: 0, value: 1 }),
            None => self.tests.push(Test { word, mask: bit, value: if value { bit } else { 0 } }),
        }
    }

    /// Whether the condition is true in the state.
    #[inline]
    pub fn hold(&self, words: &[u64]) -> bool {
        self.tests.iter().all(|test| test.passes(words)) && self.clauses.iter().all(|clause| satisfied(clause, words))
    }
}

/// Word and bit of a fact.
pub(super) fn position(fact: FactId) -> (u32, u64) {
    ((fact.index() / 64) as u32, 1 << (fact.index() % 64))
}

/// Whether the formula is true in the packed state.
pub(super) fn satisfied(formula: &Formula, words: &[u64]) -> bool {
    match formula {
        Formula::Literal(fact, value) => {
            let (word, bit) = position(*fact);
            (words[word as usize] & bit != 0) == *value
        }
        Formula::And(parts) => parts.iter().all(|part| satisfied(part, words)),
        Formula::Or(parts) => parts.iter().any(|part| satisfied(part, words)),
    }
}

/// What happens to one word: `word & !delete | add`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    pub word: u32,
    pub delete: u64,
    pub add: u64,
}

/// The changes of several effects that fire together, a word each: every delete before any add.
pub(super) fn changes<'a>(effects: impl Iterator<Item = &'a GroundEffect>) -> Vec<Change> {
    let mut changes: Vec<Change> = Vec::new();
    for effect in effects {
        effect.del_effects.iter().for_each(|&fact| touch(&mut changes, fact).delete |= position(fact).1);
        effect.add_effects.iter().for_each(|&fact| touch(&mut changes, fact).add |= position(fact).1);
    }
    changes.sort_unstable_by_key(|change| change.word);
    changes
}

/// The change of the fact's word, made if there is none yet.
fn touch(changes: &mut Vec<Change>, fact: FactId) -> &mut Change {
    let word = position(fact).0;
    let at = changes.iter().position(|change| change.word == word).unwrap_or_else(|| {
        changes.push(Change { word, delete: 0, add: 0 });
        changes.len() - 1
    });
    &mut changes[at]
}
