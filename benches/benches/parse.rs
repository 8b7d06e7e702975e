//! Reading PDDL: problems of growing size (time must grow no faster), and a million parentheses (refused at once).

use std::fmt::Write;
use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use strips_core::pddl::{Source, parse_domain, parse_problem};

const DOMAIN: &str = "(define (domain roads) (:types place) (:predicates (road ?a ?b - place) (at ?a - place)))";

/// A problem of about so many megabytes.
fn problem(megabytes: usize) -> String {
    let places = 20_000;
    let mut text = String::from("(define (problem big) (:domain roads) (:objects");
    (0..places).for_each(|place| write!(text, " place-{place}").expect("a string takes all"));
    text.push_str(" - place)\n(:init\n");
    let mut road = 0usize;
    while text.len() < megabytes << 20 {
        let (from, to) = (road % places, (road / places + road) % places);
        let _ = writeln!(text, "  (road place-{from} place-{to})");
        road += 1;
    }
    text.push_str(")\n(:goal (at place-7)))\n");
    text
}

fn bench(criterion: &mut Criterion) {
    let domain = parse_domain(&Source::new("domain", DOMAIN)).expect("the domain is right");
    let mut group = criterion.benchmark_group("parse");
    group.sample_size(10);
    for megabytes in [1, 10, 50] {
        let source = Source::new("problem", problem(megabytes));
        group.throughput(Throughput::Bytes(source.text().len() as u64));
        group.bench_with_input(BenchmarkId::new("problem of megabytes", megabytes), &source, |b, source| {
            b.iter(|| parse_problem(black_box(source), &domain, None).expect("the problem is right"));
        });
    }
    let nested = Source::new("nested", "(".repeat(1_000_000));
    group.throughput(Throughput::Bytes(1_000_000));
    group.bench_function("a million parentheses", |b| {
        b.iter(|| parse_domain(black_box(&nested)).expect_err("it is too deep"));
    });
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
