//! What a greedy search finds is a plan, and it finds one wherever there is one; plans without detours are still plans.

use proptest::prelude::*;
use strips_core::search::{Reach, StateSpace, SuccessorGenerator, greedy_plan, without_detours};
use strips_core::task::{GroundCondition, Limits, OperatorId};

use crate::naive;
use crate::random_task::random_task;

/// More than any of the random tasks has states.
const ALL: usize = 1000;

proptest! {
    #![proptest_config(crate::laws::config())]

    #[test]
    fn a_greedy_search_finds_a_plan_exactly_where_there_is_one(task in random_task()) {
        let space = StateSpace::explore(&task, Reach::default(), &Limits::default()).expect("the task is small");
        let best = space.distance_to_goal(0.into());
        let found = greedy_plan(&task, &SuccessorGenerator::new(&task), &task.goal, ALL);
        prop_assert_eq!(found.is_some(), best.is_some());
        if let Some(plan) = found {
            prop_assert!(task.goal.holds(&naive::replay(&task, &plan).expect("every step applies")));
            prop_assert!(Some(plan.len()) >= best);
        }
    }

    #[test]
    fn a_plan_without_its_detours_is_a_plan_in_which_no_state_comes_twice(task in random_task(), walk in prop::collection::vec(any::<u8>(), 0..12)) {
        let (generator, mut state, mut plan) = (SuccessorGenerator::new(&task), task.init.clone(), Vec::new());
        for choice in walk {
            let applicable: Vec<OperatorId> = generator.applicable(&state);
            if applicable.is_empty() {
                break;
            }
            plan.push(applicable[usize::from(choice) % applicable.len()]);
            state = generator.successor(&state, plan[plan.len() - 1]);
        }
        let goal = if task.goal.holds(&state) { task.goal.clone() } else { GroundCondition::default() };
        let short = without_detours(&task, &generator, &goal, &plan);
        prop_assert!(short.len() <= plan.len());
        let states: Vec<_> = (0..=short.len()).map(|end| naive::replay(&task, &short[..end]).expect("every step applies")).collect();
        prop_assert!(goal.holds(&states[short.len()]));
        prop_assert!((0..states.len()).all(|at| !states[..at].contains(&states[at])));
        prop_assert_eq!(without_detours(&task, &generator, &goal, &short), short);
    }
}
