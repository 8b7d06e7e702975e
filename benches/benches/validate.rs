//! Validation of many plans of one task: as text, as operator ids, right ones and wrong ones.

use std::fmt::Write;
use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use strips_bench::classics::gripper;
use strips_core::random::Random;
use strips_core::search::{PlanSet, Semantics};
use strips_core::task::{Limits, OperatorId, Task};
use strips_core::validate::{Validator, validate};

/// Plans a batch.
const PLANS: usize = 20_000;

fn texts(task: &Task, operators: &[u32], offsets: &[u64]) -> Vec<String> {
    let line = |text: &mut String, id: &u32| {
        let _ = writeln!(text, "{}", task.operator_name(OperatorId(*id)));
    };
    let plan = |bounds: &[u64]| {
        let mut text = String::new();
        operators[bounds[0] as usize..bounds[1] as usize].iter().for_each(|id| line(&mut text, id));
        text
    };
    offsets.windows(2).map(plan).collect()
}

/// Each plan with two of its lines swapped.
fn swapped(texts: &[String]) -> Vec<String> {
    let mut random = Random::new(1, 0);
    let swap = |text: &String| {
        let mut lines: Vec<&str> = text.lines().collect();
        let (a, b) = (random.below(lines.len()), random.below(lines.len()));
        lines.swap(a, b);
        lines.join("\n")
    };
    texts.iter().map(swap).collect()
}

fn bench(criterion: &mut Criterion) {
    let task = gripper(4).grounded();
    let plans = PlanSet::new(task.clone(), 11, Semantics::FirstGoal, &Limits::default()).expect("a small set");
    let drawn = plans.sample(PLANS, 1, true, &Limits::default()).expect("there are plans");
    let offsets: Vec<i64> = drawn.offsets.iter().map(|&offset| offset.cast_signed()).collect();
    let right = texts(&task, &drawn.operators, &drawn.offsets);
    let wrong = swapped(&right);
    let validator = Validator::new(task.clone());
    let mut group = criterion.benchmark_group("validate");
    group.throughput(Throughput::Elements(PLANS as u64)).sample_size(20);
    group.bench_function("operators", |b| {
        b.iter(|| validator.outcomes_of_operators(black_box(&drawn.operators), &offsets, &Limits::default()));
    });
    for (name, texts) in [("right", &right), ("two lines swapped", &wrong)] {
        group.bench_with_input(BenchmarkId::new("texts", name), texts, |b, texts| {
            b.iter(|| validator.validate_many(black_box(texts), &Limits::default()));
        });
    }
    group.throughput(Throughput::Elements(1));
    group.bench_function("one text, nothing prepared", |b| b.iter(|| validate(&task, black_box(&right[0]))));
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
