//! Grounding follows the joins: with hundreds of objects, six parameters cost what the matching atoms cost.

use std::sync::Arc;
use std::time::Duration;

use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, Task, ground};

const OBJECTS: usize = 300;

/// Grounds actions over a chain of objects; a product over all objects would take far longer than the limit allows.
fn chain(actions: &str) -> Task {
    let domain = format!(
        "(define (domain chain) (:requirements :adl :derived-predicates)
        (:predicates (next ?x ?y) (at ?x) (seen ?x) (mark ?x ?y) (done) (linked ?x ?y)) {actions})"
    );
    let names: Vec<String> = (0..OBJECTS).map(|n| format!("o{n}")).collect();
    let init: Vec<String> = (1..OBJECTS).map(|n| format!("(next o{} o{n})", n - 1)).collect();
    let problem = format!(
        "(define (problem p) (:domain chain) (:objects {}) (:init (at o0) {}) (:goal (done)))",
        names.join(" "),
        init.join(" ")
    );
    let domain = parse_domain(&Source::new("domain", domain)).expect("a domain");
    let problem = parse_problem(&Source::new("problem", problem), &domain, None).expect("a problem");
    let limits = Limits { time: Some(Duration::from_secs(60)), ..Limits::default() };
    ground(Arc::new(domain), Arc::new(problem), &limits).expect("joins are quick")
}

#[test]
fn static_atoms_prune_parameters() {
    let task = chain(
        "(:action a :parameters (?a ?b ?c ?d ?e ?f)
        :precondition (and (next ?a ?b) (next ?b ?c) (next ?c ?d) (next ?d ?e) (next ?e ?f)) :effect (seen ?f))",
    );
    assert_eq!(task.operators.len(), OBJECTS - 5);
}

#[test]
fn only_what_can_be_reached_is_there() {
    let task = chain(
        "(:action go :parameters (?x ?y) :precondition (and (at ?x) (next ?x ?y) (not (seen ?y)))
        :effect (and (at ?y) (not (at ?x))))",
    );
    assert_eq!((task.operators.len(), task.facts.len()), (OBJECTS - 1, OBJECTS));
    let stuck = chain("(:action go :parameters (?x ?y) :precondition (and (seen ?x) (next ?x ?y)) :effect (seen ?y))");
    assert_eq!((stuck.operators.len(), stuck.facts.len()), (0, 0));
}

#[test]
fn disjunctions_and_existential_conditions_join_like_atoms() {
    let task = chain(
        "(:action a :parameters (?a ?b ?c ?d)
        :precondition (and (or (next ?a ?b) (and (at ?a) (at ?b))) (exists (?m ?n) (and (next ?b ?m) (next ?m ?n) (next ?n ?c)))
            (next ?c ?d))
        :effect (seen ?d))",
    );
    // Either a and b are neighbours, or both are o0; c is three after b and d one after c.
    assert_eq!(task.operators.len(), (OBJECTS - 5) + 1);
}

#[test]
fn an_operator_with_a_disjunction_is_one_operator() {
    let task =
        chain("(:action a :parameters (?x) :precondition (or (at ?x) (seen ?x) (next ?x ?x)) :effect (seen ?x))");
    assert_eq!(task.operators.len(), 1, "only o0 is at hand, and nothing is next to itself");
}

#[test]
fn conditional_effects_join_with_their_conditions() {
    let task = chain(
        "(:action go :parameters (?x) :precondition (at ?x)
        :effect (and (forall (?y ?z) (when (and (next ?x ?y) (next ?y ?z)) (mark ?y ?z))) (done)))",
    );
    assert_eq!((task.operators.len(), task.facts.len()), (1, 2), "one pair follows o0, and the task is done");
}

#[test]
fn universal_conditions_become_true_late() {
    let task = chain(
        "(:action see :parameters (?x ?y) :precondition (and (at ?x) (next ?x ?y)) :effect (and (seen ?y) (at ?y)))
        (:action end :precondition (forall (?x ?y) (imply (next ?x ?y) (seen ?y))) :effect (done))",
    );
    assert_eq!(task.operators.len(), OBJECTS - 1 + 1);
    assert_eq!(task.operators.last().map(|end| end.precondition.positive.len()), Some(OBJECTS - 1));
}

#[test]
fn a_recursive_axiom_is_grounded_where_it_holds() {
    let task = chain(
        "(:derived (linked ?x ?y) (or (next ?x ?y) (and (at ?x) (exists (?z) (and (linked ?x ?z) (next ?z ?y))))))
        (:action a :parameters (?x ?y) :precondition (and (at ?x) (linked ?x ?y)) :effect (seen ?y))",
    );
    assert_eq!(task.operators.len(), OBJECTS - 1, "from o0 to every other");
    assert!(task.facts.iter().all(|fact| task.domain.predicates[fact.predicate.index()].name == "seen"));
}
