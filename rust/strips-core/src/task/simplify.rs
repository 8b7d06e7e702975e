//! Lifted conditions under a binding, with everything that cannot change folded away.

use rustc_hash::FxHashMap;

use super::limits::{LimitError, Watch};
use super::normal::{Normal, Pattern, Quantified};
use super::reach::with_tuple;
use super::relation::Relation;
use super::{FactId, Formula, GroundCondition};

/// What is known about an atom over all reachable states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Status {
    /// Never true.
    False,
    /// Always true.
    True,
    /// It may change, or nobody knows.
    Fact(FactId),
}

/// Grounds conditions against the atoms that were reached.
pub(super) struct Simplifier<'a> {
    /// The predicates' tables.
    pub relations: &'a [Relation],
    /// For each predicate, what is known about each row of its table.
    pub status: &'a [Vec<Status>],
    /// Ends overlong expansions.
    pub watch: &'a Watch,
}

impl Simplifier<'_> {
    /// What is known about the atom.
    pub fn status(&self, atom: &Pattern, binding: &[u32]) -> Status {
        let row = with_tuple(&atom.slots, binding, |tuple| self.relations[atom.relation].tuples.find(tuple));
        row.map_or(Status::False, |row| self.status[atom.relation][row])
    }

    /// The conjunction of the conditions, or nothing where it is never true. `binding` has a value for each variable
    /// that is free in them; it may grow.
    pub fn conjunction(
        &self,
        conditions: &[Normal],
        binding: &mut Vec<u32>,
    ) -> Result<Option<GroundCondition>, LimitError> {
        let mut result = GroundCondition::default();
        for condition in conditions {
            if !self.require(condition, binding, &mut result)? {
                return Ok(None);
            }
        }
        for side in [&mut result.positive, &mut result.negative] {
            side.sort_unstable();
            side.dedup();
        }
        let contradicts = result.positive.iter().any(|fact| result.negative.binary_search(fact).is_ok());
        Ok((!contradicts).then_some(result))
    }

    /// Adds a condition to the conjunction; false if it is never true.
    fn require(
        &self,
        condition: &Normal,
        binding: &mut Vec<u32>,
        result: &mut GroundCondition,
    ) -> Result<bool, LimitError> {
        match condition {
            Normal::And(parts) => {
                for part in parts {
                    if !self.require(part, binding, result)? {
                        return Ok(false);
                    }
                }
                Ok(true)
            }
            _ => Ok(absorb(self.formula(condition, binding)?, result)),
        }
    }

    /// The condition as a formula over facts; `And([])` is true and `Or([])` false.
    fn formula(&self, condition: &Normal, binding: &mut Vec<u32>) -> Result<Formula, LimitError> {
        Ok(match condition {
            Normal::Literal(atom, wanted) => match self.status(atom, binding) {
                Status::Fact(fact) => Formula::Literal(fact, *wanted),
                known => constant((known == Status::True) == *wanted),
            },
            Normal::Equal(left, right, wanted) => constant((left.value(binding) == right.value(binding)) == *wanted),
            Normal::And(parts) => self.combine(parts, true, binding)?,
            Normal::Or(parts) => self.combine(parts, false, binding)?,
            Normal::Forall(inner) => self.quantified(inner, true, binding)?,
            Normal::Exists(inner) => self.quantified(inner, false, binding)?,
        })
    }

    fn combine(&self, parts: &[Normal], all: bool, binding: &mut Vec<u32>) -> Result<Formula, LimitError> {
        let mut group = Group::new(all);
        for part in parts {
            group.add(self.formula(part, binding)?);
            if group.is_decided {
                break;
            }
        }
        Ok(group.finish())
    }

    fn quantified(&self, inner: &Quantified, all: bool, binding: &mut Vec<u32>) -> Result<Formula, LimitError> {
        let mut group = Group::new(all);
        if inner.is_inhabited() {
            binding.resize(binding.len().max(inner.first + inner.ranges.len()), 0);
            self.expand(inner, 0, binding, &mut group)?;
        }
        Ok(group.finish())
    }

    /// Adds the body under every binding of the variables from the one at `at` on.
    fn expand(
        &self,
        inner: &Quantified,
        at: usize,
        binding: &mut Vec<u32>,
        group: &mut Group,
    ) -> Result<(), LimitError> {
        if at == inner.ranges.len() {
            group.add(self.formula(&inner.body, binding)?);
            return Ok(());
        }
        self.watch.check()?;
        for &object in inner.ranges[at].list.iter() {
            binding[inner.first + at] = object;
            let known = self.settled(&inner.body, binding, inner.first + at + 1);
            match known {
                Some(value) => group.add(constant(value)),
                None => self.expand(inner, at + 1, binding, group)?,
            }
            if group.is_decided {
                break;
            }
        }
        Ok(())
    }

    /// The condition's value, if the variables below `known` already settle it; looks at no quantifier.
    fn settled(&self, condition: &Normal, binding: &[u32], known: usize) -> Option<bool> {
        match condition {
            Normal::Literal(atom, wanted) if atom.variables().all(|variable| variable < known) => {
                match self.status(atom, binding) {
                    Status::Fact(_) => None,
                    status => Some((status == Status::True) == *wanted),
                }
            }
            Normal::Equal(left, right, wanted)
                if [left, right].into_iter().filter_map(|slot| slot.variable()).all(|variable| variable < known) =>
            {
                Some((left.value(binding) == right.value(binding)) == *wanted)
            }
            Normal::And(parts) => self.settled_by(parts, false, binding, known),
            Normal::Or(parts) => self.settled_by(parts, true, binding, known),
            _ => None,
        }
    }

    /// `decisive` if some part has that value, the opposite if all parts have that.
    fn settled_by(&self, parts: &[Normal], decisive: bool, binding: &[u32], known: usize) -> Option<bool> {
        let mut all_opposite = true;
        for part in parts {
            match self.settled(part, binding, known) {
                Some(value) if value == decisive => return Some(decisive),
                Some(_) => {}
                None => all_opposite = false,
            }
        }
        all_opposite.then_some(!decisive)
    }
}

/// The formula that is always true or always false.
fn constant(value: bool) -> Formula {
    if value { Formula::And(Vec::new()) } else { Formula::Or(Vec::new()) }
}

/// Adds a formula to a conjunction; false if it is never true.
fn absorb(formula: Formula, result: &mut GroundCondition) -> bool {
    match formula {
        Formula::Literal(fact, true) => result.positive.push(fact),
        Formula::Literal(fact, false) => result.negative.push(fact),
        Formula::And(parts) => return parts.into_iter().all(|part| absorb(part, result)),
        Formula::Or(parts) if parts.is_empty() => return false,
        clause @ Formula::Or(_) => {
            if !result.clauses.contains(&clause) {
                result.clauses.push(clause);
            }
        }
    }
    true
}

/// A conjunction or disjunction in the making: flat, without duplicates, decided as soon as one part decides it.
struct Group {
    all: bool,
    parts: Vec<Formula>,
    literals: FxHashMap<FactId, bool>,
    is_decided: bool,
}

impl Group {
    fn new(all: bool) -> Self {
        Self { all, parts: Vec::new(), literals: FxHashMap::default(), is_decided: false }
    }

    fn add(&mut self, formula: Formula) {
        match formula {
            Formula::And(parts) if self.all => parts.into_iter().for_each(|part| self.add(part)),
            Formula::Or(parts) if !self.all => parts.into_iter().for_each(|part| self.add(part)),
            Formula::And(parts) | Formula::Or(parts) if parts.is_empty() => self.is_decided = true,
            Formula::Literal(fact, value) => match self.literals.insert(fact, value) {
                None => self.parts.push(Formula::Literal(fact, value)),
                Some(known) => self.is_decided |= known != value,
            },
            part => self.parts.push(part),
        }
    }

    fn finish(mut self) -> Formula {
        if self.is_decided {
            return constant(!self.all);
        }
        match self.parts.len() {
            1 => self.parts.remove(0),
            _ if self.all => Formula::And(self.parts),
            _ => Formula::Or(self.parts),
        }
    }
}
