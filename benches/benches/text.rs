//! The text format, its canonical rewriting and constrained decoding, on records of the manipulation domain.
//!
//! Bytes are those of the text, whichever way it goes; 71,128 pairs are about 76 MB.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use rayon::prelude::*;
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::random::Random;
use strips_core::search::{PlanSet, Semantics, SuccessorGenerator};
use strips_core::task::{Fact, Limits, OperatorId, State, Task, ground};
use strips_core::text::automaton::{MaskedDecoder, SpokenTask};
use strips_core::text::canonical::{Codec, Hints, Layout, Rows, Synonyms};
use strips_core::text::{Goal, Naming, Style, parse_completions, render_record, split_text};

const DOMAIN: &str = include_str!("../../python/strips_lm/domains/manipulation/domain.pddl");

/// The problem of the report's Figure 4.
const PROBLEM: &str = "(define (problem brew) (:domain manipulation)
    (:objects shelf - fixture teabag - movable cup - vessel box - container hook - tool)
    (:init (inworkspace table) (inworkspace teabag) (inworkspace cup) (inworkspace shelf) (inworkspace box)
           (on teabag shelf) (on cup shelf) (on box table) (on hook table) (inworkspace hook))
    (:goal (and (on teabag cup) (on cup table) (opened cup))))";

/// How many texts are made at once.
const ROWS: usize = 10_000;

struct Corpus {
    task: Arc<Task>,
    names: Vec<Vec<String>>,
    init: Vec<Fact>,
    plans: Vec<Vec<(OperatorId, Vec<Fact>)>>,
}

impl Corpus {
    fn new() -> Self {
        let domain = Arc::new(parse_domain(&Source::new("domain", DOMAIN)).expect("the domain is right"));
        let problem = parse_problem(&Source::new("problem", PROBLEM), &domain, None).expect("the problem is right");
        let task = Arc::new(ground(domain, Arc::new(problem), &Limits::default()).expect("it is small"));
        let plans = PlanSet::new(task.clone(), 6, Semantics::FirstGoal, &Limits::default()).expect("it is small");
        let drawn = plans.sample(ROWS, 1, true, &Limits::default()).expect("there is a plan");
        let plans = drawn.iter().map(|plan| trace(&task, &plan.0)).collect();
        let mut random = Random::new(1, 0);
        let mut name = |_| (0..5).map(|_| char::from(b'a' + random.below(26) as u8)).collect::<String>();
        let names = (0..ROWS).map(|_| (0..task.problem.objects.len()).map(&mut name).collect()).collect();
        Self { init: task.atoms(&task.init), task, names, plans }
    }

    fn render(&self, row: usize) -> String {
        let (domain, objects) = (&*self.task.domain, &self.task.problem.objects[..]);
        let naming = Naming { domain, objects, names: Some(&self.names[row]), words: None, predicates: None };
        let plan = &self.plans[row];
        let operator = |id: &OperatorId| &self.task.operators[id.index()];
        let steps = plan.iter().map(|(id, state)| (operator(id).action, &operator(id).args[..], &state[..]));
        let goal = plan.last().map_or(&self.init, |step| &step.1);
        render_record(&naming, Style::Typed, Goal::State(goal), &self.init, steps)
    }

    fn texts(&self) -> Vec<String> {
        (0..ROWS).into_par_iter().map(|row| self.render(row)).collect()
    }
}

fn trace(task: &Task, plan: &[OperatorId]) -> Vec<(OperatorId, Vec<Fact>)> {
    let step = |state: &mut State, &id: &OperatorId| {
        *state = task.apply(&task.operators[id.index()], state);
        Some((id, task.atoms(state)))
    };
    plan.iter().scan(task.init.clone(), step).collect()
}

fn format(criterion: &mut Criterion) {
    let corpus = Corpus::new();
    let texts = corpus.texts();
    let codec = Codec::new(&[(&corpus.task.domain, Synonyms::default())], Layout::Difference);
    let rows = codec.encode_batch(&texts, &Rows::default());
    let (words, legends): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
    let completions: Vec<_> = texts.iter().map(|text| split_text(text).1).collect();
    let mut group = criterion.benchmark_group("text");
    group.sample_size(10).throughput(Throughput::Bytes(texts.iter().map(|text| text.len() as u64).sum()));
    group.bench_function("render", |bencher| bencher.iter(|| black_box(corpus.texts())));
    group.bench_function("parse", |bencher| bencher.iter(|| black_box(parse_completions(&completions))));
    group.bench_function("encode", |bencher| {
        bencher.iter(|| black_box(codec.encode_ids_batch(&texts, &Rows::default())));
    });
    group.bench_function("decode", |bencher| bencher.iter(|| black_box(codec.decode_batch(&words, &legends))));
    group.finish();
}

/// One step of a batch of 256 rows: the mask, and the choice of a random allowed token.
fn mask(criterion: &mut Criterion) {
    let corpus = Corpus::new();
    let codec = Arc::new(Codec::new(&[(&corpus.task.domain, Synonyms::default())], Layout::Difference));
    let legend = codec.encode(split_text(&corpus.render(0)).0, &Hints::default()).1;
    let generator = Arc::new(SuccessorGenerator::new(&corpus.task));
    let (task, names) = (corpus.task.clone(), &corpus.names[0]);
    let spoken = Arc::new(SpokenTask::new(task, generator, codec.clone(), &legend, Some(names), true));
    let vocabulary = codec.vocabulary().with_slots(24);
    let mut started = MaskedDecoder::new(&codec, &vocabulary);
    started.add(vec![spoken; 256]).expect("the vocabulary has every word");
    let rows: Vec<usize> = (0..256).collect();
    let mut group = criterion.benchmark_group("masked");
    group.sample_size(20).throughput(Throughput::Elements(256));
    let mut flags = vec![false; rows.len() * vocabulary.len()];
    group.bench_function("mask", |bencher| bencher.iter(|| started.mask(&rows, &mut flags)));
    let chosen: Vec<u32> = flags.chunks(vocabulary.len()).map(first).collect();
    group.bench_function("advance", |bencher| {
        let step = |mut decoder: MaskedDecoder| decoder.advance(&rows, &chosen);
        bencher.iter_batched(|| started.clone(), step, BatchSize::LargeInput);
    });
    group.finish();
}

fn first(flags: &[bool]) -> u32 {
    flags.iter().position(|&flag| flag).expect("something may come") as u32
}

criterion_group!(benches, format, mask);
criterion_main!(benches);
