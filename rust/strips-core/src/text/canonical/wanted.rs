//! What a goal wants, by which a change of state leads toward it or away from it.

use serde::{Deserialize, Serialize};

use super::packed::Packed;
use super::vocabulary::Sign;

/// What a goal wants of atoms: each that is true of its state, or what its literals say.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wanted {
    /// Whether the goal is a whole state, so that it wants everything else to be false.
    whole: bool,
    /// Must be true; ascending.
    yes: Vec<Packed>,
    /// Must be false; ascending.
    no: Vec<Packed>,
}

impl Wanted {
    /// What a goal wants that is a whole state of these atoms, which ascend.
    pub(super) fn whole(yes: Vec<Packed>) -> Self {
        Self { whole: true, yes, no: Vec::new() }
    }

    /// What literals want, each an atom and whether it is positive.
    pub(super) fn literals(literals: impl Iterator<Item = (Packed, bool)>) -> Self {
        let mut wanted = Self::default();
        literals.for_each(|(atom, positive)| if positive { &mut wanted.yes } else { &mut wanted.no }.push(atom));
        wanted.yes.sort_unstable();
        wanted.no.sort_unstable();
        wanted
    }

    /// Whether an atom must be true, where the goal says so.
    fn of(&self, atom: Packed) -> Option<bool> {
        if self.yes.binary_search(&atom).is_ok() {
            Some(true)
        } else {
            (self.whole || self.no.binary_search(&atom).is_ok()).then_some(false)
        }
    }

    /// The sign of an atom that becomes true, or false.
    fn sign(&self, atom: Packed, added: bool) -> Sign {
        match (self.of(atom), added) {
            (None, true) => Sign::Added,
            (None, false) => Sign::Removed,
            (Some(true), true) => Sign::AddedToward,
            (Some(false), true) => Sign::AddedAway,
            (Some(true), false) => Sign::RemovedAway,
            (Some(false), false) => Sign::RemovedToward,
        }
    }
}

/// The sign of an atom that becomes true, or false, where it is said what the goal wants, or is not.
pub(crate) fn sign_of_change(wanted: Option<&Wanted>, atom: Packed, added: bool) -> Sign {
    match wanted {
        Some(wanted) => wanted.sign(atom, added),
        None if added => Sign::Added,
        None => Sign::Removed,
    }
}
