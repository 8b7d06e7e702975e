//! The goal's words: whole states as differences, literals with what holds already.

use super::super::super::GoalStyle;
use super::super::super::scan::{Scanner, Spacing};
use super::super::Layout;
use super::super::packed::{Packed, difference, sorted_set};
use super::super::segments::Marker;
use super::super::vocabulary::{NOT, PARTIAL, RAW, Sign, Word};
use super::super::wanted::Wanted;
use super::{Atoms, Encoder, content};

impl<'t> Encoder<'_, 't, '_> {
    /// The goal's atoms, and which of them are negated.
    pub(super) fn read_literals(&mut self, tail: &'t str) -> Option<(Atoms, Vec<bool>)> {
        let (start, mut signs) = (self.atoms.len(), Vec::new());
        let mut scanner = Scanner::new(content(tail)?, Spacing::Exact);
        let mut args = Vec::new();
        let read = scanner.list(|scanner| {
            signs.push(!scanner.literal("not "));
            let name = scanner.atom(&mut args)?;
            let atom = self.pack(name, &args).ok_or_else(|| scanner.malformed("an atom of the domain"))?;
            self.atoms.push(atom);
            Ok(())
        });
        if read.is_err() || !scanner.at_end() {
            self.atoms.truncate(start);
            return None;
        }
        self.goal = start..self.atoms.len();
        self.goal_is_sorted = signs.iter().all(|&positive| positive);
        Some((self.goal.clone(), signs))
    }

    pub(super) fn write_goal(&mut self, goal: Option<(Atoms, Vec<bool>)>, tail: &str) {
        self.words.push(Marker::Goal as Word);
        match goal {
            None => {
                self.words.push(RAW);
                self.exceptions.goal = Some(tail.to_owned());
            }
            Some((atoms, signs)) if self.codec.layout() == Layout::Report => {
                for (position, positive) in atoms.zip(signs) {
                    self.words.extend((!positive).then_some(NOT));
                    self.emit(Sign::Plain, self.atoms[position]);
                }
            }
            Some((atoms, signs)) if self.is_whole(&atoms, &signs) => self.write_whole_goal(atoms),
            Some((atoms, signs)) => self.write_partial_goal(atoms, &signs),
        }
    }

    fn write_whole_goal(&mut self, goal: Atoms) {
        self.goal_is_set = true;
        let (init, goal) = (sorted_set(&self.atoms[self.init.clone()]), sorted_set(&self.atoms[goal]));
        difference(&goal, &init, |atom| self.emit(Sign::Wanted, atom));
        difference(&init, &goal, |atom| self.emit(Sign::Unwanted, atom));
        self.wants(Wanted::whole(goal));
    }

    fn write_partial_goal(&mut self, goal: Atoms, signs: &[bool]) {
        self.words.push(PARTIAL);
        let literals = goal.clone().zip(signs.iter().copied());
        self.wants(Wanted::literals(literals.map(|(position, positive)| (self.atoms[position], positive))));
        let init = sorted_set(&self.atoms[self.init.clone()]);
        for (position, &positive) in goal.zip(signs) {
            let atom = self.atoms[position];
            let sign = match (positive, init.binary_search(&atom).is_ok()) {
                (true, false) => Sign::Wanted,
                (true, true) => Sign::Kept,
                (false, true) => Sign::Unwanted,
                (false, false) => Sign::Avoided,
            };
            self.emit(sign, atom);
        }
    }

    fn wants(&mut self, wanted: Wanted) {
        self.wanted = (self.codec.layout() == Layout::Progress).then_some(wanted);
    }

    /// Whether the goal is a whole state, told or guessed.
    fn is_whole(&self, goal: &Atoms, signs: &[bool]) -> bool {
        if signs.contains(&false) {
            return false;
        }
        let (goal, init) = (&self.atoms[goal.clone()], &self.atoms[self.init.clone()]);
        match self.hints.goal_style {
            Some(style) => style == GoalStyle::State,
            None => self.looks_whole(goal, init),
        }
    }

    /// The guess of [`super::super::Hints::goal_style`].
    fn looks_whole(&self, goal: &[Packed], init: &[Packed]) -> bool {
        let is_static = |atom: &Packed| !self.signature.predicates[usize::from(atom.predicate())].fluent;
        let mut predicates: Vec<u16> = init.iter().map(|atom| atom.predicate()).collect();
        predicates.sort_unstable();
        predicates.dedup();
        let named = predicates.iter().filter(|&&p| goal.iter().any(|atom| atom.predicate() == p)).count();
        let shares = init.is_empty() || init.iter().any(|atom| goal.contains(atom));
        goal.is_sorted_by_key(|atom| atom.predicate())
            && 2 * goal.len() >= init.len()
            && 5 * named >= 2 * predicates.len()
            && (shares || 4 * goal.len() >= 3 * init.len())
            && init.iter().all(|atom| !is_static(atom) || goal.contains(atom))
    }
}
