//! Any bytes as a problem of a domain with types and constants: read or refused.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use strips_core::pddl::ast::Domain;
use strips_core::pddl::{Source, parse_domain, parse_problem, print_problem};

static DOMAIN: LazyLock<Domain> = LazyLock::new(|| {
    let text = include_str!("../../tests/data/valid/hierarchy/domain.pddl");
    parse_domain(&Source::new("domain", text)).expect("the corpus is right")
});

fuzz_target!(|bytes: &[u8]| {
    let Ok(source) = Source::from_bytes("problem", bytes.to_vec()) else { return };
    if let Ok(mut problem) = parse_problem(&source, &DOMAIN, None) {
        let printed = Source::new("printed", print_problem(&problem, &DOMAIN));
        let mut again = parse_problem(&printed, &DOMAIN, None).expect("it was just printed");
        problem.warnings.clear();
        again.warnings.clear();
        assert_eq!(problem, again);
    }
});
