//! An admissible bound on the steps to the goal, cheap enough for every state that search meets.
//!
//! Counts the goal's literals that are false and divides by the most that one operator can make true. With no steps
//! left the goal itself must hold. Derived facts are not counted, as one step can change any number of them.

use super::condition::{Change, Masks, changes, position};
use crate::task::{GroundCondition, Operator, Task};

/// Tells states that cannot reach the goal in the remaining steps, not all of them.
#[derive(Clone, Debug)]
pub(super) struct GoalBound {
    goal: Masks,
    /// For each word the goal reads: the facts to have and the facts to be rid of.
    wanted: Vec<(usize, u64, u64)>,
    most: u32,
}

impl GoalBound {
    /// Compiles the goal; linear in the operators.
    pub fn new(task: &Task) -> Self {
        let wanted = wanted_bits(task);
        let most = task.operators.iter().map(|operator| achieves(operator, &wanted)).max().unwrap_or(0);
        Self { goal: Masks::new(&task.goal), wanted, most: most.max(1) }
    }

    /// Whether the state satisfies the goal.
    #[inline]
    pub fn is_goal(&self, words: &[u64]) -> bool {
        self.goal.hold(words)
    }

    /// False only where no goal state can be reached in `remaining` steps.
    #[inline]
    pub fn within(&self, words: &[u64], remaining: usize) -> bool {
        if remaining == 0 {
            self.is_goal(words)
        } else {
            self.missing(words) as usize <= remaining * self.most as usize
        }
    }

    #[inline]
    fn missing(&self, words: &[u64]) -> u32 {
        let count =
            |&(word, have, lack): &(usize, u64, u64)| ((have & !words[word]) | (lack & words[word])).count_ones();
        self.wanted.iter().map(count).sum()
    }
}

/// The goal's literals over basic facts.
fn wanted_bits(task: &Task) -> Vec<(usize, u64, u64)> {
    let basic = |facts: &[crate::task::FactId]| {
        facts.iter().copied().filter(|fact| !task.axioms.derived.contains(fact)).collect::<Vec<_>>()
    };
    let goal = GroundCondition {
        positive: basic(&task.goal.positive),
        negative: basic(&task.goal.negative),
        clauses: Vec::new(),
    };
    let mut wanted = vec![(0, 0); super::successor_generator::words_for(task.facts.len())];
    goal.positive.iter().map(|&fact| position(fact)).for_each(|(word, bit)| wanted[word as usize].0 |= bit);
    goal.negative.iter().map(|&fact| position(fact)).for_each(|(word, bit)| wanted[word as usize].1 |= bit);
    let used = |(word, (have, lack))| ((have | lack) != 0).then_some((word, have, lack));
    wanted.into_iter().enumerate().filter_map(used).collect()
}

/// How many of the goal's literals the operator can make true at most.
fn achieves(operator: &Operator, wanted: &[(usize, u64, u64)]) -> u32 {
    let all: Vec<Change> = changes(operator.effects.iter());
    let gain = |&(word, have, lack): &(usize, u64, u64)| {
        let change = all.iter().find(|change| change.word as usize == word);
        change.map_or(0, |change| (change.add & have | change.delete & lack).count_ones())
    };
    wanted.iter().map(gain).sum()
}
