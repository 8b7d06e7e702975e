//! The canonical rewriting: a text as few words of a small closed vocabulary, and what gives its bytes back.
//!
//! ```text
//! <|startoftext|> <OBJECTS> o0 fixture o1 vessel o2 fixture <INIT> inworkspace o0 inworkspace o1 on o1 o2
//!     <GOAL> goal+on o1 o0 goal-on o1 o2 <ACTION> pick o1 <STATE> +inhand o1 -on o1 o2 <ACTION> … <|endoftext|>
//! ```
//!
//! What a small transformer finds hard is taken out (the text format stays what it is, and decoding gives its bytes):
//! - Objects are slots `o0`, `o1`, …, in the order of `<OBJECTS>`, else of appearance; an action or a predicate is its
//!   name in the domain, whatever the word for it. Names and words are kept in the [`Legend`]; `<VOCAB>` disappears into
//!   it.
//! - `<INIT>` comes first. A goal that is a whole state is its difference from it: `goal+p` for what has to come,
//!   `goal-p` for what has to go. A goal of literals begins with `<partial>` and keeps their order; a literal that holds
//!   already is `goal=p`, or `goal!p` where negative.
//! - A state is its difference from the state before, `+p` before `-p`, each ascending by predicate and slots. One that
//!   the difference cannot give back (atoms doubled or out of order) is spelled out after `<whole>`.
//! - What cannot be said in these words at all (an unknown predicate or action, broken syntax) is `<raw>`, and its text
//!   is in the legend. Texts that the oracle wrote never need it.
//!
//! Sign and predicate are one word rather than two: sequences are a fifth shorter, and with few predicates a model
//! learns each sign's word at once. The words of a prompt do not depend on the completion after it, and never on names.
//!
//! With [`Codec::saying_kinds`] each mention of an object is its type and its slot, `pick vessel o1`, as far as `<OBJECTS>`
//! gives a type: whether an action may take it need not be looked up.
//!
//! With [`Layout::Progress`] each change of state says what it is to the goal: `toward+p` and `away+p`, `toward-p` and
//! `away-p`, and `+p` and `-p` where the goal says nothing of it. What is still owed, a thing that was put aside and has to
//! be put back, stands in the text then, in as many words.
//!
//! [`Layout::Report`] replaces names by slots and words by action names, and spells out goal, initial state and each
//! state in full, in the report's order: the rewriting's parts can be measured apart.
//!
//! Decoding takes any words, a model's own included, and never fails: a segment that makes no sense is written as its
//! bare words, which `parse_completion` then reports as malformed at that place; a slot without a name is written `#n`,
//! which names no object. Price: one pass each way, about 100 bytes of legend for each record.

mod decode;
mod encode;
mod hints;
mod legend;
mod order;
mod packed;
mod segments;
mod signature;
mod vocabulary;
mod wanted;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use hints::{Hints, Rows};
pub use legend::Legend;
pub use signature::{PredicateSignature, Signature, Synonyms};
pub use vocabulary::{Vocabulary, Word};
pub use wanted::Wanted;

use crate::pddl::ast::Domain;
pub(crate) use packed::Packed;
pub(crate) use segments::Marker;
use signature::Tables;
pub(crate) use vocabulary::{Sign, mention};
pub(crate) use wanted::sign_of_change;

/// How much the rewriting takes out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Slots, and goal and states as differences.
    Difference,
    /// The same, and each change of state says whether it leads to the goal or away from it.
    Progress,
    /// Slots alone; goal and every state spelled out as in the report.
    Report,
}

/// Rewrites texts of some domains into canonical words and back.
///
/// ```
/// use strips_core::pddl::{parse_domain, Source};
/// use strips_core::text::canonical::{Codec, Hints, Layout, Synonyms};
/// let domain = parse_domain(&Source::new("d", "(define (domain d) (:predicates (lit ?x)) (:action light :parameters (?x) :effect (lit ?x)))"))?;
/// let synonyms = Synonyms { actions: vec![vec!["kindle".into()]], predicates: vec![vec!["aglow".into()]] };
/// let codec = Codec::new(&[(&domain, synonyms)], Layout::Difference);
/// let text = "<|startoftext|> <GOAL> aglow(lamp) <INIT> <ACTION> kindle(lamp) <STATE> aglow(lamp) <|endoftext|>";
/// let (words, legend) = codec.encode(text, &Hints::default());
/// assert_eq!(words, "<|startoftext|> <INIT> <GOAL> goal+lit o0 <ACTION> light o0 <STATE> +lit o0 <|endoftext|>");
/// assert_eq!(codec.decode(&words, &legend), text);
/// # Ok::<(), strips_core::pddl::PddlError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Codec {
    layout: Layout,
    kinds: bool,
    signatures: Vec<Signature>,
    vocabulary: Vocabulary,
    tables: Vec<Tables>,
}

/// What a codec is saved as.
#[derive(Serialize, Deserialize)]
struct Saved {
    version: u32,
    layout: Layout,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    kinds: bool,
    domains: Vec<Signature>,
}

/// A codec that cannot be read back.
#[derive(Debug, thiserror::Error)]
pub enum CodecError {
    /// The text is no JSON of a codec.
    #[error("not a saved codec: {0}")]
    Json(#[from] serde_json::Error),
    /// The lexicon is no TOML.
    #[error("not a lexicon: {0}")]
    Lexicon(#[from] toml::de::Error),
    /// It was written by a later version.
    #[error("the codec has version {0}, this library reads version {VERSION}")]
    Version(u32),
}

const VERSION: u32 = 1;

/// Words as ids, one row after the other.
#[derive(Clone, Debug, Default)]
pub struct EncodedIds {
    /// All rows' words.
    pub ids: Vec<Word>,
    /// Where each row starts in `ids`, and the total at the end.
    pub offsets: Vec<usize>,
    /// How many of a row's words are its prompt.
    pub prompt_lengths: Vec<usize>,
    /// Each row's legend.
    pub legends: Vec<Legend>,
}

impl Codec {
    /// The codec of some domains, each with the synonyms of its actions and predicates.
    pub fn new(domains: &[(&Domain, Synonyms)], layout: Layout) -> Self {
        let signatures = domains.iter().map(|(domain, synonyms)| Signature::of(domain, synonyms)).collect();
        Self::from_signatures(signatures, layout)
    }

    /// The codec of one domain, with the words that a lexicon (TOML) gives for its actions and predicates.
    ///
    /// # Errors
    /// [`CodecError::Lexicon`] where the lexicon is no TOML.
    pub fn with_lexicon(domain: &Domain, lexicon: &str, layout: Layout) -> Result<Self, CodecError> {
        Ok(Self::new(&[(domain, signature::synonyms_in(lexicon, domain)?)], layout))
    }

    /// The codec of some signatures.
    pub fn from_signatures(signatures: Vec<Signature>, layout: Layout) -> Self {
        let vocabulary = Vocabulary::of(&signatures, layout);
        let tables = signatures.iter().map(|signature| Tables::of(signature, &vocabulary)).collect();
        Self { layout, kinds: false, signatures, vocabulary, tables }
    }

    /// The same, with an object's type before each mention of it.
    #[must_use]
    pub fn saying_kinds(self) -> Self {
        Self { kinds: true, ..self }
    }

    /// Whether it says an object's type before each mention of it.
    pub fn says_kinds(&self) -> bool {
        self.kinds
    }

    /// Everything the codec knows, as JSON; a saved model carries it.
    pub fn to_json(&self) -> String {
        let (layout, kinds) = (self.layout, self.kinds);
        let saved = Saved { version: VERSION, layout, kinds, domains: self.signatures.clone() };
        serde_json::to_string(&saved).expect("strings and numbers are always JSON")
    }

    /// The codec that [`Codec::to_json`] wrote.
    ///
    /// # Errors
    /// [`CodecError`] where the text is something else.
    pub fn from_json(text: &str) -> Result<Self, CodecError> {
        let saved: Saved = serde_json::from_str(text)?;
        if saved.version != VERSION {
            return Err(CodecError::Version(saved.version));
        }
        Ok(Self { kinds: saved.kinds, ..Self::from_signatures(saved.domains, saved.layout) })
    }

    /// The layout it writes.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// All its words and their ids.
    pub fn vocabulary(&self) -> &Vocabulary {
        &self.vocabulary
    }

    /// The domains it knows, in the order of [`Hints::domain`].
    pub fn signatures(&self) -> &[Signature] {
        &self.signatures
    }

    pub(crate) fn tables(&self, domain: usize) -> (&Signature, &Tables) {
        (&self.signatures[domain], &self.tables[domain])
    }

    /// A text (a prompt alone, or a prompt with the whole or part of a completion) as words and the legend to them.
    pub fn encode(&self, text: &str, hints: &Hints<'_>) -> (String, Legend) {
        let mut words = Vec::new();
        let legend = self.encode_into(text, hints, &mut words);
        (self.vocabulary.join(&words), legend)
    }

    /// [`Codec::encode`] with ids for words, appended to `words`.
    pub fn encode_into(&self, text: &str, hints: &Hints<'_>, words: &mut Vec<Word>) -> Legend {
        encode::encode(self, text, hints, words)
    }

    /// The text of some words; for what was encoded, its bytes.
    pub fn decode(&self, words: &str, legend: &Legend) -> String {
        let mut strange = Vec::new();
        let ids = self.vocabulary.ids(words, &mut strange);
        decode::decode(self, &ids, &strange, legend)
    }

    /// [`Codec::decode`] from ids. Ids outside the vocabulary are slots without a name.
    pub fn decode_ids(&self, words: &[Word], legend: &Legend) -> String {
        decode::decode(self, words, &[], legend)
    }

    /// The text of a completion's words after a prompt's, without the space between the two texts. Whatever the words
    /// are, the prompt is left alone; what begins as no completion does is written as bare words.
    pub fn decode_completion(&self, prompt: &[Word], completion: &[Word], legend: &Legend) -> String {
        decode::decode_completion(self, prompt, completion, &[], legend)
    }

    /// [`Codec::encode`] of each text, in parallel.
    pub fn encode_batch<S: AsRef<str> + Sync>(&self, texts: &[S], hints: &Rows<'_>) -> Vec<(String, Legend)> {
        texts.par_iter().enumerate().map(|(row, text)| self.encode(text.as_ref(), &hints.row(row))).collect()
    }

    /// [`Codec::encode_into`] of each text, in parallel.
    pub fn encode_ids_batch<S: AsRef<str> + Sync>(&self, texts: &[S], hints: &Rows<'_>) -> EncodedIds {
        let encode = |(row, text): (usize, &S)| {
            let mut words = Vec::with_capacity(text.as_ref().len() / 4);
            let legend = self.encode_into(text.as_ref(), &hints.row(row), &mut words);
            (words, legend)
        };
        let rows: Vec<_> = texts.par_iter().enumerate().map(encode).collect();
        let mut all = EncodedIds { offsets: vec![0], ..EncodedIds::default() };
        all.ids.reserve_exact(rows.iter().map(|row| row.0.len()).sum());
        for (words, legend) in rows {
            all.prompt_lengths.push(vocabulary::prompt_length(&words));
            all.ids.extend(words);
            all.offsets.push(all.ids.len());
            all.legends.push(legend);
        }
        all
    }

    /// [`Codec::decode_completion`] of each row, in parallel.
    ///
    /// # Panics
    /// When there are not as many prompts, completions and legends.
    pub fn decode_completion_batch<L: AsRef<Legend> + Sync>(
        &self,
        prompts: &[Vec<Word>],
        completions: &[Vec<Word>],
        legends: &[L],
    ) -> Vec<String> {
        assert!(prompts.len() == completions.len() && completions.len() == legends.len(), "as many of each");
        let rows = prompts.par_iter().zip(completions).zip(legends);
        rows.map(|((prompt, completion), legend)| self.decode_completion(prompt, completion, legend.as_ref())).collect()
    }

    /// [`Codec::decode`] of each row, in parallel.
    ///
    /// # Panics
    /// When there are not as many legends as rows.
    pub fn decode_batch<S: AsRef<str> + Sync, L: AsRef<Legend> + Sync>(
        &self,
        rows: &[S],
        legends: &[L],
    ) -> Vec<String> {
        assert_eq!(rows.len(), legends.len(), "a legend for each row");
        let rows = rows.par_iter().zip(legends);
        rows.map(|(words, legend)| self.decode(words.as_ref(), legend.as_ref())).collect()
    }
}

#[cfg(test)]
mod tests;
