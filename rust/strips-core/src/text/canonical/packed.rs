//! Atoms in one machine word, and states as sorted rows of them.

use serde::{Deserialize, Serialize};

/// A predicate and its arguments' slots, 16 bits each, so that order of numbers is order of (predicate, slots).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub(crate) struct Packed(u128);

impl Packed {
    /// The most arguments that an atom can have in canonical words; with more, its segment is `<raw>`.
    pub(crate) const MAX_ARITY: usize = 7;

    pub(crate) fn new(predicate: u16) -> Self {
        Self(u128::from(predicate) << 112)
    }

    pub(crate) fn with_arg(self, position: usize, slot: u16) -> Self {
        Self(self.0 | u128::from(slot) << (96 - 16 * position))
    }

    pub(crate) fn predicate(self) -> u16 {
        (self.0 >> 112) as u16
    }

    pub(crate) fn arg(self, position: usize) -> u16 {
        (self.0 >> (96 - 16 * position)) as u16
    }

    /// The atom with each slot exchanged for its rank.
    pub(crate) fn ranked(self, arity: usize, ranks: &[u16]) -> Self {
        let rank = |slot: u16| ranks.get(usize::from(slot)).copied().unwrap_or(slot);
        (0..arity).fold(Self::new(self.predicate()), |atom, position| atom.with_arg(position, rank(self.arg(position))))
    }
}

/// The atoms of a row as a set: ascending, none twice.
pub(crate) fn sorted_set(atoms: &[Packed]) -> Vec<Packed> {
    let mut set = atoms.to_vec();
    if !set.is_sorted_by(|a, b| a < b) {
        set.sort_unstable();
        set.dedup();
    }
    set
}

/// Calls `emit` for each atom of `set` that `other` lacks, in order. Both ascend.
pub(crate) fn difference(set: &[Packed], other: &[Packed], mut emit: impl FnMut(Packed)) {
    let mut others = other.iter().peekable();
    for &atom in set {
        while others.next_if(|&&other| other < atom).is_some() {}
        if others.peek() != Some(&&atom) {
            emit(atom);
        }
    }
}

/// Puts an atom into a state, or takes it out.
pub(crate) fn change(state: &mut Vec<Packed>, atom: Packed, present: bool) {
    match (state.binary_search(&atom), present) {
        (Err(place), true) => state.insert(place, atom),
        (Ok(place), false) => {
            state.remove(place);
        }
        _ => {}
    }
}
