//! Any text as a plan: a verdict, the same on the fast way and the slow one.
#![no_main]

use std::sync::{Arc, LazyLock};

use libfuzzer_sys::fuzz_target;
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, ground};
use strips_core::validate::{Validator, validate};

static VALIDATOR: LazyLock<Validator> = LazyLock::new(|| {
    let domain = include_str!("../../tests/data/valid/blocks/domain.pddl");
    let problem = include_str!("../../tests/data/valid/blocks/problem.pddl");
    let domain = parse_domain(&Source::new("domain", domain)).expect("the corpus is right");
    let problem = parse_problem(&Source::new("problem", problem), &domain, None).expect("the corpus is right");
    Validator::new(Arc::new(ground(Arc::new(domain), Arc::new(problem), &Limits::default()).expect("a small task")))
});

fuzz_target!(|text: &str| {
    assert_eq!(VALIDATOR.validate(text), validate(VALIDATOR.task(), text));
});
