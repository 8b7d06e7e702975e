//! Problems with holes: typed placeholders, arrays, distractors, alternatives for the initial state.
//!
//! The format is described in `docs/templates.md`. Reading checks every name, arity and type against the domain;
//! filling makes all the choices that are open, either each combination in turn or drawn.

mod arrays;
mod choices;
mod filling;
mod reader;

use crate::pddl::ast::{ObjectId, PredicateId, TypeId};

use arrays::Array;
pub use reader::read_template;

/// A problem with holes.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// The template's name.
    pub name: String,
    /// The possible types of each placeholder.
    placeholders: Vec<Vec<TypeId>>,
    /// Objects in rows and grids, which come after the placeholders.
    arrays: Vec<Array>,
    /// How many distractors at least and at most.
    distractors: (usize, usize),
    /// What a distractor may be.
    kinds: Vec<Kind>,
    /// What is true at the start.
    init: Vec<Form>,
    /// The goal's literals, false ones with `false`; missing where goals are drawn from reachable states.
    goal: Option<Vec<(bool, Pattern)>>,
}

impl Template {
    /// Whether the template states a goal.
    pub fn has_goal(&self) -> bool {
        self.goal.is_some()
    }

    /// The template with other sizes of its array of that type; `None` where it has no such array, or not of as many
    /// dimensions, or one of the sizes is 0.
    pub fn resized(mut self, type_id: TypeId, sizes: &[usize]) -> Option<Self> {
        let array = self.arrays.iter_mut().find(|array| array.type_id == type_id)?;
        let fits = array.sizes.len() == sizes.len() && !sizes.contains(&0);
        array.sizes = fits.then(|| sizes.to_vec())?;
        Some(self)
    }
}

/// One kind of distractor.
#[derive(Clone, Debug, PartialEq)]
struct Kind {
    types: Vec<TypeId>,
    forms: Vec<Form>,
}

/// A part of an initial state.
#[derive(Clone, Debug, PartialEq)]
enum Form {
    Atom(Pattern),
    And(Vec<Form>),
    OneOf(Vec<Form>),
}

/// An atom with holes.
#[derive(Clone, Debug, PartialEq)]
struct Pattern {
    predicate: PredicateId,
    terms: Vec<Hole>,
}

/// What stands in an atom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hole {
    Constant(ObjectId),
    /// The placeholder with this number.
    Placeholder(usize),
    /// The object that is being placed, or the one with this number of a rule's.
    Local(usize),
    /// Some object of the type that was placed before.
    Any(TypeId),
}
