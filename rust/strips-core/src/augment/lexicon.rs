//! Names for objects and words for actions and predicates, read from TOML, each either trained or held out.
//!
//! ```toml
//! [objects.movable]
//! trained = ["apple", "cereal_bar"]
//! held_out = ["kiwi"]
//! [actions.pick]
//! trained = ["pick", "lift"]
//! [predicates.on]
//! trained = ["on", "atop"]
//! ```

use std::ops::Range;

use rustc_hash::FxHashSet;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{LexiconError, LexiconErrorKind};
use crate::pddl::Source;
use crate::pddl::ast::{ActionId, Domain, Predicate, PredicateId, TypeId};

/// Whether a word may occur in training, or only in the suite that tests it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// Training may draw it.
    Trained,
    /// Only a suite may.
    HeldOut,
}

/// Words for one thing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Words {
    trained: Vec<String>,
    held_out: Vec<String>,
}

impl Words {
    fn get(&self, hold: Hold) -> &[String] {
        match hold {
            Hold::Trained => &self.trained,
            Hold::HeldOut => &self.held_out,
        }
    }
}

/// Names by type, words by action and by predicate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lexicon {
    objects: Vec<Words>,
    actions: Vec<Words>,
    predicates: Vec<Words>,
    taken: FxHashSet<String>,
}

impl Lexicon {
    /// The lexicon of a domain that has none: no names, and each action's own name for its word.
    pub fn bare(domain: &Domain) -> Self {
        let own = |name: &String| Words { trained: vec![name.clone()], held_out: Vec::new() };
        Self {
            objects: vec![Words::default(); domain.types.len()],
            actions: domain.actions.iter().map(|action| own(&action.name)).collect(),
            predicates: domain.predicates.iter().map(|predicate| own(&predicate.name)).collect(),
            taken: reserved(domain),
        }
    }

    /// Reads the lexicon of `domain`.
    ///
    /// # Errors
    /// The first mistake in the text: no TOML, an unknown table or name, or a word that collides.
    pub fn read(source: &Source, domain: &Domain) -> Result<Self, LexiconError> {
        let at = |kind, offset| LexiconError::new(kind, offset, source);
        let table = DeTable::parse(source.text()).map_err(|error| {
            at(LexiconErrorKind::Toml(error.message().to_owned()), error.span().map_or(0, |span| span.start))
        })?;
        Reader { lexicon: Self::bare(domain), domain }
            .read(table.get_ref())
            .map_err(|(kind, span)| at(kind, span.start))
    }

    /// Names for objects of the type: its own, or those of the nearest type above that has any.
    pub fn names(&self, domain: &Domain, type_id: TypeId, hold: Hold) -> &[String] {
        let own = self.objects[type_id.index()].get(hold);
        if !own.is_empty() {
            return own;
        }
        let mut level = domain.types[type_id.index()].parents.clone();
        while !level.is_empty() {
            let found = level.iter().map(|id| self.objects[id.index()].get(hold)).find(|names| !names.is_empty());
            if let Some(names) = found {
                return names;
            }
            level = level.iter().flat_map(|id| domain.types[id.index()].parents.clone()).collect();
        }
        &[]
    }

    /// Words for the action.
    pub fn words(&self, action: ActionId, hold: Hold) -> &[String] {
        self.actions[action.index()].get(hold)
    }

    /// Words for the predicate.
    pub fn predicate_words(&self, predicate: PredicateId, hold: Hold) -> &[String] {
        self.predicates[predicate.index()].get(hold)
    }

    /// Whether the word names or means something already, so that no object may be called so by chance.
    pub fn is_taken(&self, word: &str) -> bool {
        self.taken.contains(word)
    }

    /// Whether every action has a held-out word.
    pub fn has_held_out_words(&self) -> bool {
        self.actions.iter().all(|words| !words.held_out.is_empty())
    }

    /// Whether every predicate has a held-out word.
    pub fn has_held_out_predicate_words(&self) -> bool {
        self.predicates.iter().all(|words| !words.held_out.is_empty())
    }

    /// Whether some predicate has a trained word other than its name.
    pub fn has_predicate_words(&self, domain: &Domain) -> bool {
        let other = |(words, predicate): (&Words, &Predicate)| words.trained.iter().any(|word| *word != predicate.name);
        self.predicates.iter().zip(&domain.predicates).any(other)
    }

    /// Whether some type has held-out names.
    pub fn has_held_out_names(&self) -> bool {
        self.objects.iter().any(|words| !words.held_out.is_empty())
    }
}

/// Every name that the domain itself uses.
fn reserved(domain: &Domain) -> FxHashSet<String> {
    let types = domain.types.iter().map(|kind| &kind.name);
    let constants = domain.constants.iter().map(|object| &object.name);
    let predicates = domain.predicates.iter().map(|predicate| &predicate.name);
    let actions = domain.actions.iter().map(|action| &action.name);
    types.chain(constants).chain(predicates).chain(actions).cloned().collect()
}

/// What is wrong and which bytes.
type Fault = (LexiconErrorKind, Range<usize>);
type Key<'t> = Spanned<std::borrow::Cow<'t, str>>;

struct Reader<'d> {
    lexicon: Lexicon,
    domain: &'d Domain,
}

impl Reader<'_> {
    fn read(mut self, table: &DeTable<'_>) -> Result<Lexicon, Fault> {
        for (key, value) in table {
            match key.get_ref().as_ref() {
                "objects" => self.section(value, "type")?,
                "actions" => self.section(value, "action")?,
                "predicates" => self.section(value, "predicate")?,
                other => return Err((LexiconErrorKind::UnknownTable(other.to_owned()), key.span())),
            }
        }
        Ok(self.lexicon)
    }

    fn section(&mut self, value: &Spanned<DeValue<'_>>, what: &'static str) -> Result<(), Fault> {
        for (key, value) in as_table(value)? {
            self.entry(key, what)?;
            let words = self.words(key, value, what)?;
            *self.entry(key, what)? = words;
        }
        Ok(())
    }

    fn entry(&mut self, key: &Key<'_>, what: &'static str) -> Result<&mut Words, Fault> {
        let name = key.get_ref().as_ref();
        let found = match what {
            "type" => self.domain.type_id(name).map(|id| &mut self.lexicon.objects[id.index()]),
            "action" => self.domain.action(name).map(|id| &mut self.lexicon.actions[id.index()]),
            _ => self.domain.predicate(name).map(|id| &mut self.lexicon.predicates[id.index()]),
        };
        found.ok_or_else(|| (LexiconErrorKind::Undeclared { what, name: name.to_owned() }, key.span()))
    }

    fn words(&mut self, key: &Key<'_>, value: &Spanned<DeValue<'_>>, what: &'static str) -> Result<Words, Fault> {
        let mut words = Words::default();
        for (list, value) in as_table(value)? {
            let read = self.list(value, key.get_ref().as_ref(), what)?;
            match list.get_ref().as_ref() {
                "trained" => words.trained = read,
                "held_out" => words.held_out = read,
                other => return Err((LexiconErrorKind::UnknownList(other.to_owned()), list.span())),
            }
        }
        Ok(words)
    }

    fn list(&mut self, value: &Spanned<DeValue<'_>>, own: &str, what: &'static str) -> Result<Vec<String>, Fault> {
        let Some(array) = value.get_ref().as_array() else {
            return Err((LexiconErrorKind::Expected("a list of words"), value.span()));
        };
        array.iter().map(|item| self.word(item, own, what)).collect()
    }

    /// One word; an action's or predicate's own name is free for itself alone.
    fn word(&mut self, item: &Spanned<DeValue<'_>>, own: &str, what: &'static str) -> Result<String, Fault> {
        let Some(word) = item.get_ref().as_str() else {
            return Err((LexiconErrorKind::Expected("a word in quotes"), item.span()));
        };
        if !is_name(word) {
            return Err((LexiconErrorKind::NotAName(word.to_owned()), item.span()));
        }
        let is_own = what != "type" && word == own;
        if !is_own && !self.lexicon.taken.insert(word.to_owned()) {
            let what = "another name, word, type or part of the domain";
            return Err((LexiconErrorKind::Taken { name: word.to_owned(), what }, item.span()));
        }
        Ok(word.to_owned())
    }
}

fn as_table<'v, 't>(value: &'v Spanned<DeValue<'t>>) -> Result<&'v DeTable<'t>, Fault> {
    value.get_ref().as_table().ok_or_else(|| (LexiconErrorKind::Expected("a table"), value.span()))
}

/// Lower-case letters, digits, `_` and `-`, beginning with a letter: what PDDL and the text format both carry.
fn is_name(word: &str) -> bool {
    let inner = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || matches!(byte, b'_' | b'-');
    word.starts_with(|first: char| first.is_ascii_lowercase()) && word.bytes().all(inner)
}
