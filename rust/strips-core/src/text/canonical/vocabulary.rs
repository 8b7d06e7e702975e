//! The canonical words and their ids.

use rustc_hash::FxHashMap;

use super::segments::{MARKERS, Marker};
use super::{Layout, Signature};

/// A word's id: its position in [`Vocabulary::words`]; the object slots follow in one block without end.
pub type Word = u32;

/// Escape: the segment's text is in the legend.
pub(crate) const RAW: Word = 8;
/// Escape: a state spelled out, in the difference layout.
pub(crate) const WHOLE: Word = 9;
/// Begins a goal of literals, in the difference layout.
pub(crate) const PARTIAL: Word = 10;
/// Before a negative literal of the goal, in the report's layout.
pub(crate) const NOT: Word = 11;
/// A type that the domain does not have.
pub(crate) const UNKNOWN: Word = 12;

const ESCAPES: [&str; 5] = ["<raw>", "<whole>", "<partial>", "<not>", "<unknown>"];

/// Ids from here on stand for words outside the vocabulary while a row is decoded.
pub(crate) const STRANGE: Word = 1 << 31;

/// The signs that a predicate's word can carry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sign {
    /// Spelled out.
    Plain,
    /// Becomes true.
    Added,
    /// Becomes false.
    Removed,
    /// Must become true.
    Wanted,
    /// Must become false.
    Unwanted,
    /// Must be true and is.
    Kept,
    /// Must be false and is.
    Avoided,
    /// Becomes true, as the goal wants it.
    AddedToward,
    /// Becomes true, and the goal wants it false.
    AddedAway,
    /// Becomes false, as the goal wants it.
    RemovedToward,
    /// Becomes false, and the goal wants it true.
    RemovedAway,
}

impl Sign {
    /// Whether the atom becomes true in a state, or false; `None` where the sign is no change's.
    pub(super) fn change(self) -> Option<bool> {
        match self {
            Sign::Added | Sign::AddedToward | Sign::AddedAway => Some(true),
            Sign::Removed | Sign::RemovedToward | Sign::RemovedAway => Some(false),
            _ => None,
        }
    }

    /// Whether the atom must become true for the goal, or false; `None` where the sign is no such thing's.
    pub(super) fn demand(self) -> Option<bool> {
        match self {
            Sign::Wanted => Some(true),
            Sign::Unwanted => Some(false),
            _ => None,
        }
    }
}

pub(crate) const SIGNS: [(Sign, &str); 11] = [
    (Sign::Plain, ""),
    (Sign::Added, "+"),
    (Sign::Removed, "-"),
    (Sign::Wanted, "goal+"),
    (Sign::Unwanted, "goal-"),
    (Sign::Kept, "goal="),
    (Sign::Avoided, "goal!"),
    (Sign::AddedToward, "toward+"),
    (Sign::AddedAway, "away+"),
    (Sign::RemovedToward, "toward-"),
    (Sign::RemovedAway, "away-"),
];

/// All canonical words of a codec.
///
/// Order of ids: `<|endoftext|>`, the seven added tokens, the escapes, then by domain types, actions and predicates
/// with their signs, then the slots. Words that two domains share have one id.
#[derive(Clone, Debug)]
pub struct Vocabulary {
    words: Vec<String>,
    ids: FxHashMap<String, Word>,
}

impl Vocabulary {
    pub(super) fn of(signatures: &[Signature], layout: Layout) -> Self {
        let mut vocabulary = Self { words: Vec::new(), ids: FxHashMap::default() };
        let fixed = MARKERS.iter().map(|marker| marker.1).chain(ESCAPES);
        fixed.for_each(|word| vocabulary.add(word.to_owned()));
        for signature in signatures {
            signature.types.iter().for_each(|name| vocabulary.add(plain(name)));
            signature.actions.iter().for_each(|action| vocabulary.add(plain(&action.0)));
            for predicate in &signature.predicates {
                vocabulary.add_signs(&predicate.name, layout);
            }
        }
        vocabulary
    }

    fn add_signs(&mut self, predicate: &str, layout: Layout) {
        let signs = match layout {
            Layout::Report => &SIGNS[..1],
            Layout::Difference => &SIGNS[..7],
            Layout::Progress => &SIGNS[..],
        };
        for &(sign, _) in signs {
            self.add(signed(sign, predicate));
        }
    }

    fn add(&mut self, word: String) {
        if let std::collections::hash_map::Entry::Vacant(entry) = self.ids.entry(word) {
            self.words.push(entry.key().clone());
            entry.insert(self.words.len() as Word - 1);
        }
    }

    /// All words but the slots, in the order of their ids.
    pub fn words(&self) -> &[String] {
        &self.words
    }

    /// All words, with the first `max_slots` slots.
    pub fn with_slots(&self, max_slots: usize) -> Vec<String> {
        self.words.iter().cloned().chain((0..max_slots).map(|slot| format!("o{slot}"))).collect()
    }

    /// The id of slot 0; slot `n` is `n` more.
    pub fn first_slot(&self) -> Word {
        self.words.len() as Word
    }

    /// The word's id, slots included.
    pub fn id(&self, word: &str) -> Option<Word> {
        let slot = || word.strip_prefix('o').filter(|digits| !digits.starts_with('0') || *digits == "0");
        let number = || slot()?.parse::<u16>().ok();
        self.ids.get(word).copied().or_else(|| Some(self.first_slot() + Word::from(number()?)))
    }

    /// The id of the word, without a sign, of a type, an action or a predicate of that name.
    pub fn id_of_name(&self, name: &str) -> Option<Word> {
        self.ids.get(&plain(name)).copied()
    }

    /// The slot's number, where the id is a slot's.
    pub(crate) fn slot(&self, id: Word) -> Option<u16> {
        u16::try_from(id.checked_sub(self.first_slot())?).ok()
    }

    /// Appends the word.
    pub(crate) fn write(&self, id: Word, out: &mut String) {
        match self.words.get(id as usize) {
            Some(word) => out.push_str(word),
            None => write_number('o', id - self.first_slot(), out),
        }
    }

    /// The words joined by single spaces.
    pub fn join(&self, ids: &[Word]) -> String {
        let mut out = String::with_capacity(ids.len() * 4);
        for (position, &id) in ids.iter().enumerate() {
            if position > 0 {
                out.push(' ');
            }
            self.write(id, &mut out);
        }
        out
    }

    /// The ids of words parted by white space. A word outside the vocabulary goes to `strange` and gets an id there.
    pub(crate) fn ids<'a>(&self, words: &'a str, strange: &mut Vec<&'a str>) -> Vec<Word> {
        let id = |word: &'a str| {
            self.id(word).unwrap_or_else(|| {
                strange.push(word);
                STRANGE + strange.len() as Word - 1
            })
        };
        words.split_ascii_whitespace().map(id).collect()
    }
}

/// Appends the words for the object of a slot: its type's, where `kinds` has one for the slot, and the slot.
pub(crate) fn mention(vocabulary: &Vocabulary, kinds: &[Word], slot: u16, words: &mut Vec<Word>) {
    words.extend(kinds.get(usize::from(slot)).copied().filter(|&kind| kind != 0));
    words.push(vocabulary.first_slot() + Word::from(slot));
}

/// How many words there are before the completion.
pub(super) fn prompt_length(words: &[Word]) -> usize {
    let begins = |&id: &Word| Marker::of_id(id).is_some_and(Marker::begins_completion);
    words.iter().position(begins).unwrap_or(words.len())
}

/// The word of a type, an action or a predicate in `sign`.
pub(super) fn signed(sign: Sign, name: &str) -> String {
    format!("{}{}", SIGNS[sign as usize].1, plain(name))
}

/// The word of a name without a sign. An apostrophe keeps those like `o1` apart from slots, and those like `goal-on` or
/// `<raw>` from words with a sign, from markers and escapes; and those that have one in its place from these.
pub(super) fn plain(name: &str) -> String {
    let number = name.strip_prefix('o').map_or("", |rest| rest.trim_end_matches('\''));
    let like_sign = |name: &str| SIGNS[1..].iter().any(|(_, sign)| name.starts_with(sign));
    if !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit()) {
        format!("{name}'")
    } else if name.starts_with(['\'', '<']) || like_sign(name) {
        format!("'{name}")
    } else {
        name.to_owned()
    }
}

/// Appends a letter and a number.
pub(crate) fn write_number(letter: char, number: u32, out: &mut String) {
    out.push(letter);
    out.push_str(&number.to_string());
}
