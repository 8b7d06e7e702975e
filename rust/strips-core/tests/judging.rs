//! Generated texts, judged: verdicts, words for actions, and states against the true ones.

use std::collections::HashMap;
use std::sync::Arc;

use strips_core::pddl::ast::Domain;
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, ground};
use strips_core::validate::{Judge, JudgeError, Judgement, Outcome, Validator, validate_each};

const DOMAIN: &str = include_str!("../../../tests/data/valid/blocks/domain.pddl");

const PROBLEM: &str = "(define (problem two) (:domain blocks) (:objects a b - block)
    (:init (on-table a) (on-table b) (clear a) (clear b) (hand-empty)) (:goal (on a b)))";

/// A right completion: both steps, both states.
const RIGHT: &str = "<ACTION> grab(a) <STATE> on-table(b), clear(b), holding(a) \
    <ACTION> put(a, b) <STATE> on(a, b), on-table(b), clear(a), hand-empty() <|endoftext|>";

fn domain() -> Arc<Domain> {
    Arc::new(parse_domain(&Source::new("domain", DOMAIN)).expect("the corpus is right"))
}

fn words() -> HashMap<String, String> {
    HashMap::from([("grab".to_owned(), "lift".to_owned())])
}

fn judge(completion: &str) -> Judgement {
    let oracle = Judge::new(&domain(), &[PROBLEM], vec![words()], &Limits::default()).expect("the problem is right");
    let judged = oracle.judge(&[(0, completion)], &Limits::default()).expect("there is no limit");
    judged.into_iter().next().expect("one for one")
}

#[test]
fn a_right_text_is_valid_and_all_its_states_are_right() {
    let judgement = judge(RIGHT);
    assert_eq!(judgement.verdict.outcome, Outcome::Valid, "{}", judgement.verdict.reason);
    assert_eq!(judgement.plan, "(lift a)\n(put a b)\n");
    assert!(judgement.finished);
    assert_eq!((judgement.steps, judgement.executable_steps), (2, 2));
    assert_eq!((judgement.trace.states, judgement.trace.right, judgement.trace.first_wrong), (2, 2, None));
}

#[test]
fn a_plan_may_be_valid_while_its_states_are_wrong() {
    let judgement = judge(&RIGHT.replace("on-table(b), clear(b), holding(a)", "on-table(b), holding(b), flying(a)"));
    assert!(judgement.verdict.is_valid());
    let trace = judgement.trace;
    assert_eq!((trace.states, trace.right, trace.first_wrong), (2, 1, Some(1)));
    assert_eq!(trace.missing, ["(clear b)", "(holding a)"]);
    assert_eq!(trace.surplus, ["(flying a)", "(holding b)"]);
}

#[test]
fn order_and_repetition_of_atoms_do_not_make_a_state_wrong() {
    let judgement = judge(&RIGHT.replace("on-table(b), clear(b)", "clear(b), on-table(b), clear(b)"));
    assert_eq!(judgement.trace.right, 2);
}

#[test]
fn states_after_a_step_that_cannot_be_applied_are_never_right() {
    let judgement = judge(&RIGHT.replace("grab(a)", "put(a, b)"));
    assert_eq!((judgement.verdict.outcome, judgement.verdict.step), (Outcome::Inapplicable, Some(1)));
    assert_eq!(judgement.verdict.missing, ["(holding a)"]);
    assert_eq!((judgement.executable_steps, judgement.trace.right, judgement.trace.first_wrong), (0, 0, Some(1)));
}

#[test]
fn a_text_that_breaks_off_is_judged_by_its_steps_and_a_malformed_one_is_not() {
    let (first, _) = RIGHT.split_once(" <ACTION> put").expect("two steps");
    let broken = judge(first);
    assert_eq!((broken.verdict.outcome, broken.finished, broken.steps), (Outcome::GoalNotReached, false, 1));
    let malformed = judge(&RIGHT.replace("put(a, b)", "put(a, b"));
    assert_eq!((malformed.verdict.outcome, malformed.executable_steps), (Outcome::Syntax, 1));
}

#[test]
fn unknown_words_objects_and_arities_are_told_apart() {
    let outcome = |from: &str, to: &str| judge(&RIGHT.replace(from, to)).verdict.outcome;
    assert_eq!(outcome("grab(", "seize("), Outcome::UnknownAction);
    assert_eq!(outcome("grab(a)", "grab(c)"), Outcome::UnknownObject);
    assert_eq!(outcome("grab(a)", "grab(a, b)"), Outcome::Arity);
}

#[test]
fn a_wrong_problem_is_an_error_and_so_are_lists_that_differ() {
    let no_problem = Judge::new(&domain(), &["(define"], vec![words()], &Limits::default());
    assert!(matches!(no_problem, Err(JudgeError::Pddl(_))));
    let two_lists = Judge::new(&domain(), &[PROBLEM], vec![words(), words()], &Limits::default());
    assert!(matches!(two_lists, Err(JudgeError::Lengths { problems: 1, words: 2 })));
}

#[test]
fn problems_are_judged_by_their_numbers_in_any_order_and_as_often_as_asked() {
    let other = PROBLEM.replace("(on a b)", "(holding a)");
    assert_ne!(other, PROBLEM);
    let oracle = Judge::new(&domain(), &[PROBLEM, &other, PROBLEM], vec![words(); 3], &Limits::default())
        .expect("the problems are right");
    let judged = oracle.judge(&[(1, RIGHT), (2, RIGHT), (0, RIGHT), (1, RIGHT)], &Limits::default());
    let valid: Vec<bool> = judged.expect("there is no limit").iter().map(|j| j.verdict.is_valid()).collect();
    assert_eq!(valid, [false, true, true, false]);
}

#[test]
fn each_plan_may_have_a_task_of_its_own() {
    let validator = |goal: &str| {
        let text = PROBLEM.replace("(on a b)))", goal);
        let problem = parse_problem(&Source::new("problem", text), &domain(), None).expect("a right problem");
        Validator::new(Arc::new(ground(domain(), Arc::new(problem), &Limits::default()).expect("a small task")))
    };
    let (onto_b, onto_a) = (validator("(on a b)))"), validator("(on b a)))"));
    let plan = "(lift a)\n(put a b)";
    let verdicts = validate_each(&[(&onto_b, plan), (&onto_a, plan)]);
    assert_eq!(
        verdicts.iter().map(|verdict| verdict.outcome.name()).collect::<Vec<_>>(),
        ["valid", "goal_not_reached"]
    );
}
