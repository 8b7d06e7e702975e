//! What holds for the plan set of every task.

use std::collections::BTreeMap;
use std::sync::Arc;

use num_bigint::BigUint;
use num_traits::{One, Zero};
use proptest::prelude::*;
use strips_core::search::{
    Plan, PlanSet, Reach, Semantics, StateSpace, SuccessorGenerator, TransitionSystem, shortest_plan,
};
use strips_core::task::{Limits, OperatorId, State, Task};

use crate::naive;
use crate::random_task::random_task;

pub const ALL: [Semantics; 3] = [Semantics::FirstGoal, Semantics::Any, Semantics::Simple];

/// As many tasks as `STRIPS_LM_TASKS` says.
pub fn config() -> ProptestConfig {
    let tasks = std::env::var("STRIPS_LM_TASKS").ok().and_then(|text| text.parse().ok()).unwrap_or(2000);
    ProptestConfig { cases: tasks, failure_persistence: None, ..ProptestConfig::default() }
}

pub fn plan_set(task: &Arc<Task>, horizon: usize, semantics: Semantics) -> PlanSet {
    PlanSet::new(task.clone(), horizon, semantics, &Limits::default()).expect("the task is small")
}

fn numbers(plan: &Plan) -> Vec<u32> {
    plan.0.iter().map(|operator| operator.0).collect()
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn the_plan_set_is_what_the_naive_enumerator_finds(task in random_task(), horizon in 0usize..=5) {
        for semantics in ALL {
            let Some(expected) = naive::plans(&task, horizon, semantics, 20_000) else { continue };
            let set = plan_set(&task, horizon, semantics);
            let listed: Vec<Vec<u32>> = set.iter().map(|plan| numbers(&plan)).collect();
            prop_assert_eq!(&listed, &expected, "{:?}", semantics);
            prop_assert_eq!(set.count(), BigUint::from(expected.len()));
            for (length, count) in set.counts().iter().enumerate() {
                let same = expected.iter().filter(|plan| plan.len() == length).count();
                prop_assert_eq!(count, &BigUint::from(same));
            }
            check_flat(&set, &expected)?;
            check_ranks(&set, &expected)?;
            check_distribution(&set, &expected)?;
            check_shortest(&task, &set, horizon, semantics)?;
        }
    }

    #[test]
    fn the_successor_generator_agrees_with_the_task(task in random_task(), bits in any::<u8>()) {
        let generator = SuccessorGenerator::new(&task);
        let mut state = State::empty(task.facts.len());
        for fact in 0..task.facts.len() {
            state.set(fact.into(), bits >> (fact % 7) & 1 == 1);
        }
        task.derive(&mut state);
        let slow: Vec<_> = (0..task.operators.len()).filter(|&n| task.operators[n].applicable(&state)).collect();
        let fast: Vec<_> = generator.applicable(&state).into_iter().map(OperatorId::index).collect();
        prop_assert_eq!(&fast, &slow);
        for number in slow {
            let next = task.apply(&task.operators[number], &state);
            prop_assert_eq!(generator.successor(&state, number.into()), next);
        }
    }

    #[test]
    fn distances_are_those_of_bellman_and_ford(task in random_task()) {
        let space = StateSpace::explore(&task, Reach::default(), &Limits::default()).expect("the task is small");
        let states: Vec<State> = (0..space.len()).map(|number| space.state(number.into())).collect();
        let mut distances: Vec<usize> =
            states.iter().map(|state| if task.goal.holds(state) { 0 } else { usize::MAX }).collect();
        for _ in &states {
            for (number, state) in states.iter().enumerate() {
                for operator in task.operators.iter().filter(|operator| operator.applicable(state)) {
                    let next = space.find(&task.apply(operator, state)).expect("reachable").index();
                    distances[number] = distances[number].min(distances[next].saturating_add(1));
                }
            }
        }
        let expected: Vec<_> = distances.into_iter().map(|d| (d != usize::MAX).then_some(d)).collect();
        let found: Vec<_> = (0..space.len()).map(|number| space.distance_to_goal(number.into())).collect();
        prop_assert_eq!(&found, &expected);
        check_batches(&task, &states, &expected)?;
    }
}

/// The states of a task in one batch, against the task itself.
fn check_batches(task: &Arc<Task>, states: &[State], distances: &[Option<usize>]) -> Result<(), TestCaseError> {
    let (system, limits) = (TransitionSystem::new(task.clone()), Limits::default());
    let width = system.width();
    let pack = |state: &State| [&state.0, &[0][..width - state.0.len()]].concat();
    let words: Vec<u64> = states.iter().flat_map(pack).collect();
    prop_assert_eq!(&system.init(), &words[..width]);
    for most in [None, Some(0), Some(2)] {
        let near: Vec<_> = distances.iter().map(|d| d.filter(|&d| most.is_none_or(|most| d <= most))).collect();
        prop_assert_eq!(system.distances_to_goal(&words, most, &limits), Ok(near));
    }
    let goals: Vec<bool> = states.iter().map(|state| task.goal.holds(state)).collect();
    prop_assert_eq!(system.are_goals(&words), Ok(goals));
    let all = system.applicable(&words, &limits).expect("within limits");
    let (mut from, mut operators, mut to) = (Vec::new(), Vec::new(), Vec::new());
    for (row, state) in states.iter().enumerate() {
        let slow = (0..task.operators.len()).filter(|&number| task.operators[number].applicable(state));
        let slow: Vec<u32> = slow.map(|number| number as u32).collect();
        prop_assert_eq!(&all.operators[all.offsets[row] as usize..all.offsets[row + 1] as usize], &slow);
        for operator in slow {
            from.extend(pack(state));
            operators.push(operator);
            to.extend(pack(&task.apply(&task.operators[operator as usize], state)));
        }
    }
    prop_assert_eq!(system.successors(&from, &operators, &limits), Ok(to));
    let names = system.atoms(&words, &limits).expect("within limits");
    for (names, state) in names.iter().zip(states) {
        prop_assert_eq!(system.state_of(names), Ok(pack(state)));
    }
    Ok(())
}

fn check_flat(set: &PlanSet, expected: &[Vec<u32>]) -> Result<(), TestCaseError> {
    let flat = set.plans_flat(BigUint::zero()..set.count(), &Limits::default()).expect("small");
    let rows: Vec<Vec<u32>> = flat.iter().map(|plan| numbers(&plan)).collect();
    prop_assert_eq!(&rows, expected);
    let (first, end) = (expected.len() / 3, expected.len() * 2 / 3);
    let flat = set.plans_flat(first.into()..end.into(), &Limits::default()).expect("small");
    prop_assert_eq!(flat.iter().map(|plan| numbers(&plan)).collect::<Vec<_>>(), &expected[first..end]);
    let text = set.text(BigUint::zero()..set.count(), &Limits::default()).expect("small");
    prop_assert_eq!(text.matches("\n\n").count(), expected.len().saturating_sub(1));
    Ok(())
}

fn check_ranks(set: &PlanSet, expected: &[Vec<u32>]) -> Result<(), TestCaseError> {
    for (rank, numbers) in expected.iter().enumerate().step_by(1 + expected.len() / 50) {
        let plan = set.unrank(&rank.into()).expect("below the count");
        prop_assert_eq!(plan.0.iter().map(|operator| operator.0).collect::<Vec<_>>(), numbers.clone());
        prop_assert_eq!(set.rank(&plan), Some(rank.into()));
        let end = naive::replay(set.task(), &plan.0);
        prop_assert!(end.is_some_and(|state| set.task().goal.holds(&state)));
    }
    prop_assert_eq!(set.unrank(&set.count()), None);
    Ok(())
}

fn check_distribution(set: &PlanSet, expected: &[Vec<u32>]) -> Result<(), TestCaseError> {
    let chosen = expected.get(expected.len() / 2).cloned().unwrap_or_default();
    for prefix in (0..=chosen.len()).map(|length| &chosen[..length]) {
        let mut next = BTreeMap::<Option<OperatorId>, BigUint>::new();
        for plan in expected.iter().filter(|plan| plan.starts_with(prefix)) {
            let operator = plan.get(prefix.len()).map(|&operator| OperatorId(operator));
            *next.entry(operator).or_default() += BigUint::one();
        }
        let prefix: Vec<OperatorId> = prefix.iter().map(|&operator| OperatorId(operator)).collect();
        prop_assert_eq!(set.next_operators(&prefix), next.into_iter().collect::<Vec<_>>());
    }
    Ok(())
}

fn check_shortest(task: &Task, set: &PlanSet, horizon: usize, semantics: Semantics) -> Result<(), TestCaseError> {
    prop_assert_eq!(set.shortest(), set.unrank(&BigUint::zero()));
    if semantics == Semantics::FirstGoal {
        let found = shortest_plan(task, Some(horizon), &Limits::default()).expect("small");
        prop_assert_eq!(found, set.shortest());
    }
    Ok(())
}
