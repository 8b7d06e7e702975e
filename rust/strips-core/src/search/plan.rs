//! Plans, one by one and many at once.

use crate::task::OperatorId;

/// A sequence of operators.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Plan(pub Vec<OperatorId>);

impl Plan {
    /// How many steps it has.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether it has no step.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The plan with these operator numbers.
    pub(super) fn from_numbers(operators: &[u32]) -> Self {
        Self(operators.iter().map(|&operator| OperatorId(operator)).collect())
    }
}

/// Many plans in two flat arrays: plan `i` is `operators[offsets[i]..offsets[i + 1]]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plans {
    /// Operator ids, plan after plan.
    pub operators: Vec<u32>,
    /// Where each plan begins, and where the last one ends: one more than there are plans.
    pub offsets: Vec<u64>,
}

impl Plans {
    /// How many plans there are.
    pub fn len(&self) -> usize {
        self.offsets.len() - 1
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One plan's operator ids.
    ///
    /// # Panics
    /// When there are not as many plans.
    pub fn operators_of(&self, plan: usize) -> &[u32] {
        &self.operators[self.offsets[plan] as usize..self.offsets[plan + 1] as usize]
    }

    /// The plans one by one.
    pub fn iter(&self) -> impl Iterator<Item = Plan> + '_ {
        (0..self.len()).map(|plan| Plan::from_numbers(self.operators_of(plan)))
    }
}
