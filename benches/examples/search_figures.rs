//! The figures of search in one run, for reading rather than for statistics:
//! `cargo run --release -p strips-bench --example search_figures [WORD]` (only the lines that hold the word).
//!
//! Beside the time on the clock it prints the time that its threads had a processor, where Linux tells it: on a busy
//! machine only the second says something.

use std::time::Instant;

use num_bigint::BigUint;
use strips_bench::classics::{blocksworld, evening, gripper};
use strips_bench::processor_seconds;
use strips_core::search::{PlanSet, Reach, Semantics, StateSpace, shortest_plan};
use strips_core::task::Limits;

/// Runs `work` five times and prints the best.
fn best<T>(what: &str, unit: &str, mut work: impl FnMut() -> (T, usize)) {
    if std::env::args().nth(1).is_some_and(|word| !what.contains(&word)) {
        return;
    }
    let (mut shortest, mut least, mut items) = (f64::INFINITY, f64::INFINITY, 0);
    for _ in 0..5 {
        let (start, processor) = (Instant::now(), processor_seconds());
        let (value, count) = work();
        shortest = shortest.min(start.elapsed().as_secs_f64());
        least = least.min(processor_seconds() - processor);
        items = count;
        drop(value);
    }
    let rate = |seconds: f64| items as f64 / seconds / 1e6;
    println!("{what:42} {items:>11} {unit:7} {:>9.2} ms {:>8.2} M/s", shortest * 1e3, rate(shortest));
    println!("{:62} {:>9.2} ms {:>8.2} M/s of processor time", "", least * 1e3, rate(least));
}

fn main() {
    let limits = Limits::default();
    // Kept alive, as the processor time of threads that ended is lost.
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
    let pools = [1, 2].map(|threads| (threads, pool(threads)));
    for (name, task) in [
        ("blocksworld-8", blocksworld(8).grounded()),
        ("gripper-8", gripper(8).grounded()),
        ("gripper-12", gripper(12).grounded()),
    ] {
        println!("{name}: {} facts, {} operators", task.facts.len(), task.operators.len());
        for (threads, pool) in &pools {
            let explore = || StateSpace::reachable(&task, Reach::default(), &limits).expect("within limits");
            best(&format!("{name}, breadth first, {threads} threads"), "states", || {
                let space = pool.install(explore);
                let states = space.len();
                (space, states)
            });
        }
        let space = StateSpace::explore(&task, Reach::default(), &limits).expect("within limits");
        println!("  {:.1} bytes a state beside the state", space.bytes_beside_states() as f64 / space.len() as f64);
        best(&format!("{name}, with distances"), "states", || {
            let space = StateSpace::explore(&task, Reach::default(), &limits).expect("within limits");
            let states = space.len();
            (space, states)
        });
        best(&format!("{name}, first plan"), "steps", || {
            let plan = shortest_plan(&task, None, &limits).expect("within limits").expect("solvable");
            let steps = plan.len();
            (plan, steps)
        });
    }
    for (name, task, horizon) in
        [("blocksworld-4", blocksworld(4).grounded(), 7), ("gripper-2", gripper(2).grounded(), 7)]
    {
        best(&format!("{name}, T = {horizon}, building"), "sets", || {
            let build = |_| PlanSet::new(task.clone(), horizon, Semantics::FirstGoal, &limits).expect("within limits");
            ((0..1000).map(build).map(|set| set.counts().len()).sum::<usize>(), 1000)
        });
    }
    let task = evening().grounded();
    best("evening, count of 858,375,000 at T = 8", "plans", || {
        let set = PlanSet::new(task.clone(), 8, Semantics::Any, &limits).expect("within limits");
        assert_eq!(set.count(), BigUint::from(858_375_000u32));
        (set, 858_375_000)
    });
    for semantics in [Semantics::FirstGoal, Semantics::Simple] {
        best(&format!("gripper-4, T = 13, {}", semantics.name()), "plans", || {
            let set = PlanSet::new(gripper(4).grounded(), 13, semantics, &limits).expect("within limits");
            let plans = set.plans_flat(BigUint::default()..set.count(), &limits).expect("within limits");
            let count = plans.len();
            (plans, count)
        });
    }
    let set = PlanSet::new(gripper(8).grounded(), 23, Semantics::FirstGoal, &limits).expect("within limits");
    println!("gripper-8, T = 23: {} plans", set.count());
    let some = BigUint::default()..BigUint::from(10_000_000u32);
    best("gripper-8, T = 23, listing", "plans", || {
        let plans = set.plans_flat(some.clone(), &limits).expect("within limits");
        let count = plans.len();
        (plans, count)
    });
    let set = PlanSet::new(evening().grounded(), 8, Semantics::FirstGoal, &limits).expect("within limits");
    best("evening, T = 8, listing", "plans", || {
        let plans = set.plans_flat(some.clone(), &limits).expect("within limits");
        let count = plans.len();
        (plans, count)
    });
    best("evening, T = 8, as text", "plans", || {
        let text = set.text(BigUint::default()..BigUint::from(2_000_000u32), &limits).expect("within limits");
        (text, 2_000_000)
    });
    best("evening, T = 8, one by one", "plans", || {
        let steps: usize = set.iter().take(1_000_000).map(|plan| plan.len()).sum();
        (steps, 1_000_000)
    });
    best("evening, T = 8, draws", "plans", || (set.sample(1_000_000, 1, true, &limits).expect("not empty"), 1_000_000));
}
