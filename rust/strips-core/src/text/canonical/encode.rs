//! From a text to canonical words.

mod goal;
mod read;

use rustc_hash::FxHashMap;

use super::super::prompt::pairs;
use super::super::scan::{Scanner, Spacing};
use super::legend::{Exceptions, Legend};
use super::packed::{Packed, difference, sorted_set};
use super::segments::{Marker, Segment, split};
use super::signature::Tables;
use super::vocabulary::{RAW, Sign, UNKNOWN, WHOLE, Word, mention};
use super::wanted::{Wanted, sign_of_change};
use super::{Codec, Hints, Layout, Signature};

/// Appends the words of a text and gives back its legend.
pub(super) fn encode(codec: &Codec, text: &str, hints: &Hints<'_>, words: &mut Vec<Word>) -> Legend {
    let mut segments = Vec::new();
    let head = split(text, &mut segments);
    let mut encoder = Encoder::new(codec, hints, words);
    let completion = encoder.prompt(text, head, &segments);
    let rows: Vec<Row> = segments[completion..].iter().map(|segment| encoder.read(*segment)).collect();
    encoder.order_objects(&rows);
    rows.iter().zip(&segments[completion..]).for_each(|(row, segment)| encoder.write(row, *segment));
    encoder.legend()
}

/// Atoms of one segment: a range of [`Encoder::atoms`].
type Atoms = std::ops::Range<usize>;

/// A segment of the completion, read.
enum Row {
    Action(usize, Vec<u16>),
    State(Atoms),
    /// Only the marker.
    Bare,
    Raw,
}

struct Encoder<'c, 't, 'w> {
    codec: &'c Codec,
    signature: &'c Signature,
    tables: &'c Tables,
    hints: &'c Hints<'t>,
    words: &'w mut Vec<Word>,
    slots: FxHashMap<&'t str, u16>,
    names: Vec<&'t str>,
    /// By action: its word, where one is settled.
    action_words: Vec<Option<&'t str>>,
    /// By predicate: its word, where one is settled.
    predicate_words: Vec<Option<&'t str>>,
    atoms: Vec<Packed>,
    goal: Atoms,
    init: Atoms,
    /// The goal's atoms are all positive, so that their order tells that of objects.
    goal_is_sorted: bool,
    /// The goal's words say which atoms it has, not their order.
    goal_is_set: bool,
    objects_given: bool,
    /// By slot: the word for its type, where that is said before it.
    kinds: Vec<Word>,
    ranks: Vec<u16>,
    before: Vec<Packed>,
    /// What the goal wants, where changes say it.
    wanted: Option<Wanted>,
    exceptions: Exceptions,
    written: u32,
}

impl<'c, 't: 'c, 'w> Encoder<'c, 't, 'w> {
    fn new(codec: &'c Codec, hints: &'c Hints<'t>, words: &'w mut Vec<Word>) -> Self {
        let (signature, tables) = codec.tables(hints.domain);
        let actions = signature.actions.len();
        let given = |place: usize| hints.words.and_then(|words| words.get(place)).map(String::as_str);
        Self {
            codec,
            signature,
            tables,
            hints,
            words,
            slots: FxHashMap::default(),
            names: Vec::new(),
            action_words: (0..actions).map(given).collect(),
            predicate_words: (actions..actions + signature.predicates.len()).map(given).collect(),
            atoms: Vec::new(),
            goal: 0..0,
            init: 0..0,
            goal_is_sorted: false,
            goal_is_set: false,
            objects_given: false,
            kinds: Vec::new(),
            ranks: Vec::new(),
            before: Vec::new(),
            wanted: None,
            exceptions: Exceptions::default(),
            written: 0,
        }
    }

    /// Writes the prompt's words; gives back the number of its segments.
    fn prompt(&mut self, text: &'t str, head: &str, segments: &[Segment<'t>]) -> usize {
        let length = segments.iter().position(|(marker, _)| marker.begins_completion()).unwrap_or(segments.len());
        match Parts::of(&segments[..length]) {
            Some(parts) if head.is_empty() && text.starts_with(Marker::Start.text()) => self.parts(&parts),
            _ => self.strange_prompt(text, &segments[length..]),
        }
        self.before = sorted_set(&self.atoms[self.init.clone()]);
        length
    }

    /// A text that does not begin as prompts do.
    fn strange_prompt(&mut self, text: &str, completion: &[Segment<'t>]) {
        let end: usize = completion.iter().map(|(marker, tail)| 1 + marker.text().len() + tail.len()).sum();
        // Where the completion is all there is, no space parts it from a prompt.
        if end <= text.len() {
            self.words.push(RAW);
            self.exceptions.prompt = Some(text[..text.len() - end].to_owned());
        }
    }

    fn parts(&mut self, parts: &Parts<'t>) {
        self.words.push(Marker::Start as Word);
        if let Some(tail) = parts.objects {
            self.objects(tail);
        }
        if let Some(tail) = parts.vocab {
            self.vocab(tail);
        }
        if self.codec.layout() == Layout::Report {
            let goal = self.read_literals(parts.goal);
            self.write_goal(goal, parts.goal);
            self.init(parts.init);
        } else {
            self.init(parts.init);
            let goal = self.read_literals(parts.goal);
            self.write_goal(goal, parts.goal);
        }
    }

    fn objects(&mut self, tail: &'t str) {
        self.words.push(Marker::Objects as Word);
        let pairs = content(tail).and_then(|content| whole(content, pairs));
        let slots = pairs.iter().flatten().map(|pair| self.slot(pair.0)).collect::<Option<Vec<u16>>>();
        let (Some(pairs), Some(slots)) = (pairs, slots.filter(|slots| slots.is_sorted_by(|a, b| a < b))) else {
            self.words.push(RAW);
            self.exceptions.objects = Some(tail.to_owned());
            return;
        };
        self.objects_given = true;
        for ((_, kinds), slot) in pairs.into_iter().zip(slots) {
            self.words.push(self.codec.vocabulary().first_slot() + Word::from(slot));
            let said = self.words.len();
            kinds.split('/').for_each(|kind| self.kind(kind, tail));
            if self.codec.says_kinds() {
                self.kinds.push(if self.words[said] == UNKNOWN { 0 } else { self.words[said] });
            }
        }
    }

    /// The word of one of an object's types; `tail` goes to the legend where that does not say the type's name.
    fn kind(&mut self, kind: &str, tail: &str) {
        let word = self.tables.types.get(kind).copied().unwrap_or(UNKNOWN);
        self.words.push(word);
        if self.codec.vocabulary().words()[word as usize] != kind {
            self.exceptions.objects = Some(tail.to_owned());
        }
    }

    /// Takes the words of a legend: actions come first, so a name that an action has means a predicate only the second time.
    fn vocab(&mut self, tail: &'t str) {
        self.exceptions.vocab = Some(tail.to_owned());
        let mut said = vec![false; self.signature.actions.len()];
        for (name, word) in content(tail).and_then(|content| whole(content, pairs)).unwrap_or_default() {
            let action = self.signature.actions.iter().position(|action| action.0 == name);
            if let Some(action) = action.filter(|&action| !std::mem::replace(&mut said[action], true)) {
                self.action_words[action] = Some(word);
            } else if let Some(predicate) = self.signature.predicates.iter().position(|known| known.name == name) {
                self.predicate_words[predicate] = Some(word);
            }
        }
    }

    fn init(&mut self, tail: &'t str) {
        self.words.push(Marker::Init as Word);
        if let Some(atoms) = self.read_atoms(tail) {
            self.init = atoms.clone();
            self.emit_all(atoms);
        } else {
            self.words.push(RAW);
            self.exceptions.init = Some(tail.to_owned());
        }
    }

    fn write(&mut self, row: &Row, (marker, tail): Segment<'t>) {
        self.words.push(marker as Word);
        match row {
            Row::Bare => {}
            Row::Raw => {
                self.words.push(RAW);
                self.exceptions.completion.push((self.written, tail.to_owned()));
            }
            Row::Action(action, slots) => {
                self.words.push(self.tables.action_words[*action]);
                for &slot in slots {
                    self.mention(slot);
                }
            }
            Row::State(atoms) => self.write_state(atoms.clone()),
        }
        self.written += 1;
    }

    fn write_state(&mut self, atoms: Atoms) {
        let state = sorted_set(&self.atoms[atoms.clone()]);
        if self.codec.layout() == Layout::Report {
            self.emit_all(atoms);
        } else if self.is_canonical(atoms.clone()) {
            let before = std::mem::take(&mut self.before);
            difference(&state, &before, |atom| self.emit_change(atom, true));
            difference(&before, &state, |atom| self.emit_change(atom, false));
        } else {
            self.words.push(WHOLE);
            self.emit_all(atoms);
        }
        self.before = state;
    }

    fn emit_all(&mut self, atoms: Atoms) {
        for position in atoms {
            self.emit(Sign::Plain, self.atoms[position]);
        }
    }

    fn emit_change(&mut self, atom: Packed, added: bool) {
        self.emit(sign_of_change(self.wanted.as_ref(), atom, added), atom);
    }

    fn emit(&mut self, sign: Sign, atom: Packed) {
        let predicate = atom.predicate();
        self.words.push(self.tables.predicate_word(sign, predicate));
        let arity = self.signature.predicates[usize::from(predicate)].arity;
        for position in 0..arity {
            self.mention(atom.arg(position));
        }
    }

    fn mention(&mut self, slot: u16) {
        mention(self.codec.vocabulary(), &self.kinds, slot, self.words);
    }

    fn legend(self) -> Legend {
        let own = self.signature.actions.iter().map(|action| &action.0[..]);
        let words = self.action_words.iter().zip(own).map(|(word, own)| word.unwrap_or(own).to_owned()).collect();
        let names = self.names.iter().map(|&name| name.to_owned()).collect();
        let predicates = self.spoken_predicates().into_iter().map(str::to_owned).collect();
        let (ranks, kinds, wanted, exceptions) = (self.ranks, self.kinds, self.wanted, self.exceptions);
        Legend { domain: self.hints.domain, names, ranks, words, predicates, kinds, wanted, exceptions }
    }

    /// The word for each predicate; none where all go by their names.
    fn spoken_predicates(&self) -> Vec<&'c str> {
        let words = self.predicate_words.iter().zip(&self.signature.predicates);
        let words = words.map(|(word, predicate)| (word.unwrap_or(&predicate.name), &predicate.name[..]));
        if words.clone().all(|(word, own)| word == own) { Vec::new() } else { words.map(|(word, _)| word).collect() }
    }
}

/// The tails of a prompt's segments.
struct Parts<'t> {
    objects: Option<&'t str>,
    vocab: Option<&'t str>,
    goal: &'t str,
    init: &'t str,
}

impl<'t> Parts<'t> {
    fn of(segments: &[Segment<'t>]) -> Option<Self> {
        let mut segments = segments.iter().copied().peekable();
        let mut next = |wanted: Marker| segments.next_if(|segment| segment.0 == wanted).map(|segment| segment.1);
        next(Marker::Start).filter(|tail| tail.is_empty())?;
        let (objects, vocab) = (next(Marker::Objects), next(Marker::Vocab));
        let parts = Self { objects, vocab, goal: next(Marker::Goal)?, init: next(Marker::Init)? };
        segments.next().is_none().then_some(parts)
    }
}

/// What follows a marker without the space before it; `None` where that would not be given back.
fn content(tail: &str) -> Option<&str> {
    if tail.is_empty() { Some(tail) } else { tail.strip_prefix(' ').filter(|content| !content.is_empty()) }
}

/// Everything in `content`, read by `read` with exact spacing.
fn whole<'t, T>(
    content: &'t str,
    read: impl FnOnce(&mut Scanner<'t>) -> Result<T, super::super::Malformed>,
) -> Option<T> {
    let mut scanner = Scanner::new(content, Spacing::Exact);
    read(&mut scanner).ok().filter(|_| scanner.at_end())
}
