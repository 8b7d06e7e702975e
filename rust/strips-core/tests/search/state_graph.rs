//! The spelled-out state graph holds the plans of the set, and nothing else.

use num_bigint::BigUint;
use proptest::prelude::*;
use strips_core::search::{Semantics, StateGraph};
use strips_core::task::Limits;

use crate::laws::plan_set;
use crate::random_task::random_task;

/// Walks of at most `steps` steps from `state` to a goal.
fn walks(graph: &StateGraph, state: usize, steps: usize) -> BigUint {
    if graph.goals[state] {
        return BigUint::from(1u8);
    }
    if steps == 0 {
        return BigUint::default();
    }
    graph.edges.iter().filter(|edge| edge.0 == state).map(|edge| walks(graph, edge.1, steps - 1)).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn walks_to_the_goal_are_the_plans(task in random_task(), horizon in 0usize..=4) {
        let graph = StateGraph::new(&task, horizon, &Limits::default()).expect("the task is small");
        let plans = plan_set(&task, horizon, Semantics::FirstGoal).count();
        if graph.states.is_empty() {
            prop_assert_eq!(plans, BigUint::default());
        } else {
            prop_assert_eq!(graph.depths[0], 0);
            prop_assert_eq!(walks(&graph, 0, horizon), plans);
        }
    }
}
