//! Problems with holes: typed placeholders, distractors, alternatives for the initial state.
//!
//! The format is described in `docs/templates.md`. Reading checks every name, arity and type against the domain;
//! filling makes all the choices that are open, either each combination in turn or drawn.

mod choices;
mod filling;
mod reader;

use crate::pddl::ast::{ObjectId, PredicateId, TypeId};

pub use reader::read_template;

/// A problem with holes.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// The template's name.
    pub name: String,
    /// The possible types of each placeholder.
    placeholders: Vec<Vec<TypeId>>,
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
    /// The distractor that is being placed.
    This,
    /// Some object of the type that was placed before.
    Any(TypeId),
}
