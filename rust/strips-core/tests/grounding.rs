//! Grounding against the slow obvious meaning of PDDL, on random small tasks.
//!
//! `STRIPS_LM_TASKS=100000 cargo test --release -p strips-core --test grounding` is the long run.

mod common;

use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

use common::naive::{Atoms, Naive};
use common::random_task::{Features, all_operators, random_task};
use proptest::prelude::*;
use strips_core::pddl::ast::{Object, ObjectId, TypeId};
use strips_core::pddl::{Source, parse_domain, parse_problem, print_domain, print_problem};
use strips_core::span::Span;
use strips_core::task::{FactId, Limits, State, Task, ground};

const MOST_STATES: usize = 20;

fn cases() -> u32 {
    std::env::var("STRIPS_LM_TASKS").ok().and_then(|tasks| tasks.parse().ok()).unwrap_or(300)
}

/// Explores by the naive meaning and asserts that the task agrees at every step.
fn agree(seed: u64, features: Features) {
    let (domain, problem) = random_task(seed, features);
    let naive = Naive { domain: &domain, problem: &problem };
    let task = ground(domain.clone(), problem.clone(), &Limits::default()).expect("a small task stays within limits");
    assert_orders(&task);
    let operators = all_operators(&domain, &problem);
    let mut reached: HashMap<Atoms, State> = HashMap::from([(naive.init(), task.init.clone())]);
    let mut queue = VecDeque::from([naive.init()]);
    while let Some(atoms) = queue.pop_front() {
        let state = reached[&atoms].clone();
        assert_same_state(&naive, &task, &atoms, &state);
        let full = naive.with_derived(&atoms);
        for (action, args) in &operators {
            let operator = task.operator(*action, args).map(|id| &task.operators[id.index()]);
            let operator = operator.filter(|operator| operator.applicable(&state));
            let expected = naive.apply_in(*action, args, &atoms, &full);
            assert_eq!(operator.is_some(), expected.is_some(), "applicability of {action:?} {args:?} in {atoms:?}");
            let (Some(operator), Some(next)) = (operator, expected) else { continue };
            let next_state = task.apply(operator, &state);
            match reached.get(&next) {
                Some(known) => assert_eq!(known, &next_state, "one state for one set of atoms"),
                None if reached.len() < MOST_STATES => {
                    reached.insert(next.clone(), next_state);
                    queue.push_back(next);
                }
                None => assert_same_state(&naive, &task, &next, &next_state),
            }
        }
    }
}

fn assert_same_state(naive: &Naive, task: &Task, atoms: &Atoms, state: &State) {
    assert_eq!(task.atoms(state), atoms.iter().cloned().collect::<Vec<_>>(), "atoms in canonical order");
    assert_eq!(task.goal.holds(state), naive.is_goal(atoms), "the goal in {atoms:?}");
    let full = naive.with_derived(atoms);
    for (index, fact) in task.facts.iter().enumerate() {
        assert_eq!(state.holds(FactId::from(index)), full.contains(fact), "{fact:?} in {atoms:?}");
    }
}

fn assert_orders(task: &Task) {
    assert!(task.facts.is_sorted_by(|a, b| a < b), "facts ascend");
    assert!(task.static_facts.is_sorted_by(|a, b| a < b), "static facts ascend");
    assert!(task.operators.is_sorted_by(|a, b| (a.action, &a.args) < (b.action, &b.args)), "operators ascend");
    for effect in task.operators.iter().flat_map(|operator| &operator.effects) {
        assert!(effect.add_effects.is_sorted_by(|a, b| a < b) && effect.del_effects.is_sorted_by(|a, b| a < b));
        assert!(effect.add_effects.iter().all(|fact| !effect.del_effects.contains(fact)));
    }
    for condition in task.operators.iter().map(|operator| &operator.precondition).chain([&task.goal]) {
        assert!(condition.positive.is_sorted_by(|a, b| a < b) && condition.negative.is_sorted_by(|a, b| a < b));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn grounding_keeps_the_meaning_of_strips_tasks(seed: u64) {
        agree(seed, Features::STRIPS);
    }

    #[test]
    fn a_printed_task_parses_and_grounds_to_the_same(seed: u64) {
        let (domain, problem) = random_task(seed, Features::ADL);
        let source = Source::new("domain", print_domain(&domain));
        let again = parse_domain(&source).map_err(|error| TestCaseError::fail(error.to_string()))?;
        let text = print_problem(&problem, &domain);
        let problem_again = parse_problem(&Source::new("problem", text), &again, Some(&source))
            .map_err(|error| TestCaseError::fail(error.to_string()))?;
        let limits = Limits::default();
        let task = ground(domain, problem, &limits).expect("within limits");
        let other = ground(Arc::new(again), Arc::new(problem_again), &limits).expect("within limits");
        prop_assert_eq!((&task.facts, &task.static_facts, &task.init), (&other.facts, &other.static_facts, &other.init));
        prop_assert_eq!((&task.operators, &task.axioms, &task.goal), (&other.operators, &other.axioms, &other.goal));
    }

    #[test]
    fn an_object_that_nothing_mentions_changes_no_other_operator(seed: u64) {
        let (domain, problem) = random_task(seed, Features::STRIPS);
        let mut wider = (*problem).clone();
        wider.objects.push(Object { name: "idle".into(), types: vec![TypeId::OBJECT], span: Span::default() });
        let idle = ObjectId::from(problem.objects.len());
        let limits = Limits::default();
        let task = ground(domain.clone(), problem, &limits).expect("within limits");
        let wider = ground(domain, Arc::new(wider), &limits).expect("within limits");
        for operator in task.operators.iter() {
            prop_assert!(wider.operator(operator.action, &operator.args).is_some(), "{:?} is lost", operator);
        }
        for fact in &task.facts {
            prop_assert!(!fact.args.contains(&idle) && wider.fact(fact).is_some(), "{:?} is lost", fact);
        }
    }

    #[test]
    fn grounding_keeps_the_meaning_of_adl_tasks(seed: u64) {
        agree(seed, Features::ADL);
    }
}

/// Time is what this tests: what is quadratic or worse in the number of types would not come to an end.
#[test]
fn a_long_chain_of_types_is_grounded() {
    let chain = (1..20_000).map(|n| format!("t{n} - t{}", n - 1)).collect::<Vec<_>>().join(" ");
    let text = format!(
        "(define (domain d) (:types t0 - object {chain} other) (:predicates (p ?x - t0) (q ?x - t10000))
         (:action a :parameters (?x - t10000) :precondition (p ?x) :effect (q ?x)))"
    );
    let source = Source::new("chain", text);
    let domain = Arc::new(parse_domain(&source).unwrap_or_else(|error| panic!("{error}")));
    let text = "(define (problem e) (:domain d) (:objects low - t19999 high - t9999 far - other)
                (:init (p low) (p high)) (:goal (q low)))";
    let problem = parse_problem(&Source::new("problem", text), &domain, Some(&source));
    let problem = Arc::new(problem.unwrap_or_else(|error| panic!("{error}")));
    let task = ground(domain, problem, &Limits::default()).expect("within limits");
    let names: Vec<_> = (0..task.operators.len()).map(|index| task.operator_name(index.into())).collect();
    assert_eq!(names, ["(a low)"]);
}
