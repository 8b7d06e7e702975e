//! Parsing what was printed gives the same tree, for random trees; and no text makes the parser panic.

mod common;

use common::random_task::{Features, random_task};
use proptest::prelude::*;
use strips_core::pddl::{Source, parse_domain, parse_problem, print_domain, print_problem};

fn words() -> impl Strategy<Value = String> {
    let word = prop::sample::select(vec![
        "(",
        "(",
        "(",
        ")",
        ")",
        ")",
        "define",
        "domain",
        "problem",
        "d",
        ":action",
        ":predicates",
        ":types",
        ":init",
        ":goal",
        ":objects",
        ":domain",
        ":parameters",
        ":precondition",
        ":effect",
        "and",
        "or",
        "not",
        "forall",
        "when",
        "exists",
        "imply",
        "either",
        "?x",
        "?y",
        "-",
        "p",
        "q",
        "t",
        "=",
        "1",
        ";",
        "\n",
        "object",
        ":derived",
        "total-cost",
        "increase",
        ":functions",
        ":metric",
        "minimize",
        ":constants",
    ]);
    prop::collection::vec(word, 0..60).prop_map(|words| words.join(" "))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn parse_after_print_is_the_identity(seed: u64) {
        let (domain, problem) = random_task(seed, Features::ADL);
        let text = print_domain(&domain);
        let mut again = parse_domain(&Source::new("domain", text)).unwrap_or_else(|error| panic!("{error}"));
        again.warnings.clear();
        prop_assert_eq!(&again, &*domain);
        let text = print_problem(&problem, &domain);
        let mut again = parse_problem(&Source::new("problem", text), &again, None).unwrap_or_else(|e| panic!("{e}"));
        again.warnings.clear();
        prop_assert_eq!(&again, &*problem);
    }

    #[test]
    fn every_text_is_read_or_refused(text in words()) {
        let source = Source::new("x", format!("(define (domain d) {text}"));
        if let Err(error) = parse_domain(&source) {
            let place = format!("x:{}:{}: ", error.line, error.column);
            prop_assert!(error.to_string().starts_with(&place));
        }
        let (domain, _) = random_task(1, Features::ADL);
        let source = Source::new("x", format!("(define (problem d) (:domain d) {text}"));
        if let Err(error) = parse_problem(&source, &domain, None) {
            prop_assert!(error.line >= 1 && error.column >= 1);
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes: Vec<u8>) {
        if let Ok(source) = Source::from_bytes("x", bytes) {
            prop_assert!(parse_domain(&source).is_err());
        }
    }
}

#[test]
fn nesting_up_to_the_cap_is_handled_on_an_ordinary_stack() {
    let depth = 250;
    let condition = format!("{}(p){}", "(not ".repeat(depth), ")".repeat(depth));
    let effect = format!("{}(p){}", "(when (p) ".repeat(depth), ")".repeat(depth));
    let text = format!("(define (domain d) (:predicates (p)) (:action a :precondition {condition} :effect {effect}))");
    let domain = parse_domain(&Source::new("deep", text)).unwrap_or_else(|error| panic!("{error}"));
    let again = parse_domain(&Source::new("again", print_domain(&domain))).expect("it was just printed");
    assert_eq!(domain, again);
}

#[test]
fn a_long_chain_of_types_is_no_deep_recursion() {
    let chain = (1..20_000).map(|n| format!("t{n} - t{}", n - 1)).collect::<Vec<_>>().join(" ");
    let text = format!(
        "(define (domain d) (:types t0 - object {chain}) (:constants c - t19999) (:predicates (p ?x - t0) (q ?x - t19999))
         (:action a :precondition (p c) :effect (q c)))"
    );
    let domain = parse_domain(&Source::new("chain", text)).unwrap_or_else(|error| panic!("{error}"));
    assert!(domain.is_subtype(domain.type_id("t19999").expect("declared"), domain.type_id("t0").expect("declared")));
}
