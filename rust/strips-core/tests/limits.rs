//! Tasks that explode end with the limit that they reached, soon and without much memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{LimitError, Limits, Task, ground};

/// Grounds a problem with `objects` objects, of which each pair is in `p`, with `body` as the domain's actions.
fn explode(actions: &str, goal: &str, objects: usize, limits: &Limits) -> Result<Task, LimitError> {
    let domain =
        format!("(define (domain d) (:requirements :adl) (:predicates (p ?x ?y) (q ?x ?y ?z) (done)) {actions})");
    let names: Vec<String> = (0..objects).map(|n| format!("o{n}")).collect();
    let init: Vec<String> = (0..objects * objects).map(|n| format!("(p o{} o{})", n / objects, n % objects)).collect();
    let problem = format!(
        "(define (problem e) (:domain d) (:objects {}) (:init {}) (:goal {goal}))",
        names.join(" "),
        init.join(" ")
    );
    let domain = parse_domain(&Source::new("domain", domain)).expect("a domain");
    let problem = parse_problem(&Source::new("problem", problem), &domain, None).expect("a problem");
    ground(Arc::new(domain), Arc::new(problem), limits)
}

const WIDE: &str = "(:action a :parameters (?a ?b ?c ?d ?e ?f) :effect (done))";
const CHAIN: &str = "(:action a :parameters (?a ?b ?c ?d ?e ?f)
    :precondition (and (p ?a ?b) (p ?b ?c) (p ?c ?d) (p ?d ?e) (p ?e ?f) (q ?f ?a ?a)) :effect (not (p ?a ?a)))
    (:action b :parameters (?x) :effect (q ?x ?x ?x))";
const FACTS: &str = "(:action a :parameters (?x ?y ?z) :effect (q ?x ?y ?z))";
const FORGET: &str = "(:action a :parameters (?x ?y) :effect (not (p ?x ?y)))";

#[test]
fn too_many_operators_are_refused() {
    let limits = Limits { operators: 100_000, ..Limits::default() };
    assert_eq!(explode(WIDE, "(done)", 50, &limits).unwrap_err(), LimitError::Operators { limit: 100_000 });
}

#[test]
fn too_many_facts_are_refused() {
    let limits = Limits { facts: 50_000, ..Limits::default() };
    assert_eq!(explode(FACTS, "(done)", 50, &limits).unwrap_err(), LimitError::Facts { limit: 50_000 });
}

#[test]
fn too_much_memory_is_refused() {
    let limits = Limits { bytes: 50 << 20, ..Limits::default() };
    assert_eq!(explode(WIDE, "(done)", 50, &limits).unwrap_err(), LimitError::Bytes { limit: 50 << 20 });
    assert_eq!(explode(CHAIN, "(done)", 50, &limits).unwrap_err(), LimitError::Bytes { limit: 50 << 20 });
}

#[test]
fn a_goal_that_expands_without_end_is_refused() {
    let goal = "(forall (?a ?b ?c ?d) (or (p ?a ?b) (p ?c ?d)))";
    let limits = Limits { bytes: 50 << 20, ..Limits::default() };
    assert_eq!(explode(FORGET, goal, 60, &limits).unwrap_err(), LimitError::Bytes { limit: 50 << 20 });
}

#[test]
fn time_and_interrupts_end_even_joins_that_find_nothing() {
    let nothing = "(:action a :parameters (?a ?b ?c ?d ?e ?f)
        :precondition (and (p ?a ?b) (p ?b ?c) (p ?c ?d) (p ?d ?e) (p ?e ?f) (not (p ?f ?a))) :effect (done))";
    let begin = Instant::now();
    let limit = Duration::from_millis(100);
    let limits = Limits { time: Some(limit), ..Limits::default() };
    assert_eq!(explode(nothing, "(done)", 60, &limits).unwrap_err(), LimitError::Time { limit });
    let flag = Arc::new(AtomicBool::new(false));
    let limits = Limits { interrupt: Some(flag.clone()), ..Limits::default() };
    let setter = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        flag.store(true, Ordering::Relaxed);
    });
    assert_eq!(explode(nothing, "(done)", 60, &limits).unwrap_err(), LimitError::Interrupted);
    setter.join().expect("the thread ends");
    assert!(begin.elapsed() < Duration::from_secs(20), "limits are looked at often");
}
