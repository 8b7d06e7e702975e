//! What the codec knows of a domain: names and arities, and tables between them and words.

use rustc_hash::FxHashMap;
use serde::{Deserialize, Serialize};

use super::packed::Packed;
use super::vocabulary::{SIGNS, Sign, Vocabulary, Word, plain, signed};
use crate::pddl::ast::{Atom, Domain, Effect};

/// A domain's names and arities, in order of declaration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Signature {
    /// The domain's name.
    pub name: String,
    /// Names of types.
    pub types: Vec<String>,
    /// Predicates.
    pub predicates: Vec<PredicateSignature>,
    /// Actions and the numbers of their parameters.
    pub actions: Vec<(String, usize)>,
    /// For each action, other words for it.
    pub synonyms: Vec<Vec<String>>,
}

/// A predicate's name and arity.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PredicateSignature {
    /// Its name.
    pub name: String,
    /// The number of its parameters.
    pub arity: usize,
    /// Whether some action can change it.
    pub fluent: bool,
}

impl Signature {
    /// The signature of a domain whose actions have these other words.
    pub fn of(domain: &Domain, synonyms: &[Vec<String>]) -> Self {
        let mut fluent = vec![false; domain.predicates.len()];
        domain.actions.iter().for_each(|action| mark_changed(&action.effect, &mut fluent));
        let predicate = |(predicate, fluent): (&crate::pddl::ast::Predicate, bool)| PredicateSignature {
            name: predicate.name.clone(),
            arity: predicate.parameters.len(),
            fluent: fluent || predicate.derived,
        };
        Self {
            name: domain.name.clone(),
            types: domain.types.iter().map(|kind| kind.name.clone()).collect(),
            predicates: domain.predicates.iter().zip(fluent).map(predicate).collect(),
            actions: domain.actions.iter().map(|action| (action.name.clone(), action.parameters.len())).collect(),
            synonyms: synonyms.to_vec(),
        }
    }
}

/// For each action the words that a lexicon's table `[actions.<name>]` lists.
pub(super) fn synonyms_in(lexicon: &str, domain: &Domain) -> Result<Vec<Vec<String>>, toml::de::Error> {
    let lexicon: toml::Table = lexicon.parse()?;
    let words = |action: &crate::pddl::ast::Action| {
        let table =
            lexicon.get("actions").and_then(|actions| actions.get(&action.name)).and_then(toml::Value::as_table);
        let lists = table.into_iter().flat_map(|table| table.values()).filter_map(toml::Value::as_array).flatten();
        lists.filter_map(|word| word.as_str().map(str::to_owned)).collect()
    };
    Ok(domain.actions.iter().map(words).collect())
}

fn mark_changed(effect: &Effect, fluent: &mut [bool]) {
    match effect {
        Effect::And(parts) => parts.iter().for_each(|part| mark_changed(part, fluent)),
        Effect::Add(Atom { predicate, .. }) | Effect::Delete(Atom { predicate, .. }) => {
            fluent[predicate.index()] = true;
        }
        Effect::When(_, body) | Effect::Forall(_, body) => mark_changed(body, fluent),
        Effect::IncreaseCost(_) => {}
    }
}

/// Between the names of one domain and words.
#[derive(Clone, Debug)]
pub(crate) struct Tables {
    pub(super) types: FxHashMap<String, Word>,
    pub(super) predicates: FxHashMap<String, u16>,
    /// By word: action.
    pub(super) synonyms: FxHashMap<String, u16>,
    pub(crate) action_words: Vec<Word>,
    /// By predicate and sign.
    predicate_words: Vec<[Word; SIGNS.len()]>,
    actions: FxHashMap<Word, u16>,
    signs: FxHashMap<Word, (Sign, u16)>,
}

impl Tables {
    pub(super) fn of(signature: &Signature, vocabulary: &Vocabulary) -> Self {
        let id = |word: &str| vocabulary.id(word).unwrap_or(Word::MAX);
        let action_words: Vec<Word> = signature.actions.iter().map(|action| id(&plain(&action.0))).collect();
        let predicate_words: Vec<_> =
            signature.predicates.iter().map(|p| SIGNS.map(|(sign, _)| id(&signed(sign, &p.name)))).collect();
        let is_small = |&(predicate, _): &(usize, _)| signature.predicates[predicate].arity <= Packed::MAX_ARITY;
        let sign_of = |(predicate, words): (usize, &[Word; SIGNS.len()])| {
            SIGNS.map(|(sign, _)| (words[sign as usize], (sign, predicate as u16)))
        };
        let small = |(number, predicate): (usize, &PredicateSignature)| {
            (predicate.arity <= Packed::MAX_ARITY).then(|| (predicate.name.clone(), number as u16))
        };
        Self {
            types: signature.types.iter().map(|name| (name.clone(), id(&plain(name)))).collect(),
            predicates: signature.predicates.iter().enumerate().filter_map(small).collect(),
            synonyms: synonyms(signature),
            actions: action_words.iter().enumerate().map(|(action, &word)| (word, action as u16)).collect(),
            signs: predicate_words.iter().enumerate().filter(is_small).flat_map(sign_of).collect(),
            action_words,
            predicate_words,
        }
    }

    pub(crate) fn predicate_word(&self, sign: Sign, predicate: u16) -> Word {
        self.predicate_words[usize::from(predicate)][sign as usize]
    }

    pub(super) fn action(&self, word: Word) -> Option<usize> {
        self.actions.get(&word).map(|&action| usize::from(action))
    }

    pub(super) fn signed_predicate(&self, word: Word) -> Option<(Sign, u16)> {
        self.signs.get(&word).copied()
    }
}

/// Every action by its name and its other words; a name goes before a synonym, an earlier action before a later.
fn synonyms(signature: &Signature) -> FxHashMap<String, u16> {
    let mut table = FxHashMap::default();
    for (action, (name, _)) in signature.actions.iter().enumerate() {
        table.entry(name.clone()).or_insert(action as u16);
    }
    for (action, words) in signature.synonyms.iter().enumerate() {
        for word in words {
            table.entry(word.clone()).or_insert(action as u16);
        }
    }
    table
}
