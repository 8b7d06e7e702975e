//! Which of the reached atoms can change, and their numbers.

use std::sync::atomic::AtomicUsize;

use super::lifted::{Lifted, LiftedAction};
use super::limits::{LimitError, Watch};
use super::normal::{LiftedEffect, Pattern};
use super::reach::with_tuple;
use super::relation::{Relation, TupleSet};
use super::simplify::{Frame, Simplifier, Status};
use super::{Fact, FactId};
use crate::pddl::ast::{Domain, ObjectId, PredicateId};

/// The limits, and the bytes held so far.
type Budget<'a> = (&'a Watch, &'a AtomicUsize);

/// What is known about every reached atom.
pub(super) struct Facts {
    /// For each predicate, for each row of its table.
    pub status: Vec<Vec<Status>>,
    /// The atoms that may change, ascending.
    pub facts: Vec<Fact>,
}

/// A number for facts that have none yet.
const UNNUMBERED: Status = Status::Fact(FactId(u32::MAX));

impl Facts {
    /// Sorts the reached atoms into those that may change and those that hold for ever. The first `initial[p]` rows of
    /// predicate `p` hold at the start.
    ///
    /// # Errors
    /// When a limit is reached while simplifying axioms.
    pub fn new(
        domain: &Domain,
        lifted: &Lifted,
        relations: &[Relation],
        initial: &[usize],
        budget: Budget,
    ) -> Result<Self, LimitError> {
        let held = |predicate: usize, row: usize| if row < initial[predicate] { Status::True } else { UNNUMBERED };
        let rows = |predicate: usize| (0..relations[predicate].tuples.len()).map(move |row| (predicate, row));
        let status = (0..domain.predicates.len())
            .map(|predicate| rows(predicate).map(|(predicate, row)| held(predicate, row)).collect())
            .collect();
        let mut facts = Self { status, facts: Vec::new() };
        for action in &lifted.actions {
            facts.mark_deleted(action, relations);
        }
        facts.number(relations);
        if !lifted.axioms.is_empty() {
            facts.settle_derived(lifted, relations, budget)?;
            facts.number(relations);
        }
        Ok(facts)
    }

    /// Marks what the operators of an action may delete.
    fn mark_deleted(&mut self, action: &LiftedAction, relations: &[Relation]) {
        self.mark_effect(&action.effect, &relations[action.relation].tuples, relations);
        for (instances, effect) in &action.conditional_effects {
            self.mark_effect(effect, &relations[*instances].tuples, relations);
        }
    }

    fn mark_effect(&mut self, effect: &LiftedEffect, instances: &TupleSet, relations: &[Relation]) {
        for binding in (0..instances.len()).map(|row| instances.row(row)) {
            for atom in &effect.del_effects {
                let table = &relations[atom.relation].tuples;
                let Some(row) = with_tuple(&atom.slots, binding, |tuple| table.find(tuple)) else { continue };
                let is_readded = |added: &Pattern| is_same(added, atom, binding);
                if !effect.add_effects.iter().any(is_readded) {
                    self.status[atom.relation][row] = UNNUMBERED;
                }
            }
        }
    }

    /// Numbers the atoms that may change, by (predicate, arguments).
    fn number(&mut self, relations: &[Relation]) {
        self.facts.clear();
        for (predicate, status) in self.status.iter_mut().enumerate() {
            let table = &relations[predicate].tuples;
            let mut rows: Vec<usize> =
                (0..status.len()).filter(|&row| matches!(status[row], Status::Fact(_))).collect();
            rows.sort_unstable_by_key(|&row| table.row(row));
            for row in rows {
                status[row] = Status::Fact(FactId::from(self.facts.len()));
                self.facts.push(fact(predicate, table.row(row)));
            }
        }
    }

    /// Finds derived atoms that hold in every state or in none, stratum by stratum.
    fn settle_derived(&mut self, lifted: &Lifted, relations: &[Relation], budget: Budget) -> Result<(), LimitError> {
        for stratum in 0..=lifted.strata.iter().copied().max().unwrap_or(0) {
            while self.settle_stratum(lifted, relations, stratum, budget)? {}
        }
        Ok(())
    }

    /// One look at each axiom of the stratum; true if it has to be looked at again.
    fn settle_stratum(
        &mut self,
        lifted: &Lifted,
        relations: &[Relation],
        stratum: usize,
        budget: Budget,
    ) -> Result<bool, LimitError> {
        let mut supported: Vec<Vec<bool>> = self.status.iter().map(|rows| vec![false; rows.len()]).collect();
        let mut is_changed = false;
        for axiom in lifted.axioms.iter().filter(|axiom| lifted.strata[axiom.head.relation] == stratum) {
            let predicate = axiom.head.relation;
            let (watch, bytes) = budget;
            for binding in rows_of(&relations[axiom.relation].tuples) {
                let Some(row) = relations[predicate].tuples.find(binding) else { continue };
                let simplifier = Simplifier { relations, status: &self.status, watch, bytes };
                let body = simplifier.conjunction(&axiom.condition, &mut Frame::new(binding))?;
                supported[predicate][row] |= body.is_some();
                let holds = body.is_some_and(|body| body.is_empty());
                if holds && self.status[predicate][row] != Status::True {
                    self.status[predicate][row] = Status::True;
                    is_changed = true;
                }
            }
        }
        for axiom in lifted.axioms.iter().filter(|axiom| lifted.strata[axiom.head.relation] == stratum) {
            let predicate = axiom.head.relation;
            for (status, _) in self.status[predicate].iter_mut().zip(&supported[predicate]).filter(|(_, is)| !**is) {
                is_changed |= *status != Status::False;
                *status = Status::False;
            }
        }
        Ok(is_changed)
    }

    /// The facts that hold in every state, of the predicates that are not derived; ascending.
    pub fn constant(&self, domain: &Domain, relations: &[Relation]) -> Vec<Fact> {
        let mut constant = Vec::new();
        for (predicate, status) in self.status.iter().enumerate().filter(|&(p, _)| !domain.predicates[p].derived) {
            let rows = (0..status.len()).filter(|&row| status[row] == Status::True);
            constant.extend(rows.map(|row| fact(predicate, relations[predicate].tuples.row(row))));
        }
        constant.sort_unstable();
        constant
    }
}

/// All rows of a table.
fn rows_of(table: &TupleSet) -> impl Iterator<Item = &[u32]> {
    (0..table.len()).map(|row| table.row(row))
}

fn fact(predicate: usize, row: &[u32]) -> Fact {
    Fact { predicate: PredicateId::from(predicate), args: row.iter().map(|&object| ObjectId(object)).collect() }
}

/// Whether two atoms are the same under the binding.
fn is_same(left: &Pattern, right: &Pattern, binding: &[u32]) -> bool {
    let same =
        |(left, right): (&super::normal::Slot, &super::normal::Slot)| left.value(binding) == right.value(binding);
    left.relation == right.relation && left.slots.iter().zip(&right.slots).all(same)
}
