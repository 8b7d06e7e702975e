//! The whole path: a domain, a problem and a plan, split at NUL bytes; parsed, grounded within limits, validated.
#![no_main]

use std::sync::Arc;
use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, ground};
use strips_core::validate::validate;

fuzz_target!(|text: &str| {
    let mut parts = text.splitn(3, '\0');
    let mut next = || Source::new("part", parts.next().unwrap_or_default());
    let (domain, problem, plan) = (next(), next(), next());
    let Ok(domain) = parse_domain(&domain) else { return };
    let Ok(problem) = parse_problem(&problem, &domain, None) else { return };
    let limits = Limits {
        operators: 10_000,
        facts: 10_000,
        bytes: 1 << 28,
        time: Some(Duration::from_secs(1)),
        ..Limits::default()
    };
    if let Ok(task) = ground(Arc::new(domain), Arc::new(problem), &limits) {
        let _ = validate(&task, plan.text());
    }
});
