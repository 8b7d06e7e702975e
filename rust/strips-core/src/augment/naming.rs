//! Names and words for one record.

use super::lexicon::{Hold, Lexicon};
use super::made_up::made_up_word;
use crate::pddl::ast::{ActionId, Domain, Object, PredicateId};
use crate::random::Random;

/// Where a record's object names come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Names {
    /// Trained names, each replaced by a trained made-up word with this probability.
    Trained {
        /// The probability.
        made_up: f64,
    },
    /// Held-out names from the lexicon.
    HeldOut,
    /// Held-out made-up words.
    MadeUp,
}

/// How a record names things.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Naming {
    /// Where object names come from.
    pub names: Names,
    /// Which words actions take.
    pub words: Hold,
    /// Which words predicates take.
    pub predicates: Hold,
}

impl Naming {
    /// A name for each object, all different; what the domain itself names keeps its name.
    ///
    /// Where the lexicon's names for a type run out, made-up words of the same side stand in.
    pub fn draw_names(
        &self,
        domain: &Domain,
        lexicon: &Lexicon,
        objects: &[Object],
        random: &mut Random,
    ) -> Vec<String> {
        let fixed = domain.constants.len() + domain.pending.len();
        let mut names: Vec<String> = objects[..fixed].iter().map(|object| object.name.clone()).collect();
        for object in &objects[fixed..] {
            let name = self.draw_name(domain, lexicon, object, &names, random);
            names.push(name);
        }
        names
    }

    fn draw_name(
        &self,
        domain: &Domain,
        lexicon: &Lexicon,
        object: &Object,
        used: &[String],
        random: &mut Random,
    ) -> String {
        let (hold, made_up) = match self.names {
            Names::Trained { made_up } => (Hold::Trained, random.chance(made_up)),
            Names::HeldOut => (Hold::HeldOut, false),
            Names::MadeUp => (Hold::HeldOut, true),
        };
        if !made_up {
            let names = lexicon.names(domain, object.types[0], hold);
            let free = |name: &&String| !used.contains(*name);
            let count = names.iter().filter(free).count();
            if count > 0 {
                return names.iter().filter(free).nth(random.below(count)).expect("drawn below the count").clone();
            }
        }
        fresh_made_up(lexicon, hold, used, random)
    }

    /// A word for each action.
    pub fn draw_words(&self, domain: &Domain, lexicon: &Lexicon, random: &mut Random) -> Vec<String> {
        let words = |action: usize| lexicon.words(ActionId::from(action), self.words);
        let own = domain.actions.iter().map(|action| &action.name);
        own.enumerate().map(|(action, own)| choose(words(action), own, random)).collect()
    }

    /// A word for each predicate.
    pub fn draw_predicate_words(&self, domain: &Domain, lexicon: &Lexicon, random: &mut Random) -> Vec<String> {
        let words = |predicate: usize| lexicon.predicate_words(PredicateId::from(predicate), self.predicates);
        let own = domain.predicates.iter().map(|predicate| &predicate.name);
        own.enumerate().map(|(predicate, own)| choose(words(predicate), own, random)).collect()
    }
}

/// One of the words, or `own` where there are none.
fn choose(words: &[String], own: &str, random: &mut Random) -> String {
    if words.is_empty() { own.to_owned() } else { random.choice(words).clone() }
}

fn fresh_made_up(lexicon: &Lexicon, hold: Hold, used: &[String], random: &mut Random) -> String {
    loop {
        let word = made_up_word(random, hold);
        if !lexicon.is_taken(&word) && !used.contains(&word) {
            return word;
        }
    }
}
