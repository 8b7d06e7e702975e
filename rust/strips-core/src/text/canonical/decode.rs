//! From canonical words, well-formed or not, to text.

use super::legend::{Exceptions, Legend};
use super::packed::{Packed, change, sorted_set};
use super::segments::Marker;
use super::signature::Tables;
use super::vocabulary::{NOT, PARTIAL, RAW, STRANGE, Sign, WHOLE, Word, prompt_length, write_number};
use super::{Codec, Layout, Signature};

/// The text of some words. `strange` are the words of ids from [`STRANGE`] on.
pub(super) fn decode(codec: &Codec, words: &[Word], strange: &[&str], legend: &Legend) -> String {
    let (prompt, completion) = words.split_at(prompt_length(words));
    let mut decoder = Decoder::new(codec, strange, legend);
    decoder.prompt(prompt);
    if !prompt.is_empty() && !completion.is_empty() {
        decoder.out.push(' ');
    }
    decoder.completion(completion);
    decoder.out
}

/// The text of a completion's words alone. What does not begin as a completion is written as bare words.
pub(super) fn decode_completion(
    codec: &Codec,
    prompt: &[Word],
    completion: &[Word],
    strange: &[&str],
    legend: &Legend,
) -> String {
    let mut decoder = Decoder::new(codec, strange, legend);
    decoder.prompt(prompt);
    decoder.out.clear();
    decoder.completion(completion);
    decoder.out
}

struct Decoder<'a> {
    codec: &'a Codec,
    signature: &'a Signature,
    tables: &'a Tables,
    legend: &'a Legend,
    strange: &'a [&'a str],
    /// The state before, ascending by slots.
    before: Vec<Packed>,
    out: String,
}

/// A segment's marker and its other words.
type Segment<'w> = (Marker, &'w [Word]);

/// The words before the first marker, and the segments.
fn segments(words: &[Word]) -> (&[Word], Vec<Segment<'_>>) {
    let starts: Vec<usize> = (0..words.len()).filter(|&i| Marker::of_id(words[i]).is_some()).collect();
    let end = |number: usize| starts.get(number + 1).copied().unwrap_or(words.len());
    let segment = |(number, &start): (usize, &usize)| {
        Marker::of_id(words[start]).map(|marker| (marker, &words[start + 1..end(number)]))
    };
    let head = &words[..starts.first().copied().unwrap_or(words.len())];
    (head, starts.iter().enumerate().filter_map(segment).collect())
}

impl<'a> Decoder<'a> {
    fn new(codec: &'a Codec, strange: &'a [&'a str], legend: &'a Legend) -> Self {
        let (signature, tables) = codec.tables(legend.domain.min(codec.signatures().len() - 1));
        Self { codec, signature, tables, legend, strange, before: Vec::new(), out: String::with_capacity(1024) }
    }

    fn speech(&self) -> Speech<'a, String> {
        Speech { signature: self.signature, names: &self.legend.names, predicates: &self.legend.predicates }
    }

    fn prompt(&mut self, words: &[Word]) {
        let (head, segments) = segments(words);
        let find = |wanted: Marker| segments.iter().find(|segment| segment.0 == wanted).map(|segment| segment.1);
        match (find(Marker::Start), find(Marker::Goal), find(Marker::Init), &self.legend.exceptions.prompt) {
            (_, _, _, Some(prompt)) if words == [RAW] => self.out.push_str(prompt),
            (Some([]), Some(goal), Some(init), _) if head.is_empty() => {
                self.well_made_prompt(find(Marker::Objects), goal, init);
            }
            _ => self.verbatim(words),
        }
    }

    fn well_made_prompt(&mut self, objects: Option<&[Word]>, goal: &[Word], init: &[Word]) {
        self.out.push_str(Marker::Start.text());
        let Exceptions { objects: raw_objects, vocab, goal: raw_goal, init: raw_init, .. } = &self.legend.exceptions;
        if let Some(objects) = objects {
            self.segment(Marker::Objects, raw_objects.as_deref(), |decoder| {
                decoder.objects(objects);
                Some(())
            });
        }
        if vocab.is_some() {
            self.segment(Marker::Vocab, vocab.as_deref(), |_| None);
        }
        let atoms = self.atoms(init, Some(Sign::Plain)).unwrap_or_default();
        self.before = sorted_set(&atoms);
        self.segment(Marker::Goal, raw_goal.as_deref(), |decoder| decoder.goal(goal));
        self.segment(Marker::Init, raw_init.as_deref(), |decoder| {
            let atoms = decoder.atoms(init, Some(Sign::Plain))?;
            decoder.write(&atoms);
            Some(())
        });
    }

    /// A marker of the prompt and what follows it: an exception, or what `content` writes.
    fn segment(&mut self, marker: Marker, raw: Option<&str>, content: impl FnOnce(&mut Self) -> Option<()>) {
        self.out.push(' ');
        self.out.push_str(marker.text());
        let start = self.out.len();
        if let Some(raw) = raw {
            self.out.push_str(raw);
        } else if content(self).is_none() {
            self.out.truncate(start);
        }
    }

    fn objects(&mut self, words: &[Word]) {
        let vocabulary = self.codec.vocabulary();
        let mut in_pair = false;
        for (position, &word) in words.iter().enumerate() {
            if let Some(slot) = vocabulary.slot(word) {
                self.out.push_str(if position == 0 { " " } else { ", " });
                self.name(slot);
                in_pair = false;
            } else {
                self.out.push(if in_pair { '/' } else { ' ' });
                self.word(word);
                in_pair = true;
            }
        }
    }

    fn goal(&mut self, words: &[Word]) -> Option<()> {
        match words.split_first() {
            _ if self.codec.layout() == Layout::Report => self.spelled_goal(words),
            Some((&PARTIAL, literals)) => self.partial_goal(literals),
            _ => {
                let mut goal = self.before.clone();
                self.changes(words, Sign::demand, &mut goal)?;
                self.write_canonical(&goal);
                Some(())
            }
        }
    }

    fn spelled_goal(&mut self, mut words: &[Word]) -> Option<()> {
        let mut first = true;
        while !words.is_empty() {
            let negative = words[0] == NOT;
            let (_, atom, rest) = self.atom(&words[usize::from(negative)..])?;
            self.literal(atom, !negative, std::mem::take(&mut first));
            words = rest;
        }
        Some(())
    }

    fn partial_goal(&mut self, mut words: &[Word]) -> Option<()> {
        let mut first = true;
        while !words.is_empty() {
            let (sign, atom, rest) = self.atom(words)?;
            self.literal(atom, matches!(sign, Sign::Wanted | Sign::Kept), std::mem::take(&mut first));
            words = rest;
        }
        Some(())
    }

    fn literal(&mut self, atom: Packed, positive: bool, first: bool) {
        self.out.push_str(if first { " " } else { ", " });
        self.out.push_str(if positive { "" } else { "not " });
        self.speech().write_atom(atom, &mut self.out);
    }

    fn completion(&mut self, words: &[Word]) {
        let (head, segments) = segments(words);
        self.verbatim(head);
        for (number, (marker, body)) in segments.into_iter().enumerate() {
            if number > 0 || !head.is_empty() {
                self.out.push(' ');
            }
            self.out.push_str(marker.text());
            match self.legend.exceptions.after(number as u32).filter(|_| body == [RAW]) {
                Some(raw) => self.out.push_str(raw),
                None => self.body(marker, body),
            }
        }
    }

    fn body(&mut self, marker: Marker, words: &[Word]) {
        let written = match marker {
            Marker::Action => self.action(words),
            Marker::State => self.state(words),
            _ => words.is_empty().then_some(()),
        };
        if written.is_none() {
            self.out.push(' ');
            self.verbatim(words);
        }
    }

    fn action(&mut self, words: &[Word]) -> Option<()> {
        let (&word, args) = words.split_first()?;
        let action = self.tables.action(word)?;
        let (mut slots, mut args) = (Vec::new(), args);
        while !args.is_empty() {
            let (slot, rest) = self.mention(args)?;
            slots.push(slot);
            args = rest;
        }
        self.out.push(' ');
        let word = self.legend.words.get(action).unwrap_or(&self.signature.actions[action].0);
        self.out.push_str(word);
        self.speech().write_args(slots.into_iter(), &mut self.out);
        Some(())
    }

    fn state(&mut self, words: &[Word]) -> Option<()> {
        match words.split_first() {
            _ if self.codec.layout() == Layout::Report => self.spelled_state(words),
            Some((&WHOLE, words)) => self.spelled_state(words),
            _ => {
                let mut state = self.before.clone();
                self.changes(words, Sign::change, &mut state)?;
                self.write_canonical(&state);
                self.before = state;
                Some(())
            }
        }
    }

    fn spelled_state(&mut self, words: &[Word]) -> Option<()> {
        let atoms = self.atoms(words, Some(Sign::Plain))?;
        self.write(&atoms);
        self.before = sorted_set(&atoms);
        Some(())
    }

    /// Applies signed atoms to a state; `is_added` says of a sign whether it adds, or removes.
    fn changes(&self, mut words: &[Word], is_added: fn(Sign) -> Option<bool>, state: &mut Vec<Packed>) -> Option<()> {
        while !words.is_empty() {
            let (sign, atom, rest) = self.atom(words)?;
            change(state, atom, is_added(sign)?);
            words = rest;
        }
        Some(())
    }

    fn atoms(&self, mut words: &[Word], wanted: Option<Sign>) -> Option<Vec<Packed>> {
        let mut atoms = Vec::with_capacity(words.len() / 2);
        while !words.is_empty() {
            let (sign, atom, rest) = self.atom(words)?;
            wanted.is_none_or(|wanted| wanted == sign).then(|| atoms.push(atom))?;
            words = rest;
        }
        Some(atoms)
    }

    /// The atom that the words begin with, and the words after it.
    fn atom<'w>(&self, words: &'w [Word]) -> Option<(Sign, Packed, &'w [Word])> {
        let (&first, rest) = words.split_first()?;
        let (sign, predicate) = self.tables.signed_predicate(first)?;
        let arity = self.signature.predicates[usize::from(predicate)].arity;
        let (mut atom, mut rest) = (Packed::new(predicate), rest);
        for position in 0..arity {
            let (slot, after) = self.mention(rest)?;
            atom = atom.with_arg(position, slot);
            rest = after;
        }
        Some((sign, atom, rest))
    }

    /// The slot that the words begin with, perhaps after its type, and the words after it. Whether the type is the
    /// object's own is not asked: the text does not say it.
    fn mention<'w>(&self, words: &'w [Word]) -> Option<(u16, &'w [Word])> {
        let (&first, rest) = words.split_first()?;
        if self.codec.says_kinds() && self.tables.is_kind(first) {
            let (&second, rest) = rest.split_first()?;
            return Some((self.codec.vocabulary().slot(second)?, rest));
        }
        Some((self.codec.vocabulary().slot(first)?, rest))
    }

    fn write_canonical(&mut self, state: &[Packed]) {
        let ranks = &self.legend.ranks;
        if ranks.is_empty() {
            return self.write(state);
        }
        let arity = |atom: &Packed| self.signature.predicates[usize::from(atom.predicate())].arity;
        let mut atoms = state.to_vec();
        atoms.sort_by_key(|atom| atom.ranked(arity(atom), ranks));
        self.write(&atoms);
    }

    fn write(&mut self, atoms: &[Packed]) {
        self.speech().write_atoms(atoms, &mut self.out);
    }

    fn name(&mut self, slot: u16) {
        self.speech().write_name(slot, &mut self.out);
    }

    /// The bare words.
    fn verbatim(&mut self, words: &[Word]) {
        for (position, &word) in words.iter().enumerate() {
            if position > 0 {
                self.out.push(' ');
            }
            self.word(word);
        }
    }

    fn word(&mut self, word: Word) {
        let strange = word.checked_sub(STRANGE).and_then(|number| self.strange.get(number as usize));
        match strange {
            Some(text) => self.out.push_str(text),
            None => self.codec.vocabulary().write(word, &mut self.out),
        }
    }
}

/// How one text says atoms.
pub(super) struct Speech<'a, N, P = N> {
    pub signature: &'a Signature,
    /// The object of each slot.
    pub names: &'a [N],
    /// The word for each predicate; empty where all go by their names.
    pub predicates: &'a [P],
}

impl<N: AsRef<str>, P: AsRef<str>> Speech<'_, N, P> {
    /// Appends atoms, each after a space, commas between them.
    pub fn write_atoms(&self, atoms: &[Packed], out: &mut String) {
        for (position, &atom) in atoms.iter().enumerate() {
            out.push_str(if position == 0 { " " } else { ", " });
            self.write_atom(atom, out);
        }
    }

    fn write_atom(&self, atom: Packed, out: &mut String) {
        let number = usize::from(atom.predicate());
        let predicate = &self.signature.predicates[number];
        out.push_str(self.predicates.get(number).map_or(&predicate.name, AsRef::as_ref));
        self.write_args((0..predicate.arity).map(|position| atom.arg(position)), out);
    }

    fn write_args(&self, slots: impl Iterator<Item = u16>, out: &mut String) {
        out.push('(');
        for (position, slot) in slots.enumerate() {
            if position > 0 {
                out.push_str(", ");
            }
            self.write_name(slot, out);
        }
        out.push(')');
    }

    /// The slot's name, or `#n` where it has none: no object is called so.
    fn write_name(&self, slot: u16, out: &mut String) {
        match self.names.get(usize::from(slot)) {
            Some(name) => out.push_str(name.as_ref()),
            None => write_number('#', u32::from(slot), out),
        }
    }
}
