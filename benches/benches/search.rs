//! Search: breadth-first states, counting, listing and drawing plans; `cargo bench -p strips-bench --bench search`.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use num_bigint::BigUint;
use rayon::{ThreadPool, ThreadPoolBuilder};
use strips_bench::classics::{blocksworld, evening, gripper};
use strips_core::search::{PlanSet, Reach, Semantics, StateSpace, shortest_plan};
use strips_core::task::Limits;

fn pool(threads: usize) -> ThreadPool {
    ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start")
}

/// All reachable states, on one thread and on two.
fn breadth_first(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("breadth first");
    for (name, task) in [
        ("blocksworld-8", blocksworld(8).grounded()),
        ("gripper-8", gripper(8).grounded()),
        ("gripper-12", gripper(12).grounded()),
    ] {
        let explore = || StateSpace::reachable(&task, Reach::default(), &Limits::default()).expect("within limits");
        group.throughput(Throughput::Elements(explore().len() as u64));
        for threads in [1, 2] {
            let pool = pool(threads);
            group.bench_function(format!("{name}/{threads} threads"), |bencher| {
                bencher.iter(|| pool.install(|| black_box(explore()).len()));
            });
        }
    }
    group.finish();
}

/// The first plan of a problem, without a plan set.
fn first_plan(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("first plan");
    for (name, task) in [("blocksworld-8", blocksworld(8).grounded()), ("gripper-12", gripper(12).grounded())] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| shortest_plan(&task, None, &Limits::default()).expect("within limits"));
        });
    }
    group.finish();
}

/// From a grounded task to exact counts.
fn counting(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("counting");
    let cases = [
        ("evening, T = 8, 858375000 plans", evening().grounded(), 8, Semantics::Any),
        ("evening, T = 8, simple", evening().grounded(), 8, Semantics::Simple),
        ("gripper-4, T = 30", gripper(4).grounded(), 30, Semantics::Any),
        ("blocksworld-4, T = 7", blocksworld(4).grounded(), 7, Semantics::FirstGoal),
    ];
    for (name, task, horizon, semantics) in cases {
        let build = || PlanSet::new(task.clone(), horizon, semantics, &Limits::default()).expect("within limits");
        group.bench_function(name, |bencher| bencher.iter(|| build().count()));
    }
    group.finish();
}

/// Listing a million plans as ids, as text and one by one, and drawing some.
fn plans(criterion: &mut Criterion) {
    const PLANS: u64 = 1_000_000;
    let limits = Limits::default();
    let mut group = criterion.benchmark_group("plans");
    for (name, task, horizon) in
        [("evening, T = 8", evening().grounded(), 8), ("gripper-8, T = 23", gripper(8).grounded(), 23)]
    {
        let set = PlanSet::new(task, horizon, Semantics::FirstGoal, &limits).expect("within limits");
        let all = || BigUint::default()..BigUint::from(PLANS);
        group.throughput(Throughput::Elements(PLANS));
        for threads in [1, 2] {
            let pool = pool(threads);
            group.bench_function(format!("{name}/ids, {threads} threads"), |bencher| {
                bencher.iter(|| pool.install(|| set.plans_flat(all(), &limits).expect("within limits")));
            });
        }
        group.bench_function(format!("{name}/text"), |bencher| bencher.iter(|| set.text(all(), &limits)));
        group.bench_function(format!("{name}/one by one"), |bencher| {
            bencher.iter(|| set.iter().take(PLANS as usize).map(|plan| plan.len()).sum::<usize>());
        });
        group.throughput(Throughput::Elements(100_000));
        group.bench_function(format!("{name}/draws"), |bencher| bencher.iter(|| set.sample(100_000, 1, true, &limits)));
    }
    group.finish();
}

fn config() -> Criterion {
    Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(2))
}

criterion_group! { name = benches; config = config(); targets = breadth_first, first_plan, counting, plans }
criterion_main!(benches);
