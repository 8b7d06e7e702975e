//! A state: one bit a fact, packed into words.

use super::{FactId, Formula, GroundCondition, Operator, Task};

/// The set of facts that are true, as bits in words; bit `i` of word `i / 64` is fact `i`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct State(pub Box<[u64]>);

impl State {
    /// The state of `facts` facts of which none is true.
    pub fn empty(facts: usize) -> Self {
        Self(vec![0; facts.div_ceil(64)].into_boxed_slice())
    }

    /// Whether the fact is true.
    pub fn holds(&self, fact: FactId) -> bool {
        self.0[fact.index() / 64] >> (fact.index() % 64) & 1 == 1
    }

    /// How many facts are true.
    pub fn count(&self) -> usize {
        self.0.iter().map(|word| word.count_ones() as usize).sum()
    }

    /// The facts that are true, ascending.
    pub fn facts(&self) -> impl Iterator<Item = FactId> {
        self.0.iter().enumerate().flat_map(|(word, &bits)| {
            let left = |&bits: &u64| Some(bits & (bits - 1)).filter(|&left| left != 0);
            let words = std::iter::successors(Some(bits).filter(|&bits| bits != 0), left);
            words.map(move |bits| FactId::from(word * 64 + bits.trailing_zeros() as usize))
        })
    }

    /// Makes the fact true or false.
    pub fn set(&mut self, fact: FactId, value: bool) {
        let bit = 1 << (fact.index() % 64);
        let word = &mut self.0[fact.index() / 64];
        *word = if value { *word | bit } else { *word & !bit };
    }
}

impl GroundCondition {
    /// Whether the condition is true in the state.
    pub fn holds(&self, state: &State) -> bool {
        self.positive.iter().all(|&fact| state.holds(fact))
            && !self.negative.iter().any(|&fact| state.holds(fact))
            && self.clauses.iter().all(|clause| clause.holds(state))
    }

    /// Whether the condition is true in every state.
    pub fn is_empty(&self) -> bool {
        self.positive.is_empty() && self.negative.is_empty() && self.clauses.is_empty()
    }
}

impl Formula {
    /// Whether the formula is true in the state.
    pub fn holds(&self, state: &State) -> bool {
        match self {
            Formula::Literal(fact, value) => state.holds(*fact) == *value,
            Formula::And(parts) => parts.iter().all(|part| part.holds(state)),
            Formula::Or(parts) => parts.iter().any(|part| part.holds(state)),
        }
    }
}

impl Operator {
    /// Whether the operator may be applied in the state.
    pub fn applicable(&self, state: &State) -> bool {
        self.precondition.holds(state)
    }
}

impl Task {
    /// The state after `operator`, which must be applicable in `state`: deletes, then adds, then axioms.
    pub fn apply(&self, operator: &Operator, state: &State) -> State {
        let fires = |effect: &&super::GroundEffect| effect.condition.holds(state);
        let mut next = state.clone();
        for effect in operator.effects.iter().filter(fires) {
            effect.del_effects.iter().for_each(|&fact| next.set(fact, false));
        }
        for effect in operator.effects.iter().filter(fires) {
            effect.add_effects.iter().for_each(|&fact| next.set(fact, true));
        }
        self.derive(&mut next);
        next
    }

    /// Recomputes the derived facts of `state` from its basic ones.
    pub fn derive(&self, state: &mut State) {
        self.axioms.derived.iter().for_each(|&fact| state.set(fact, false));
        for layer in &self.axioms.layers {
            let mut changed = true;
            while changed {
                changed = false;
                for (head, body) in layer {
                    if !state.holds(*head) && body.holds(state) {
                        state.set(*head, true);
                        changed = true;
                    }
                }
            }
        }
    }
}
