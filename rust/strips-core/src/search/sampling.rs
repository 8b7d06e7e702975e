//! Uniform draws from a plan set.

use std::collections::hash_map::Entry;

use num_bigint::BigUint;
use num_traits::{ToPrimitive, Zero};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::plan::Plans;
use super::plan_set::PlanSet;
use crate::random::Random;
use crate::task::{LimitError, Limits};

/// Why plans could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SampleError {
    /// There are fewer plans than distinct draws asked for, or none at all.
    #[error("{wanted} plans wanted of a set of {plans}")]
    TooFew {
        /// Draws asked for.
        wanted: usize,
        /// Plans in the set.
        plans: BigUint,
    },
    /// A budget was spent.
    #[error(transparent)]
    Limit(#[from] LimitError),
}

impl PlanSet {
    /// Draws `wanted` plans, each equally likely and independent; or, without `replace`, each such selection, in each
    /// order, equally likely. The same seed gives the same plans, on any number of threads.
    ///
    /// # Errors
    /// When the set is empty, or without `replace` too small, and when a budget of `limits` is spent.
    pub fn sample(&self, wanted: usize, seed: u64, replace: bool, limits: &Limits) -> Result<Plans, SampleError> {
        let (watch, plans) = (limits.start(), self.count());
        if wanted > 0 && plans.is_zero() || !replace && plans < BigUint::from(wanted) {
            return Err(SampleError::TooFew { wanted, plans });
        }
        watch.bytes(wanted.saturating_mul(8 + 4 * self.horizon()))?;
        let mut random = Random::new(seed, 0).fork("plans");
        let mut ranks = Vec::with_capacity(wanted);
        let mut moved = FxHashMap::default();
        for draw in 0..wanted {
            if draw % 4096 == 0 {
                watch.check()?;
            }
            ranks.push(if replace { below(&mut random, &plans) } else { deal(&mut random, &plans, draw, &mut moved) });
        }
        Ok(self.plans_checked(&ranks, &|| watch.check())?)
    }

    /// The plans with these ranks, in their order, in parallel.
    ///
    /// # Errors
    /// When the arrays would hold more bytes than `limits` allow, or the work is interrupted.
    ///
    /// # Panics
    /// When a rank is not below the count.
    pub fn plans_at(&self, ranks: &[BigUint], limits: &Limits) -> Result<Plans, LimitError> {
        let watch = limits.start();
        watch.bytes(ranks.len().saturating_mul(8 + 4 * self.horizon()))?;
        self.plans_checked(ranks, &|| watch.check())
    }

    fn plans_checked(
        &self,
        ranks: &[BigUint],
        check: &(impl Fn() -> Result<(), LimitError> + Sync),
    ) -> Result<Plans, LimitError> {
        let some = |ranks: &[BigUint]| {
            check()?;
            let plan = |rank: &BigUint| self.unrank(rank).expect("ranks are below the count");
            Ok(ranks.iter().map(plan).collect())
        };
        let drawn: Vec<Vec<_>> = ranks.par_chunks(1024).map(some).collect::<Result<_, LimitError>>()?;
        let mut plans = Plans { operators: Vec::new(), offsets: vec![0] };
        for plan in drawn.into_iter().flatten() {
            plans.operators.extend(plan.0.iter().map(|operator| operator.0));
            plans.offsets.push(plans.operators.len() as u64);
        }
        Ok(plans)
    }
}

/// A number below `bound`, without big numbers where it is small.
fn below(random: &mut Random, bound: &BigUint) -> BigUint {
    match bound.to_usize() {
        Some(bound) => BigUint::from(random.below(bound)),
        None => random.below_big(bound),
    }
}

/// The next card of a shuffled deck of which only the cards that moved are kept (Fisher and Yates).
fn deal(random: &mut Random, plans: &BigUint, draw: usize, moved: &mut FxHashMap<BigUint, BigUint>) -> BigUint {
    let draw = BigUint::from(draw);
    let chosen = &draw + below(random, &(plans - &draw));
    let top = moved.remove(&draw).unwrap_or_else(|| draw.clone());
    if chosen == draw {
        return top;
    }
    match moved.entry(chosen) {
        Entry::Occupied(mut card) => card.insert(top),
        Entry::Vacant(card) => {
            let untouched = card.key().clone();
            card.insert(top);
            untouched
        }
    }
}
