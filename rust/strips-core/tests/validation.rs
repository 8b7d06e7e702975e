//! Validation against the slow obvious meaning of PDDL, on random plans of random small tasks.
//!
//! `STRIPS_LM_TASKS=100000 cargo test --release -p strips-core --test validation` is the long run.

mod common;

use std::sync::Arc;

use common::mutation::accepted_mutation;
use common::naive::{Atoms, Naive};
use common::random_task::{Features, all_operators, random_task};
use proptest::prelude::*;
use strips_core::pddl::ast::{ActionId, Domain, ObjectId, Problem};
use strips_core::random::Random;
use strips_core::task::{LimitError, Limits, OperatorId, ground};
use strips_core::validate::{Outcome, Validator, Verdict, validate, validate_operators};

type Step = (ActionId, Vec<ObjectId>);

fn tasks() -> u32 {
    std::env::var("STRIPS_LM_TASKS").ok().and_then(|tasks| tasks.parse().ok()).unwrap_or(500)
}

fn name(domain: &Domain, problem: &Problem, (action, args): &Step) -> String {
    let args = args.iter().map(|id| problem.objects[id.index()].name.as_str());
    let words: Vec<&str> = std::iter::once(domain.actions[action.index()].name.as_str()).chain(args).collect();
    format!("({})", words.join(" "))
}

/// A random plan whose steps are mostly applicable.
fn random_plan(naive: &Naive, operators: &[Step], random: &mut Random) -> Vec<Step> {
    let mut atoms = naive.init();
    let mut plan = Vec::new();
    for _ in 0..random.below(6) {
        let mut step = random.choice(operators);
        for _ in 0..20 {
            if naive.apply(step.0, &step.1, &atoms).is_some() || random.chance(0.05) {
                break;
            }
            step = random.choice(operators);
        }
        atoms = naive.apply(step.0, &step.1, &atoms).unwrap_or(atoms);
        plan.push(step.clone());
    }
    plan
}

/// The outcome, step and last state by the naive meaning.
fn naive_verdict(naive: &Naive, plan: &[Step]) -> (Outcome, Option<usize>, Atoms) {
    let mut atoms = naive.init();
    for (index, (action, args)) in plan.iter().enumerate() {
        match naive.apply(*action, args, &atoms) {
            Some(next) => atoms = next,
            None => return (Outcome::Inapplicable, Some(index + 1), atoms),
        }
    }
    if naive.is_goal(&atoms) {
        return (Outcome::Valid, None, atoms);
    }
    (Outcome::GoalNotReached, Some(plan.len() + 1), atoms)
}

fn assert_evidence(naive: &Naive, verdict: &Verdict, atoms: &Atoms) {
    assert!(!verdict.missing.is_empty(), "something is missing: {verdict:?}");
    assert!(verdict.missing.is_sorted());
    let full = naive.with_derived(atoms);
    let name = |predicate: usize, args: &[ObjectId]| {
        let args = args.iter().map(|id| naive.problem.objects[id.index()].name.as_str());
        let words: Vec<&str> = std::iter::once(naive.domain.predicates[predicate].name.as_str()).chain(args).collect();
        format!("({})", words.join(" "))
    };
    let held: Vec<String> = full.iter().map(|atom| name(atom.predicate.index(), &atom.args)).collect();
    for missing in &verdict.missing {
        assert!(!held.contains(missing), "{missing} holds and is said to be missing");
        let negated = missing.strip_prefix("(not ").and_then(|rest| rest.strip_suffix(')'));
        let plain = |text: &str| naive.domain.predicates.iter().any(|p| text.starts_with(&format!("({}", p.name)));
        if let Some(negated) = negated.filter(|text| plain(text)) {
            assert!(held.iter().any(|atom| atom == negated), "{missing} holds and is said to be missing");
        }
    }
}

fn agree(seed: u64, features: Features) {
    let (domain, problem) = random_task(seed, features);
    agree_on(&domain, &problem, seed);
}

fn agree_on(domain: &Arc<Domain>, problem: &Arc<Problem>, seed: u64) {
    let naive = Naive { domain, problem };
    let operators = all_operators(domain, problem);
    if operators.is_empty() {
        return;
    }
    let task = ground(domain.clone(), problem.clone(), &Limits::default()).expect("a small task");
    let validator = Validator::new(Arc::new(task));
    let mut random = Random::new(seed, 1);
    for _ in 0..8 {
        let plan = random_plan(&naive, &operators, &mut random);
        let text: String = plan.iter().map(|step| name(domain, problem, step) + "\n").collect();
        let verdict = validator.validate(&text);
        let (outcome, step, atoms) = naive_verdict(&naive, &plan);
        assert_eq!((verdict.outcome, verdict.step), (outcome, step), "{text} {}", verdict.reason);
        assert_eq!(verdict.line, step.filter(|_| outcome == Outcome::Inapplicable));
        if outcome != Outcome::Valid {
            assert_evidence(&naive, &verdict, &atoms);
        }
        assert_eq!(verdict, validate(validator.task(), &text), "the fast and the slow way agree");
        assert_eq!(validator.outcomes(&[&text], &Limits::default()), Ok(vec![verdict.outcome]));
        let shouted = validator.validate(&format!("; a comment\n{}", text.to_ascii_uppercase()));
        assert_eq!(verdict, Verdict { line: shouted.line.map(|line| line - 1), ..shouted }, "case does not matter");
        agree_on_ids(&validator, &plan, &verdict);
    }
}

fn agree_on_ids(validator: &Validator, plan: &[Step], verdict: &Verdict) {
    let ids: Option<Vec<OperatorId>> =
        plan.iter().map(|(action, args)| validator.task().operator(*action, args)).collect();
    let Some(ids) = ids else { return };
    let by_ids = validator.validate_operators(&ids);
    assert_eq!(by_ids, validate_operators(validator.task(), &ids));
    assert_eq!(by_ids, Verdict { line: None, ..verdict.clone() });
    let flat: Vec<u32> = ids.iter().map(|id| id.0).collect();
    let ends = [0, i64::try_from(flat.len()).expect("a short plan")];
    let outcomes = validator
        .outcomes_of_operators(&flat, &ends, &Limits::default())
        .expect("in time")
        .expect("the offsets are right");
    assert_eq!(outcomes, [(verdict.outcome, verdict.step.unwrap_or(0) as u32)]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: tasks(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn verdicts_keep_the_meaning_of_strips_tasks(seed: u64) {
        agree(seed, Features::STRIPS);
    }

    #[test]
    fn verdicts_keep_the_meaning_of_adl_tasks(seed: u64) {
        agree(seed, Features::ADL);
    }

    #[test]
    fn verdicts_keep_the_meaning_of_changed_texts_that_are_accepted(seed: u64) {
        if let Some((domain, problem)) = accepted_mutation(seed) {
            agree_on(&domain, &problem, seed);
        }
    }

    #[test]
    fn every_text_gets_a_verdict(text in ".{0,60}|[()a-c0-9 ;:\\[\\]\n.]{0,60}") {
        let (domain, problem) = random_task(3, Features::STRIPS);
        let task = ground(domain, problem, &Limits::default()).expect("a small task");
        let validator = Validator::new(Arc::new(task));
        let verdict = validate(validator.task(), &text);
        prop_assert_eq!(validator.outcomes(&[&text], &Limits::default()), Ok(vec![verdict.outcome]));
        prop_assert_eq!(validator.validate(&text), verdict);
    }
}

#[test]
fn changed_texts_are_accepted_often_enough_to_tell() {
    let accepted = (0..2000).filter(|&seed| accepted_mutation(seed).is_some()).count();
    assert!(accepted > 60, "{accepted} of 2000");
}

#[test]
fn offsets_that_do_not_ascend_are_refused() {
    let (domain, problem) = random_task(3, Features::STRIPS);
    let validator = Validator::new(Arc::new(ground(domain, problem, &Limits::default()).expect("a small task")));
    let outcomes = |operators: &[u32], offsets: &[i64]| {
        validator.outcomes_of_operators(operators, offsets, &Limits::default()).expect("in time")
    };
    assert_eq!(outcomes(&[0, 0], &[0, 2, 1]), None);
    assert_eq!(outcomes(&[0, 0], &[-1, 1]), None);
    assert_eq!(outcomes(&[0, 0], &[0, 3]), None);
    assert_eq!(outcomes(&[u32::MAX], &[0, 1]), Some(vec![(Outcome::UnknownAction, 1)]));
}

#[test]
fn interrupted_validation_says_so() {
    let (domain, problem) = random_task(3, Features::STRIPS);
    let validator = Validator::new(Arc::new(ground(domain, problem, &Limits::default()).expect("a small task")));
    let limits = Limits { interrupt: Some(Arc::new(true.into())), ..Limits::default() };
    assert_eq!(validator.validate_many(&[""], &limits), Err(LimitError::Interrupted));
    assert_eq!(validator.outcomes(&[""], &limits), Err(LimitError::Interrupted));
    assert_eq!(validator.outcomes_of_operators(&[], &[0, 0], &limits), Err(LimitError::Interrupted));
}
