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
    /// For each predicate, other words for it; empty in codecs saved before predicates could have any.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub predicate_synonyms: Vec<Vec<String>>,
}

/// Other words for a domain's actions and predicates, each by position; empty where there are none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Synonyms {
    /// By action.
    pub actions: Vec<Vec<String>>,
    /// By predicate.
    pub predicates: Vec<Vec<String>>,
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
    /// The signature of a domain whose actions and predicates have these other words.
    pub fn of(domain: &Domain, synonyms: &Synonyms) -> Self {
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
            synonyms: synonyms.actions.clone(),
            predicate_synonyms: synonyms.predicates.clone(),
        }
    }
}

/// The words that a lexicon's tables `[actions.<name>]` and `[predicates.<name>]` list.
pub(super) fn synonyms_in(lexicon: &str, domain: &Domain) -> Result<Synonyms, toml::de::Error> {
    let lexicon: toml::Table = lexicon.parse()?;
    let words = |section: &str, name: &str| {
        let table = lexicon.get(section).and_then(|section| section.get(name)).and_then(toml::Value::as_table);
        let lists = table.into_iter().flat_map(|table| table.values()).filter_map(toml::Value::as_array).flatten();
        lists.filter_map(|word| word.as_str().map(str::to_owned)).collect()
    };
    Ok(Synonyms {
        actions: domain.actions.iter().map(|action| words("actions", &action.name)).collect(),
        predicates: domain.predicates.iter().map(|predicate| words("predicates", &predicate.name)).collect(),
    })
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
    /// By name or synonym: predicate, where canonical words can say it.
    pub(super) predicates: FxHashMap<String, u16>,
    /// By name or synonym: action.
    pub(super) actions_by_word: FxHashMap<String, u16>,
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
        let mut predicates =
            by_word(signature.predicates.iter().map(|predicate| &predicate.name), &signature.predicate_synonyms);
        predicates.retain(|_, predicate| signature.predicates[usize::from(*predicate)].arity <= Packed::MAX_ARITY);
        Self {
            types: signature.types.iter().map(|name| (name.clone(), id(&plain(name)))).collect(),
            predicates,
            actions_by_word: by_word(signature.actions.iter().map(|action| &action.0), &signature.synonyms),
            actions: action_words.iter().enumerate().map(|(action, &word)| (word, action as u16)).collect(),
            signs: predicate_words.iter().enumerate().filter(is_small).flat_map(sign_of).collect(),
            action_words,
            predicate_words,
        }
    }

    pub(crate) fn predicate_word(&self, sign: Sign, predicate: u16) -> Word {
        self.predicate_words[usize::from(predicate)][sign as usize]
    }

    /// Whether the word is a type's.
    pub(super) fn is_kind(&self, word: Word) -> bool {
        self.types.values().any(|&kind| kind == word)
    }

    pub(super) fn action(&self, word: Word) -> Option<usize> {
        self.actions.get(&word).map(|&action| usize::from(action))
    }

    pub(super) fn signed_predicate(&self, word: Word) -> Option<(Sign, u16)> {
        self.signs.get(&word).copied()
    }
}

/// Things by their names and their other words; a name goes before a synonym, an earlier thing before a later.
fn by_word<'s>(names: impl Iterator<Item = &'s String>, synonyms: &'s [Vec<String>]) -> FxHashMap<String, u16> {
    let others = synonyms.iter().enumerate().flat_map(|(number, words)| words.iter().map(move |word| (number, word)));
    let mut table = FxHashMap::default();
    for (number, word) in names.enumerate().chain(others) {
        table.entry(word.clone()).or_insert(number as u16);
    }
    table
}
