//! What operators cost.

use rustc_hash::FxHashMap;

use super::normal::Slot;
use super::universe::Universe;
use crate::pddl::ast::{Cost, Domain, Effect, ObjectId, Problem, Term};

/// The costs of all operators. Increases under a condition are no part of it, as they differ from state to state.
pub(super) struct Costs<'a> {
    domain: &'a Domain,
    universe: Universe<'a>,
    values: FxHashMap<(usize, Vec<ObjectId>), f64>,
}

impl<'a> Costs<'a> {
    pub fn new(domain: &'a Domain, problem: &'a Problem) -> Self {
        let values = problem.costs.iter().map(|(function, args, value)| ((*function, args.clone()), *value)).collect();
        Self { domain, universe: Universe::new(domain, problem), values }
    }

    /// The cost of an operator: the sum of its increases, or 1 where the domain knows no costs. A function without a
    /// value counts as 0.
    pub fn of(&self, action: usize, args: &[u32]) -> f64 {
        if self.domain.has_total_cost { self.sum(&self.domain.actions[action].effect, &mut args.to_vec()) } else { 1.0 }
    }

    fn sum(&self, effect: &Effect, binding: &mut Vec<u32>) -> f64 {
        match effect {
            Effect::And(parts) => parts.iter().map(|part| self.sum(part, binding)).sum(),
            Effect::Forall(parameters, inner) if raises_cost(inner) => {
                let ranges = self.universe.scope(parameters);
                let mut bindings = vec![binding.clone()];
                for range in ranges {
                    let extended = |known: &Vec<u32>| {
                        range.list.iter().map(|&object| [known.as_slice(), &[object]].concat()).collect::<Vec<_>>()
                    };
                    bindings = bindings.iter().flat_map(extended).collect();
                }
                bindings.iter_mut().map(|binding| self.sum(inner, binding)).sum()
            }
            Effect::IncreaseCost(Cost::Number(number)) => *number,
            Effect::IncreaseCost(Cost::Function(function, terms)) => self.value(*function, terms, binding),
            Effect::Add(_) | Effect::Delete(_) | Effect::When(..) | Effect::Forall(..) => 0.0,
        }
    }

    fn value(&self, function: usize, terms: &[Term], binding: &[u32]) -> f64 {
        let args = terms.iter().map(|&term| ObjectId(Slot::new(term).value(binding))).collect();
        self.values.get(&(function, args)).copied().unwrap_or(0.0)
    }
}

/// Whether there is an unconditional increase in the effect.
fn raises_cost(effect: &Effect) -> bool {
    match effect {
        Effect::And(parts) => parts.iter().any(raises_cost),
        Effect::Forall(_, inner) => raises_cost(inner),
        Effect::IncreaseCost(_) => true,
        Effect::Add(_) | Effect::Delete(_) | Effect::When(..) => false,
    }
}
