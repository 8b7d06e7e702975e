//! Reading the segments of a text into slots, and what they tell about the order of objects.

use super::super::super::scan::{Scanner, Spacing};
use super::super::decode::Speech;
use super::super::order::{ranks_by_names, ranks_from};
use super::super::packed::Packed;
use super::super::segments::{Marker, Segment};
use super::{Atoms, Encoder, Row, content};

impl<'t> Encoder<'_, 't, '_> {
    /// Reads a segment of the completion, giving slots to objects that only it names.
    pub(super) fn read(&mut self, (marker, tail): Segment<'t>) -> Row {
        let row = match marker {
            Marker::Action => self.read_action(tail),
            Marker::State => self.read_atoms(tail).map(Row::State),
            _ => tail.is_empty().then_some(Row::Bare),
        };
        row.unwrap_or(Row::Raw)
    }

    fn read_action(&mut self, tail: &'t str) -> Option<Row> {
        let mut args = Vec::new();
        let mut scanner = Scanner::new(content(tail)?, Spacing::Exact);
        let word = scanner.atom(&mut args).ok()?;
        let action = if scanner.at_end() { self.action(word)? } else { return None };
        let slots = args.into_iter().map(|name| self.slot(name)).collect::<Option<_>>()?;
        Some(Row::Action(action, slots))
    }

    /// The action of a word, and that from here on this is its word.
    fn action(&mut self, word: &'t str) -> Option<usize> {
        if let Some(action) = self.action_words.iter().position(|known| *known == Some(word)) {
            return Some(action);
        }
        let action = usize::from(*self.tables.actions_by_word.get(word)?);
        self.action_words[action].is_none().then(|| self.action_words[action] = Some(word))?;
        Some(action)
    }

    /// The predicate of a word, and that from here on this is its word.
    fn predicate(&mut self, word: &'t str) -> Option<u16> {
        let known = self.tables.predicates.get(word).copied();
        if let Some(predicate) = known.filter(|&known| self.predicate_words[usize::from(known)] == Some(word)) {
            return Some(predicate);
        }
        if let Some(predicate) = self.predicate_words.iter().position(|known| *known == Some(word)) {
            return u16::try_from(predicate).ok();
        }
        let settled = &mut self.predicate_words[usize::from(known?)];
        settled.is_none().then(|| *settled = Some(word))?;
        known
    }

    pub(super) fn read_atoms(&mut self, tail: &'t str) -> Option<Atoms> {
        let start = self.atoms.len();
        let mut scanner = Scanner::new(content(tail)?, Spacing::Exact);
        let mut args = Vec::new();
        let read = scanner.list(|scanner| {
            let name = scanner.atom(&mut args)?;
            let atom = self.pack(name, &args).ok_or_else(|| scanner.malformed("an atom of the domain"))?;
            self.atoms.push(atom);
            Ok(())
        });
        if read.is_err() || !scanner.at_end() {
            self.atoms.truncate(start);
            return None;
        }
        Some(start..self.atoms.len())
    }

    pub(super) fn pack(&mut self, name: &'t str, args: &[&'t str]) -> Option<Packed> {
        let predicate = self.predicate(name)?;
        if self.signature.predicates[usize::from(predicate)].arity != args.len() || args.len() > Packed::MAX_ARITY {
            return None;
        }
        let mut atom = Packed::new(predicate);
        for (position, &arg) in args.iter().enumerate() {
            atom = atom.with_arg(position, self.slot(arg)?);
        }
        Some(atom)
    }

    pub(super) fn slot(&mut self, name: &'t str) -> Option<u16> {
        if let Some(&slot) = self.slots.get(name) {
            return Some(slot);
        }
        let slot = u16::try_from(self.names.len()).ok()?;
        self.slots.insert(name, slot);
        self.names.push(name);
        Some(slot)
    }

    pub(super) fn order_objects(&mut self, rows: &[Row]) {
        let states = rows.iter().filter_map(|row| match row {
            Row::State(atoms) => Some(&self.atoms[atoms.clone()]),
            _ => None,
        });
        let goal = if self.goal_is_sorted { self.goal.clone() } else { 0..0 };
        let known = [&self.atoms[self.init.clone()], &self.atoms[goal]];
        self.ranks = match self.hints.names {
            _ if self.objects_given => Vec::new(),
            Some(declared) => ranks_by_names(&self.names, declared),
            None => {
                let arity = |predicate: u16| self.signature.predicates[usize::from(predicate)].arity;
                ranks_from(self.names.len(), arity, known.into_iter().chain(states))
            }
        };
        self.check_goal();
    }

    /// A whole goal that is not in canonical order goes to the legend: its words are a set.
    fn check_goal(&mut self) {
        if self.goal_is_set && !self.is_canonical(self.goal.clone()) {
            let mut out = String::new();
            let speech =
                Speech { signature: self.signature, names: &self.names, predicates: &self.spoken_predicates() };
            speech.write_atoms(&self.atoms[self.goal.clone()], &mut out);
            self.exceptions.goal = Some(out);
        }
    }

    pub(super) fn is_canonical(&self, atoms: Atoms) -> bool {
        let ranked = |atom: &Packed| {
            let arity = self.signature.predicates[usize::from(atom.predicate())].arity;
            if self.ranks.is_empty() { *atom } else { atom.ranked(arity, &self.ranks) }
        };
        self.atoms[atoms].is_sorted_by(|a, b| ranked(a) < ranked(b))
    }
}
