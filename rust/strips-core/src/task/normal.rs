//! Lifted conditions in negation normal form, and effects as a flat list: what the join engine and the simplifier read.

use std::collections::BTreeSet;

use super::universe::{Candidates, Universe};
use crate::pddl::ast::{Action, Atom, Condition, Effect, Term};

/// A set of variables.
pub(super) type Variables = BTreeSet<usize>;

/// A variable or an object in a tuple's column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Slot {
    Variable(usize),
    Object(u32),
}

impl Slot {
    pub fn new(term: Term) -> Self {
        match term {
            Term::Variable(variable) => Self::Variable(variable.index()),
            Term::Object(object) => Self::Object(object.0),
        }
    }

    /// The object that the slot stands for.
    pub fn value(self, binding: &[u32]) -> u32 {
        match self {
            Self::Variable(variable) => binding[variable],
            Self::Object(object) => object,
        }
    }

    pub fn variable(self) -> Option<usize> {
        match self {
            Self::Variable(variable) => Some(variable),
            Self::Object(_) => None,
        }
    }
}

/// A relation (each predicate is one) with a slot for each column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Pattern {
    pub relation: usize,
    pub slots: Vec<Slot>,
}

impl Pattern {
    pub fn new(atom: &Atom) -> Self {
        let slots = atom.terms.iter().copied().map(Slot::new).collect();
        Self { relation: atom.predicate.index(), slots }
    }

    pub fn variables(&self) -> impl Iterator<Item = usize> + '_ {
        self.slots.iter().filter_map(|slot| slot.variable())
    }
}

/// A condition in negation normal form.
#[derive(Clone, Debug)]
pub(super) enum Normal {
    Literal(Pattern, bool),
    Equal(Slot, Slot, bool),
    And(Vec<Normal>),
    Or(Vec<Normal>),
    Forall(Quantified),
    Exists(Quantified),
}

/// A body under the variables `first..first + ranges.len()`.
#[derive(Clone, Debug)]
pub(super) struct Quantified {
    pub first: usize,
    pub ranges: Vec<Candidates>,
    pub body: Box<Normal>,
}

impl Quantified {
    /// Whether the variables have any binding at all.
    pub fn is_inhabited(&self) -> bool {
        self.ranges.iter().all(|range| !range.list.is_empty())
    }
}

impl Normal {
    /// The normal form of a condition (of its negation, unless `wanted`) inside the scope of `depth` variables.
    pub fn new(condition: &Condition, wanted: bool, depth: usize, universe: &Universe) -> Self {
        let all = |parts: &[Condition]| parts.iter().map(|part| Self::new(part, wanted, depth, universe)).collect();
        let quantified = |parameters: &[_], body: &Condition| Quantified {
            first: depth,
            ranges: universe.scope(parameters),
            body: Box::new(Self::new(body, wanted, depth + parameters.len(), universe)),
        };
        match (condition, wanted) {
            (Condition::And(parts), true) | (Condition::Or(parts), false) => Self::And(all(parts)),
            (Condition::Or(parts), true) | (Condition::And(parts), false) => Self::Or(all(parts)),
            (Condition::Not(part), _) => Self::new(part, !wanted, depth, universe),
            (Condition::Imply(premise, conclusion), _) => {
                let parts =
                    vec![Self::new(premise, !wanted, depth, universe), Self::new(conclusion, wanted, depth, universe)];
                if wanted { Self::Or(parts) } else { Self::And(parts) }
            }
            (Condition::Forall(parameters, body), true) | (Condition::Exists(parameters, body), false) => {
                Self::Forall(quantified(parameters, body))
            }
            (Condition::Exists(parameters, body), true) | (Condition::Forall(parameters, body), false) => {
                Self::Exists(quantified(parameters, body))
            }
            (Condition::Atom(atom), _) => Self::Literal(Pattern::new(atom), wanted),
            (Condition::Equals(left, right), _) => Self::Equal(Slot::new(*left), Slot::new(*right), wanted),
        }
    }

    /// The variables that occur in the condition and are not bound by its own quantifiers.
    pub fn free(&self) -> Variables {
        match self {
            Self::Literal(pattern, _) => pattern.variables().collect(),
            Self::Equal(left, right, _) => [left, right].into_iter().filter_map(|slot| slot.variable()).collect(),
            Self::And(parts) | Self::Or(parts) => parts.iter().flat_map(Self::free).collect(),
            Self::Forall(inner) | Self::Exists(inner) => {
                inner.body.free().into_iter().filter(|&variable| variable < inner.first).collect()
            }
        }
    }

    /// The free variables whose values some positive atom gives wherever the condition is true.
    pub fn binding(&self) -> Variables {
        match self {
            Self::Literal(pattern, true) => pattern.variables().collect(),
            Self::Literal(_, false) | Self::Equal(..) | Self::Forall(_) => Variables::new(),
            Self::And(parts) => parts.iter().flat_map(Self::binding).collect(),
            Self::Or(parts) => parts.iter().map(Self::binding).reduce(|left, right| &left & &right).unwrap_or_default(),
            Self::Exists(inner) => {
                inner.body.binding().into_iter().filter(|&variable| variable < inner.first).collect()
            }
        }
    }

    /// Calls `visit` with every literal.
    pub fn literals(&self, visit: &mut impl FnMut(&Pattern, bool)) {
        match self {
            Self::Literal(pattern, wanted) => visit(pattern, *wanted),
            Self::Equal(..) => {}
            Self::And(parts) | Self::Or(parts) => parts.iter().for_each(|part| part.literals(visit)),
            Self::Forall(inner) | Self::Exists(inner) => inner.body.literals(visit),
        }
    }
}

/// A lifted conditional effect: for every binding of the variables from the action's parameters on, if `condition`
/// held, `del_effects` go and `add_effects` come.
#[derive(Clone, Debug)]
pub(super) struct LiftedEffect {
    /// What each variable in scope ranges over: the action's parameters, then the quantified ones.
    pub scope: Vec<Candidates>,
    pub condition: Vec<Normal>,
    pub add_effects: Vec<Pattern>,
    pub del_effects: Vec<Pattern>,
}

impl LiftedEffect {
    fn new(scope: Vec<Candidates>, condition: Vec<Normal>) -> Self {
        Self { scope, condition, add_effects: Vec::new(), del_effects: Vec::new() }
    }
}

/// The effects of an action as a flat list; the first is the one without condition and quantifier, empty or not.
pub(super) fn effects(action: &Action, universe: &Universe) -> Vec<LiftedEffect> {
    let mut list = vec![LiftedEffect::new(universe.scope(&action.parameters), Vec::new())];
    flatten(&action.effect, 0, &mut list, universe);
    let (first, rest) = list.split_at(1);
    let occupied = rest.iter().filter(|effect| !(effect.add_effects.is_empty() && effect.del_effects.is_empty()));
    first.iter().chain(occupied).cloned().collect()
}

/// Adds what stands under `effect` to the entry `at` of the list, or to new entries below it.
fn flatten(effect: &Effect, at: usize, list: &mut Vec<LiftedEffect>, universe: &Universe) {
    match effect {
        Effect::And(parts) => parts.iter().for_each(|part| flatten(part, at, list, universe)),
        Effect::Add(atom) => list[at].add_effects.push(Pattern::new(atom)),
        Effect::Delete(atom) => list[at].del_effects.push(Pattern::new(atom)),
        Effect::IncreaseCost(_) => {}
        Effect::When(condition, inner) => {
            let mut nested = LiftedEffect::new(list[at].scope.clone(), list[at].condition.clone());
            nested.condition.push(Normal::new(condition, true, nested.scope.len(), universe));
            list.push(nested);
            flatten(inner, list.len() - 1, list, universe);
        }
        Effect::Forall(parameters, inner) => {
            let mut nested = LiftedEffect::new(list[at].scope.clone(), list[at].condition.clone());
            nested.scope.extend(universe.scope(parameters));
            list.push(nested);
            flatten(inner, list.len() - 1, list, universe);
        }
    }
}
