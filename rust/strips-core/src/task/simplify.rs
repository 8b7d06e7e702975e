//! Lifted conditions under a binding, with everything that cannot change folded away.

use std::sync::atomic::{AtomicUsize, Ordering};

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

/// The values of the variables in scope, and how large the formula in the making is.
pub(super) struct Frame {
    binding: Vec<u32>,
    parts: usize,
    held: usize,
}

impl Frame {
    /// A frame in which the first variables have these values.
    pub fn new(binding: &[u32]) -> Self {
        Self { binding: binding.to_vec(), parts: 0, held: 0 }
    }
}

/// Grounds conditions against the atoms that were reached.
pub(super) struct Simplifier<'a> {
    /// The predicates' tables.
    pub relations: &'a [Relation],
    /// For each predicate, what is known about each row of its table.
    pub status: &'a [Vec<Status>],
    /// Ends overlong expansions.
    pub watch: &'a Watch,
    /// Bytes that the tables and the task so far hold.
    pub bytes: &'a AtomicUsize,
}

/// What a part of an expanded quantifier is taken to hold.
const BYTES_PER_PART: usize = 48;

/// How many parts pass between two looks at the clock.
const PARTS_PER_CHECK: usize = 1 << 10;

impl Simplifier<'_> {
    /// What is known about the atom.
    pub fn status(&self, atom: &Pattern, binding: &[u32]) -> Status {
        let row = with_tuple(&atom.slots, binding, |tuple| self.relations[atom.relation].tuples.find(tuple));
        row.map_or(Status::False, |row| self.status[atom.relation][row])
    }

    /// The conjunction of the conditions, or nothing where it is never true. The frame has a value for each
    /// variable that is free in them.
    pub fn conjunction(&self, conditions: &[Normal], frame: &mut Frame) -> Result<Option<GroundCondition>, LimitError> {
        let mut result = GroundCondition::default();
        for condition in conditions {
            if !self.require(condition, frame, &mut result)? {
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
    fn require(&self, condition: &Normal, frame: &mut Frame, result: &mut GroundCondition) -> Result<bool, LimitError> {
        match condition {
            Normal::And(parts) => {
                for part in parts {
                    if !self.require(part, frame, result)? {
                        return Ok(false);
                    }
                }
                Ok(true)
            }
            _ => Ok(absorb(self.formula(condition, frame)?, result)),
        }
    }

    /// The condition as a formula over facts; `And([])` is true and `Or([])` false.
    fn formula(&self, condition: &Normal, frame: &mut Frame) -> Result<Formula, LimitError> {
        Ok(match condition {
            Normal::Literal(atom, wanted) => match self.status(atom, &frame.binding) {
                Status::Fact(fact) => Formula::Literal(fact, *wanted),
                known => constant((known == Status::True) == *wanted),
            },
            Normal::Equal(left, right, wanted) => {
                constant((left.value(&frame.binding) == right.value(&frame.binding)) == *wanted)
            }
            Normal::And(parts) => self.combine(parts, true, frame)?,
            Normal::Or(parts) => self.combine(parts, false, frame)?,
            Normal::Forall(inner) => self.quantified(inner, true, frame)?,
            Normal::Exists(inner) => self.quantified(inner, false, frame)?,
        })
    }

    fn combine(&self, parts: &[Normal], all: bool, frame: &mut Frame) -> Result<Formula, LimitError> {
        let mut group = Group::new(all);
        for part in parts {
            group.add(self.formula(part, frame)?);
            if group.is_decided {
                break;
            }
        }
        Ok(group.finish())
    }

    fn quantified(&self, inner: &Quantified, all: bool, frame: &mut Frame) -> Result<Formula, LimitError> {
        let mut group = Group::new(all);
        if inner.is_inhabited() {
            let variables = frame.binding.len().max(inner.first + inner.ranges.len());
            frame.binding.resize(variables, 0);
            self.expand(inner, 0, frame, &mut group)?;
        }
        Ok(group.finish())
    }

    /// Adds the body under every binding of the variables from the one at `at` on.
    fn expand(&self, inner: &Quantified, at: usize, frame: &mut Frame, group: &mut Group) -> Result<(), LimitError> {
        if at == inner.ranges.len() {
            let formula = self.formula(&inner.body, frame)?;
            let is_constant = matches!(&formula, Formula::And(parts) | Formula::Or(parts) if parts.is_empty());
            group.add(formula);
            return self.count(frame, !is_constant);
        }
        for &object in inner.ranges[at].list.iter() {
            frame.binding[inner.first + at] = object;
            let known = self.settled(&inner.body, &frame.binding, inner.first + at + 1);
            match known {
                Some(value) => group.add(constant(value)),
                None => self.expand(inner, at + 1, frame, group)?,
            }
            if group.is_decided {
                break;
            }
        }
        Ok(())
    }

    /// Counts one more part of a quantified formula, and now and then looks whether there are too many.
    fn count(&self, frame: &mut Frame, is_kept: bool) -> Result<(), LimitError> {
        frame.parts += 1;
        frame.held += if is_kept { BYTES_PER_PART } else { 0 };
        if frame.parts.is_multiple_of(PARTS_PER_CHECK) {
            self.watch.check()?;
            self.watch.bytes(self.bytes.load(Ordering::Relaxed) + frame.held)?;
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
