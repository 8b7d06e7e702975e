//! The manipulation domain's records, checked against the oracle.

use std::collections::{BTreeMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;

use super::*;
use crate::negative::{Corruption, FaultKind, Goal, check, trace};
use crate::pddl::Source;
use crate::search::{PlanSet, Semantics};
use crate::task::{Fact, Limits, Operator, State, Task, ground};

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../python/strips_lm/domains/manipulation")
}

fn source(name: &str) -> Source {
    Source::new(name, std::fs::read_to_string(folder().join(name)).expect("the file is part of the tree"))
}

pub(super) fn manipulation() -> DomainFiles {
    let entries = std::fs::read_dir(folder().join("templates")).expect("the folder is part of the tree");
    let mut names: Vec<_> =
        entries.map(|entry| format!("templates/{}", entry.unwrap().file_name().to_string_lossy())).collect();
    names.sort();
    DomainFiles {
        domain: source("domain.pddl"),
        lexicon: Some(source("lexicon.toml")),
        templates: names.iter().map(|name| source(name)).collect(),
        random: Some(source("random.pddl")),
        large: Some(source("large.pddl")),
        problems: vec![],
    }
}

pub(super) fn config() -> RecordConfig {
    RecordConfig {
        seed: 3,
        pairs: 600,
        validation_share: 1.0 / 6.0,
        validation_by_shape: false,
        suite_records: 60,
        max_steps: 7,
        plans: PlanChoice::Shortest,
        random_goals: false,
        plans_per_problem: 16,
        problems_per_template: 12,
        random_problems: 60,
        goals_per_state: 6,
        states_per_start: 300,
        template_share: 0.5,
        train_template_share: 0.25,
        midway_share: 0.5,
        kept_share: 0.5,
        train_rarity: 0.5,
        train_steps_power: 1,
        state_goal_share: 0.5,
        paper_share: 0.2,
        words_share: 0.5,
        predicate_words: 0.5,
        shuffled_share: 0.3,
        made_up_share: 0.3,
        unseen_shapes_share: 0.2,
        held_out_templates: vec!["take-out".into()],
        more_objects: 2,
        longer_steps: (8, 12),
        large_records: 0,
        large_sizes: BTreeMap::new(),
        large_walk: (6, 12),
        negatives: Corruption::ALL.iter().map(|kind| (kind.name().to_owned(), 1.0)).collect::<BTreeMap<_, _>>(),
    }
}

/// With a suite of problems that are not so large at all.
fn with_large() -> RecordConfig {
    let sizes = [("movable", 3), ("tool", 1), ("vessel", 1), ("container", 1)];
    let large_sizes = sizes.map(|(name, size)| (name.to_owned(), vec![size])).into();
    RecordConfig { large_records: 20, large_sizes, random_problems: 20, ..config() }
}

fn stream(config: RecordConfig) -> RecordStream {
    RecordStream::new(&manipulation(), config, Limits::default()).unwrap()
}

#[test]
fn every_split_has_records_and_is_the_same_for_any_cut() {
    let stream = stream(with_large());
    assert_eq!(stream.splits().len(), Split::ALL.len(), "{:?}", stream.splits());
    for (split, records) in stream.splits() {
        let whole = stream.batch(split, 0..records);
        let mut cut = stream.batch(split, 0..records / 3);
        cut.append(&stream.batch(split, records / 3..records));
        assert!(whole == cut, "{}", split.name());
    }
}

#[test]
fn every_plan_of_a_problem_is_right_and_shortest() {
    let stream = stream(config());
    for id in 0..stream.problems() {
        let shape = stream.problem(id);
        for plan in &shape.plans {
            assert!(shape.source == ShapeSource::Large || Some(plan.len()) == shape.shortest);
            assert_eq!(check(&shape.task, &shape.goal, &trace(&shape.task, plan).0), None);
        }
    }
}

#[test]
fn tasks_that_can_do_the_same_hold_their_operators_once() {
    let stream = stream(config());
    let tasks: Vec<_> = (0..stream.problems()).map(|id| &stream.problem(id).task).collect();
    let mut lists: Vec<&Arc<[Operator]>> = Vec::new();
    for task in &tasks {
        match lists.iter().find(|known| ***known == task.operators) {
            Some(known) => assert!(Arc::ptr_eq(known, &task.operators)),
            None => lists.push(&task.operators),
        }
    }
    assert!(2 * lists.len() < tasks.len(), "{} lists of {} tasks", lists.len(), tasks.len());
}

#[test]
fn the_shortest_plans_are_those_of_the_plan_set() {
    let stream = stream(config());
    for id in (0..stream.problems()).step_by(5) {
        let shape = stream.problem(id);
        let problem = Arc::new(shape.problem("again"));
        let task = Arc::new(ground(shape.task.domain.clone(), problem, &Limits::default()).unwrap());
        let Some(shortest) = shape.shortest else { continue };
        let set = PlanSet::new(task.clone(), shortest, Semantics::FirstGoal, &Limits::default()).unwrap();
        assert_eq!(set.count(), shape.plan_count.into(), "problem {id}");
        let names = |task: &Task, plan: &[crate::task::OperatorId]| {
            plan.iter().map(|&operator| task.operator_name(operator)).collect::<Vec<_>>()
        };
        if shape.plan_count <= 16 {
            let own: HashSet<_> = shape.plans.iter().map(|plan| names(&shape.task, plan)).collect();
            assert_eq!(own, set.iter().map(|plan| names(&task, &plan.0)).collect::<HashSet<_>>());
        }
    }
}

#[test]
fn every_kind_of_negative_occurs_with_its_proof() {
    let stream = stream(config());
    let batch = stream.batch(Split::Train, 0..500);
    let kinds: HashSet<&str> = (0..500).map(|row| batch.negative_kind.get(row)).collect();
    assert_eq!(kinds.len(), Corruption::ALL.len(), "{kinds:?}");
    let verdicts: HashSet<&str> = (0..500).map(|row| batch.negative_verdict.get(row)).collect();
    for kind in [FaultKind::Inapplicable, FaultKind::GoalNotReached, FaultKind::WrongState, FaultKind::Type] {
        assert!(verdicts.contains(kind.name()), "{verdicts:?}");
    }
    assert!((0..500).all(|row| batch.negative.get(row) != batch.completion.get(row)));
}

/// The record's words for predicates, and whether its prompt has a legend that gives them.
fn predicate_words(batch: &Batch, row: usize) -> (Vec<&str>, bool) {
    let place = |row: usize| batch.words.offsets[row].cast_unsigned() as usize;
    let (start, end) = (place(row), place(row + 1));
    let words = (start + 5..end).map(|word| batch.words.texts.get(word)).collect();
    (words, batch.prompt.get(row).contains(", inhand "))
}

#[test]
fn a_predicate_goes_by_one_word_throughout_a_record() {
    let stream = stream(config());
    let own = ["inhand", "inworkspace", "on", "in", "opened"];
    for (split, share) in [(Split::Train, 0.1..0.3), (Split::UnseenPredicates, 1.0..1.1)] {
        let batch = stream.batch(split, 0..60);
        let mut given = 0;
        for row in 0..60 {
            let (words, legend) = predicate_words(&batch, row);
            given += usize::from(legend);
            assert!(legend || words == own, "{words:?}");
            let (_, atoms) = batch.prompt.get(row).split_once("<GOAL>").unwrap();
            for text in [atoms, batch.completion.get(row), batch.negative.get(row)] {
                let text = text.replace("not ", "");
                let said = text
                    .split("<ACTION>")
                    .flat_map(|step| step.split_once("<STATE>").map_or(step, |step| step.1).split("), "));
                let said = said.filter_map(|atom| atom.split_once('(')).map(|atom| atom.0.rsplit(' ').next().unwrap());
                assert!(said.clone().all(|word| words.contains(&word)), "{words:?}: {text}");
            }
        }
        assert!(share.contains(&(f64::from(given as u32) / 60.0)), "{given} of {}", split.name());
    }
}

#[test]
fn words_for_predicates_change_nothing_but_words() {
    let (with, without) = (stream(config()), stream(RecordConfig { predicate_words: 0.0, ..config() }));
    for (split, records) in without.splits() {
        let (with, without) = (with.batch(split, 0..records), without.batch(split, 0..records));
        assert_eq!(
            (with.plan, with.names, with.negative_verdict),
            (without.plan, without.names, without.negative_verdict)
        );
    }
    assert_eq!(without.len(Split::UnseenPredicates), 0);
}

#[test]
fn words_for_predicates_need_a_lexicon_that_has_them() {
    let files = DomainFiles { lexicon: None, ..manipulation() };
    let refused = RecordStream::new(&files, config(), Limits::default()).err().unwrap();
    assert!(matches!(refused, RecordError::Config(ConfigMistake::PredicateWords)), "{refused}");
}

#[test]
fn suites_share_no_problem_with_training() {
    let stream = stream(config());
    let problems =
        |split| -> HashSet<i32> { stream.batch(split, 0..stream.len(split)).problem_id.into_iter().collect() };
    let trained = problems(Split::Train);
    for split in [Split::UnseenShapes, Split::UnseenTemplate, Split::MoreObjects, Split::Longer] {
        assert!(trained.is_disjoint(&problems(split)), "{}", split.name());
    }
    let hashes: HashSet<u128> = (0..stream.problems()).map(|id| stream.problem(id).hash).collect();
    assert_eq!(hashes.len(), stream.problems(), "each problem is there once");
    let objects = |split| {
        problems(split).into_iter().map(|id| stream.problem(id.cast_unsigned() as usize).task.problem.objects.len())
    };
    assert!(objects(Split::MoreObjects).min() >= objects(Split::Train).max().map(|most| most + 2));
    assert!(
        problems(Split::Longer).into_iter().all(|id| stream.problem(id.cast_unsigned() as usize).shortest >= Some(8))
    );
}

#[test]
fn suites_of_their_own_problems_ask_each_once_before_any_again() {
    let stream = stream(config());
    for split in [Split::MoreObjects, Split::Longer] {
        let problems = stream.batch(split, 0..stream.len(split)).problem_id;
        let different: HashSet<i32> = problems.iter().copied().collect();
        assert_eq!(different.len(), problems.len(), "{}", split.name());
        let states: HashSet<_> = different
            .iter()
            .map(|&id| {
                let task = &stream.problem(id.cast_unsigned() as usize).task;
                task.atoms(&task.init)
            })
            .collect();
        assert!(2 * states.len() >= problems.len(), "{}: {} starts", split.name(), states.len());
    }
}

#[test]
fn problems_from_midway_are_training_s_alone() {
    let with = stream(RecordConfig { midway_share: 1.0, kept_share: 0.0, ..config() });
    let without = stream(RecordConfig { midway_share: 0.0, kept_share: 0.0, ..config() });
    assert!(with.problems() > without.problems() + 100, "{} {}", with.problems(), without.problems());
    for (split, records) in without.splits() {
        let (with, without) = (with.batch(split, 0..records), without.batch(split, 0..records));
        assert_eq!(with == without, !matches!(split, Split::Train | Split::Validation), "{}", split.name());
    }
    let batch = with.batch(Split::Train, 0..300);
    let midway = batch.problem_id.iter().filter(|&&id| id.cast_unsigned() as usize >= without.problems()).count();
    assert!((60..240).contains(&midway), "{midway} of 300");
    for &id in &batch.problem_id {
        let shape = with.problem(id.cast_unsigned() as usize);
        assert!(shape.shortest.is_some_and(|steps| (1..=7).contains(&steps)));
    }
}

#[test]
fn problems_that_ask_for_what_holds_already_are_training_s_alone() {
    let config = RecordConfig { random_problems: 300, midway_share: 0.0, ..config() };
    let with = stream(RecordConfig { kept_share: 1.0, ..config.clone() });
    let without = stream(RecordConfig { kept_share: 0.0, ..config });
    for (split, records) in without.splits() {
        let (with, without) = (with.batch(split, 0..records), without.batch(split, 0..records));
        assert_eq!(with == without, !matches!(split, Split::Train | Split::Validation), "{}", split.name());
    }
    let kept = without.problems()..with.problems();
    assert!(kept.len() > 40, "{kept:?}");
    let batch = with.batch(Split::Train, 0..300);
    let drawn = batch.problem_id.iter().filter(|&&id| kept.contains(&(id.cast_unsigned() as usize))).count();
    assert!(drawn > 20, "{drawn} of 300");
    let mut disturbed = 0;
    for id in kept {
        let shape = with.problem(id);
        let Goal::Literals(literals) = &shape.goal else { panic!("a whole state keeps all it says") };
        let holds =
            |literal: &(Fact, bool), state: &State| Goal::Literals(vec![literal.clone()]).holds(&shape.task, state);
        let held: Vec<_> = literals.iter().filter(|literal| holds(literal, &shape.task.init)).collect();
        let [held] = held[..] else { panic!("one literal is of what holds already: {literals:?}") };
        let breaks = |plan: &Vec<crate::task::OperatorId>| {
            (1..plan.len()).any(|steps| !holds(held, &trace(&shape.task, &plan[..steps]).1))
        };
        disturbed += usize::from(shape.plans.iter().all(breaks));
    }
    assert!(disturbed > 5, "some have to be undone on the way: {disturbed}");
}

#[test]
fn rare_rows_of_actions_are_drawn_more_often_where_that_is_asked_for() {
    let commonest = |train_rarity| {
        let config = RecordConfig { train_rarity, train_steps_power: 0, train_template_share: 0.0, ..config() };
        let stream = stream(RecordConfig { random_problems: 300, ..config });
        let batch = stream.batch(Split::Train, 0..500);
        let mut counts: BTreeMap<Vec<_>, usize> = BTreeMap::new();
        for &id in &batch.problem_id {
            let shape = stream.problem(id.cast_unsigned() as usize);
            let actions = shape.plans[0].iter().map(|operator| shape.task.operators[operator.index()].action);
            *counts.entry(actions.collect()).or_default() += 1;
        }
        counts.into_values().max().expect("there are records")
    };
    let (even, half, whole) = (commonest(0.0), commonest(0.5), commonest(1.0));
    assert!(even > half && half > whole && even > 3 * whole, "{even} {half} {whole}");
}

#[test]
fn large_problems_have_the_sizes_asked_for_and_no_length_that_is_not_proven() {
    let stream = stream(with_large());
    let movable = |shape: &Shape| {
        let domain = &shape.task.domain;
        let of_type = |object: &&crate::pddl::ast::Object| domain.types[object.types[0].index()].name == "movable";
        shape.task.problem.objects.iter().filter(of_type).count()
    };
    let large: Vec<&Shape> = (0..stream.problems()).map(|id| stream.problem(id)).collect();
    let large: Vec<&Shape> = large.into_iter().filter(|shape| shape.source == ShapeSource::Large).collect();
    assert!(large.len() > 10 && large.iter().all(|shape| movable(shape) == 3), "{}", large.len());
    let (proven, open): (Vec<&Shape>, Vec<&Shape>) = large.into_iter().partition(|shape| shape.shortest.is_some());
    assert!(!proven.is_empty() && !open.is_empty());
    for shape in proven {
        let task = Task { goal: shape.goal.condition(&shape.task), ..(*shape.task).clone() };
        let best = crate::search::shortest_plan(&task, None, &Limits::default()).unwrap().unwrap();
        assert_eq!(shape.shortest, Some(best.0.len()));
        assert!(shape.plans.iter().all(|plan| plan.len() == best.0.len()));
    }
    assert!(open.iter().all(|shape| shape.plans.len() == 1 && shape.plan_count == 1));
}

#[test]
fn sizes_are_of_arrays_that_there_are() {
    for (name, sizes) in [("movable", vec![2, 2]), ("physobj", vec![3]), ("thing", vec![3]), ("movable", vec![0])] {
        let large_sizes = BTreeMap::from([(name.to_owned(), sizes)]);
        let made = RecordStream::new(&manipulation(), RecordConfig { large_sizes, ..with_large() }, Limits::default());
        assert!(matches!(made.err(), Some(RecordError::Config(ConfigMistake::LargeSizes(of))) if of == name));
    }
    let files = DomainFiles { large: None, ..manipulation() };
    let made = RecordStream::new(&files, with_large(), Limits::default());
    assert!(matches!(made.err(), Some(RecordError::Config(ConfigMistake::NoLarge))));
}

#[test]
fn the_figure_of_the_report_has_two_shortest_plans_of_five_steps() {
    let domain = Arc::new(crate::pddl::parse_domain(&source("domain.pddl")).unwrap());
    let text =
        "(define (problem figure-4) (:domain manipulation) (:objects teabag - movable cup - vessel shelf - fixture)
        (:init (inworkspace table) (inworkspace teabag) (inworkspace cup) (on teabag shelf) (on cup shelf))
        (:goal (and (on teabag cup) (on cup table) (opened cup))))";
    let problem = crate::pddl::parse_problem(&Source::new("figure-4", text), &domain, None).unwrap();
    let task = Arc::new(ground(domain, Arc::new(problem), &Limits::default()).unwrap());
    let set = PlanSet::new(task.clone(), 7, Semantics::FirstGoal, &Limits::default()).unwrap();
    let counts: Vec<String> = set.counts().iter().map(ToString::to_string).collect();
    assert_eq!(counts[..6], ["0", "0", "0", "0", "0", "2"], "{counts:?}");
    let figure = ["(pick cup)", "(place cup table)", "(open cup)", "(pick teabag)", "(place teabag cup)"];
    let names = |plan: &crate::search::Plan| plan.0.iter().map(|&id| task.operator_name(id)).collect::<Vec<_>>();
    assert!(set.iter().take(2).any(|plan| names(&plan) == figure));
}

#[test]
fn a_state_goal_asks_for_exactly_that_state() {
    let stream = stream(config());
    let shape = (0..stream.problems()).map(|id| stream.problem(id)).find(|shape| matches!(shape.goal, Goal::State(_)));
    let shape = shape.expect("half of the goals are states");
    let literals = shape.goal.literals(&shape.task);
    assert_eq!(literals.len(), shape.task.facts.len(), "every fact that can change, true or false");
}
