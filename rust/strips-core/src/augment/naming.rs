//! Names and words for one record.

use std::borrow::Cow;

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
    pub fn draw_names<'l>(
        &self,
        domain: &Domain,
        lexicon: &'l Lexicon,
        objects: &'l [Object],
        random: &mut Random,
    ) -> Vec<Cow<'l, str>> {
        let fixed = domain.constants.len() + domain.pending.len();
        let mut names = Vec::with_capacity(objects.len());
        names.extend(objects[..fixed].iter().map(|object| Cow::from(&object.name)));
        let mut used = Used { names, drawn: Vec::with_capacity(objects.len()), fixed };
        for object in &objects[fixed..] {
            let name = self.draw_name(domain, lexicon, object, &mut used, random);
            used.names.push(name);
        }
        used.names
    }

    fn draw_name<'l>(
        &self,
        domain: &Domain,
        lexicon: &'l Lexicon,
        object: &Object,
        used: &mut Used<'l>,
        random: &mut Random,
    ) -> Cow<'l, str> {
        let (hold, made_up) = match self.names {
            Names::Trained { made_up } => (Hold::Trained, random.chance(made_up)),
            Names::HeldOut => (Hold::HeldOut, false),
            Names::MadeUp => (Hold::HeldOut, true),
        };
        if !made_up {
            let names = lexicon.names(domain, object.types[0], hold);
            let taken = used.positions(names);
            if taken.len() < names.len() {
                let at = nth_free(&taken, random.below(names.len() - taken.len()));
                used.drawn.push((names, at));
                return Cow::from(&names[at]);
            }
        }
        fresh_made_up(lexicon, hold, &used.names, random).into()
    }

    /// A word for each action.
    pub fn draw_words<'l>(&self, domain: &'l Domain, lexicon: &'l Lexicon, random: &mut Random) -> Vec<&'l str> {
        let words = |action: usize| lexicon.words(ActionId::from(action), self.words);
        let own = domain.actions.iter().map(|action| &action.name);
        own.enumerate().map(|(action, own)| choose(words(action), own, random)).collect()
    }

    /// A word for each predicate.
    pub fn draw_predicate_words<'l>(
        &self,
        domain: &'l Domain,
        lexicon: &'l Lexicon,
        random: &mut Random,
    ) -> Vec<&'l str> {
        let words = |predicate: usize| lexicon.predicate_words(PredicateId::from(predicate), self.predicates);
        let own = domain.predicates.iter().map(|predicate| &predicate.name);
        own.enumerate().map(|(predicate, own)| choose(words(predicate), own, random)).collect()
    }
}

/// One of the words, or `own` where there are none.
fn choose<'l>(words: &'l [String], own: &'l str, random: &mut Random) -> &'l str {
    if words.is_empty() { own } else { random.choice::<String>(words) }
}

/// The names of a record so far.
struct Used<'l> {
    names: Vec<Cow<'l, str>>,
    /// The lists of the lexicon that names were drawn from, and where in them. No name is in two lists, nor made up.
    drawn: Vec<(&'l [String], usize)>,
    /// How many of the names the domain gave, which may be in a list by chance.
    fixed: usize,
}

impl Used<'_> {
    /// Which of the list's names are used, ascending.
    fn positions(&self, list: &[String]) -> Vec<usize> {
        let drawn = self.drawn.iter().filter(|(from, _)| std::ptr::eq(*from, list)).map(|&(_, at)| at);
        let given = self.names[..self.fixed].iter().filter_map(|name| list.iter().position(|listed| listed == name));
        let mut positions: Vec<usize> = drawn.chain(given).collect();
        positions.sort_unstable();
        positions.dedup();
        positions
    }
}

/// The position of the free one with this number; `taken` ascends.
fn nth_free(taken: &[usize], number: usize) -> usize {
    taken.iter().fold(number, |at, &taken| at + usize::from(taken <= at))
}

fn fresh_made_up(lexicon: &Lexicon, hold: Hold, used: &[Cow<'_, str>], random: &mut Random) -> String {
    loop {
        let word = made_up_word(random, hold);
        if !lexicon.is_taken(&word) && !used.iter().any(|name| *name == word) {
            return word;
        }
    }
}
