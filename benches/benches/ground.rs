//! Parsing and grounding, from text to task.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use strips_bench::{Pddl, grounding_suite};
use strips_core::pddl::ast::{Domain, Problem};
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, ground};

fn parse(task: &Pddl) -> (Domain, Problem) {
    let source = Source::new("domain.pddl", task.domain.as_str());
    let domain = parse_domain(&source).expect("generated domains are right");
    let problem = parse_problem(&Source::new("problem.pddl", task.problem.as_str()), &domain, Some(&source))
        .expect("generated problems are right");
    (domain, problem)
}

fn parsing(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("parse");
    for task in grounding_suite() {
        group.throughput(Throughput::Bytes((task.domain.len() + task.problem.len()) as u64));
        group.bench_with_input(BenchmarkId::from_parameter(&task.name), &task, |bencher, task| {
            bencher.iter(|| black_box(parse(task)));
        });
    }
    group.finish();
}

fn grounding(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ground");
    group.sample_size(10).measurement_time(Duration::from_secs(5));
    for task in grounding_suite() {
        let (domain, problem) = parse(&task);
        let (domain, problem) = (Arc::new(domain), Arc::new(problem));
        let run = || ground(domain.clone(), problem.clone(), &Limits::default()).expect("within limits");
        group.throughput(Throughput::Elements(run().operators.len() as u64));
        group.bench_function(BenchmarkId::from_parameter(&task.name), |bencher| bencher.iter(|| black_box(run())));
    }
    group.finish();
}

criterion_group!(benches, parsing, grounding);
criterion_main!(benches);
