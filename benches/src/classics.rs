//! Tasks of the field's classics at any size, written as PDDL problems of our own domains and grounded.

use std::fmt::Write;
use std::sync::Arc;

use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, Task, ground};

const BLOCKSWORLD: &str = include_str!("../../python/strips_lm/domains/blocksworld/domain.pddl");
const GRIPPER: &str = include_str!("../../python/strips_lm/domains/gripper/domain.pddl");

/// Shopping for an evening: one of five things of each of five kinds, and two errands that undo nothing.
const EVENING: &str = "(define (domain evening) (:requirements :strips :typing) (:types kind thing - object)
  (:predicates (of ?t - thing ?k - kind) (have ?k - kind) (rewound) (counted))
  (:action rewind :effect (and (rewound)))
  (:action count :precondition (rewound) :effect (and (counted)))
  (:action get :parameters (?t - thing ?k - kind) :precondition (of ?t ?k) :effect (and (have ?k))))";

/// Blocks `0..blocks` in one tower, to be turned upside down.
pub fn blocksworld(blocks: usize) -> Arc<Task> {
    let (mut init, mut goal) = (format!("(handempty) (ontable b0) (clear b{})", blocks - 1), String::new());
    for upper in 1..blocks {
        let _ = write!(init, " (on b{upper} b{})", upper - 1);
        let _ = write!(goal, " (on b{} b{upper})", upper - 1);
    }
    task(BLOCKSWORLD, &format!("{} - block", names("b", blocks)), &init, &goal)
}

/// Two rooms, two grippers and so many balls to carry over.
pub fn gripper(balls: usize) -> Arc<Task> {
    let (mut init, mut goal) = ("(robot-in r0) (free g0) (free g1)".to_owned(), String::new());
    for ball in 0..balls {
        let _ = write!(init, " (in b{ball} r0)");
        let _ = write!(goal, " (in b{ball} r1)");
    }
    task(GRIPPER, &format!("r0 r1 - room g0 g1 - gripper {} - ball", names("b", balls)), &init, &goal)
}

/// The task of [`EVENING`]: 858,375,000 first plans of at most eight steps.
pub fn evening() -> Arc<Task> {
    let (mut init, mut goal) = (String::new(), "(counted)".to_owned());
    for kind in 0..5 {
        let _ = write!(goal, " (have k{kind})");
        for thing in 0..5 {
            let _ = write!(init, " (of t{} k{kind})", kind * 5 + thing);
        }
    }
    task(EVENING, &format!("{} - kind {} - thing", names("k", 5), names("t", 25)), &init, &goal)
}

fn names(letter: &str, count: usize) -> String {
    (0..count).map(|number| format!("{letter}{number}")).collect::<Vec<_>>().join(" ")
}

/// A problem of a domain, as PDDL.
pub fn problem_text(domain: &str, objects: &str, init: &str, goal: &str) -> String {
    let name = domain.split("(domain ").nth(1).and_then(|rest| rest.split(')').next()).unwrap_or_default();
    format!("(define (problem p) (:domain {name}) (:objects {objects}) (:init {init}) (:goal (and {goal})))")
}

fn task(domain: &str, objects: &str, init: &str, goal: &str) -> Arc<Task> {
    let source = |name: &str, text: &str| {
        Source::from_bytes(name.to_owned(), text.as_bytes().to_vec()).expect("the text is UTF-8")
    };
    let (domain_source, problem) = (source("domain", domain), problem_text(domain, objects, init, goal));
    let domain = parse_domain(&domain_source).expect("the domain is right");
    let problem = parse_problem(&source("problem", &problem), &domain, None).expect("the problem is right");
    Arc::new(ground(Arc::new(domain), Arc::new(problem), &Limits::default()).expect("the task is small"))
}
