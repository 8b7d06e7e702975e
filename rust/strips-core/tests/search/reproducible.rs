//! Drawing is uniform, budgets end the work, and nothing depends on the number of threads.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use num_bigint::BigUint;
use num_traits::Zero;
use strips_core::search::{PlanSet, Reach, SampleError, Semantics, StateId, StateSpace};
use strips_core::task::{LimitError, Limits, State, Task};

use crate::laws::{ALL, plan_set};
use crate::random_task::switches;

/// Runs the same thing on pools of several sizes and expects the same result from each.
fn same_on_any_pool<T: PartialEq + std::fmt::Debug + Send>(work: impl Fn() -> T + Sync) -> T {
    let mut results = [1, 2, 8].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(&work)
    });
    assert_eq!(results[0], results[1]);
    assert_eq!(results[0], results[2]);
    std::mem::replace(&mut results[0], work())
}

/// Every reachable state in the order in which one thread with a queue finds it.
fn queue_order(task: &Task) -> Vec<State> {
    let (mut found, mut known) = (vec![task.init.clone()], HashMap::from([(task.init.clone(), 0)]));
    let mut at = 0;
    while at < found.len() {
        let state = found[at].clone();
        for operator in task.operators.iter().filter(|operator| operator.applicable(&state)) {
            let next = task.apply(operator, &state);
            if known.insert(next.clone(), at).is_none() {
                found.push(next);
            }
        }
        at += 1;
    }
    found
}

#[test]
fn states_are_numbered_as_one_thread_with_a_queue_would() {
    for spread in [1, 20] {
        let task = switches(13, spread);
        let expected = queue_order(&task);
        let numbered = same_on_any_pool(|| {
            let space = StateSpace::explore(&task, Reach::default(), &Limits::default()).expect("within limits");
            (0..space.len()).map(|number| space.state(StateId::from(number))).collect::<Vec<_>>()
        });
        assert_eq!(numbered, expected);
    }
}

#[test]
fn plans_and_draws_are_the_same_on_any_number_of_threads() {
    let task = switches(13, 1);
    for semantics in ALL {
        let (counts, drawn, listed) = same_on_any_pool(|| {
            let set = plan_set(&task, 13, semantics);
            let drawn = set.sample(3000, 7, true, &Limits::default()).expect("not empty");
            let some = BigUint::from(100_000u32)..BigUint::from(300_000u32);
            (set.counts().to_vec(), drawn, set.plans_flat(some, &Limits::default()).expect("within limits"))
        });
        assert_eq!((drawn.len(), listed.len()), (3000, 200_000));
        assert!(counts[13] > counts[6]);
    }
}

#[test]
fn draws_are_uniform() {
    let set = plan_set(&switches(4, 1), 6, Semantics::Any);
    let plans = usize::try_from(&set.count()).expect("a few hundred");
    let draws = set.sample(plans * 200, 11, true, &Limits::default()).expect("not empty");
    let mut seen = vec![0f64; plans];
    for plan in draws.iter() {
        seen[usize::try_from(set.rank(&plan).expect("in the set")).expect("small")] += 1.0;
    }
    let chi_squared: f64 = seen.iter().map(|count| (count - 200.0).powi(2) / 200.0).sum();
    let spread = (2.0 * plans as f64).sqrt();
    assert!((chi_squared - plans as f64).abs() < 5.0 * spread, "{chi_squared} for {plans} plans");
}

#[test]
fn draws_without_replacement_are_distinct_and_reach_everything() {
    let set = plan_set(&switches(4, 1), 6, Semantics::Any);
    let plans = usize::try_from(&set.count()).expect("a few hundred");
    let all = set.sample(plans, 3, false, &Limits::default()).expect("as many as there are");
    let mut ranks: Vec<BigUint> = all.iter().map(|plan| set.rank(&plan).expect("in the set")).collect();
    assert!(ranks.windows(2).any(|pair| pair[0] > pair[1]), "in random order");
    ranks.sort();
    assert!(ranks.iter().enumerate().all(|(rank, drawn)| *drawn == BigUint::from(rank)));
    let more = set.sample(plans + 1, 3, false, &Limits::default());
    assert_eq!(more, Err(SampleError::TooFew { wanted: plans + 1, plans: set.count() }));
}

#[test]
fn counts_beyond_any_machine_word_are_exact() {
    // Two switches, four operators, all always applicable: every walk of n steps is one of 2^n on each, as off and on
    // never exclude each other. A walk ends with both on in exactly a known share of 4^n ways.
    let set = plan_set(&switches(2, 1), 100, Semantics::Any);
    let rank = set.count() - 1u32;
    let plan = set.unrank(&rank).expect("the last plan");
    assert_eq!(set.rank(&plan), Some(rank));
    assert!(set.count().bits() > 128);
    assert!((set.entropy() - set.count().bits() as f64 * std::f64::consts::LN_2).abs() < 1.0);
    let beyond = set.count() - 5u32..set.count() + 5u32;
    assert_eq!(set.plans_flat(beyond, &Limits::default()).expect("five plans").len(), 5);
}

#[test]
fn the_empty_plan_is_the_only_first_goal_plan_where_the_goal_holds_at_the_start() {
    let mut task = Task::clone(&switches(3, 1));
    task.goal = strips_core::task::GroundCondition::default();
    let task = Arc::new(task);
    for semantics in ALL {
        let set = plan_set(&task, 2, semantics);
        assert_eq!(set.counts()[0], BigUint::from(1u32));
        assert_eq!(set.counts()[1].is_zero(), semantics != Semantics::Any);
        let first = set.text(BigUint::zero()..BigUint::from(1u32), &Limits::default()).expect("one plan");
        assert_eq!(first, "; empty plan\n");
    }
}

#[test]
fn spent_budgets_end_the_work() {
    let task = switches(16, 1);
    let build = |limits: &Limits| PlanSet::new(task.clone(), 40, Semantics::Any, limits).map(|_| ());
    let states = Limits { states: 1000, ..Limits::default() };
    assert_eq!(build(&states), Err(LimitError::States { limit: 1000 }));
    let bytes = Limits { bytes: 100_000, ..Limits::default() };
    assert_eq!(build(&bytes), Err(LimitError::Bytes { limit: 100_000 }));
    let time = Limits { time: Some(Duration::from_millis(1)), ..Limits::default() };
    assert_eq!(build(&time), Err(LimitError::Time { limit: Duration::from_millis(1) }));
    let interrupt = Limits { interrupt: Some(Arc::new(AtomicBool::new(true))), ..Limits::default() };
    assert_eq!(build(&interrupt), Err(LimitError::Interrupted));
}
