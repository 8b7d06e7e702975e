//! Tasks and generators that the benches share. Holds no measurement itself.
//!
//! The domains are our own, of the kinds that the International Planning Competitions made standard: what makes each
//! hard to ground is named in its module. Every generated text is a function of (sizes, seed).

pub mod classics;
pub mod logistics;
pub mod pipeline;
pub mod survey;

/// A domain and a problem as PDDL text.
#[derive(Clone, Debug)]
pub struct Pddl {
    /// What it is, with its size.
    pub name: String,
    /// The domain's text.
    pub domain: String,
    /// The problem's text.
    pub problem: String,
}

impl Pddl {
    /// Puts a problem's parts together.
    pub fn new(name: String, domain: &str, objects: &[String], init: &[String], goal: &[String]) -> Self {
        let kind = domain.split(['(', ')']).find_map(|part| part.strip_prefix("domain ")).unwrap_or("unknown");
        let problem = format!(
            "(define (problem {name}) (:domain {kind})\n(:objects\n  {})\n(:init\n  {})\n(:goal (and\n  {})))\n",
            objects.join("\n  "),
            init.join("\n  "),
            goal.join("\n  ")
        );
        Self { name, domain: domain.to_owned(), problem }
    }
}

/// The tasks that grounding is measured on: one of each kind, small (some thousand operators) and large (some 100,000).
pub fn grounding_suite() -> Vec<Pddl> {
    vec![
        logistics::generate(4, 4, 2, 20, 1),
        logistics::generate(16, 9, 8, 120, 1),
        survey::generate(4, 20, 8, 6, 1),
        survey::generate(14, 90, 60, 24, 1),
        pipeline::generate(5, 12, 1),
        pipeline::generate(10, 60, 1),
    ]
}
