//! Tasks and generators that the benches share. Holds no measurement itself.
//!
//! The domains are our own, of the kinds that the International Planning Competitions made standard: what makes each
//! hard to ground is named in its module. Every generated text is a function of (sizes, seed).

pub mod classics;
pub mod logistics;
pub mod pipeline;
pub mod survey;

use std::sync::Arc;

use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, Task, ground};

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

impl Pddl {
    /// The grounded task.
    ///
    /// # Panics
    /// When the text is wrong.
    pub fn grounded(&self) -> Arc<Task> {
        let source = |text: &str| Source::from_bytes(self.name.as_str(), text.as_bytes().to_vec()).expect("UTF-8");
        let domain = parse_domain(&source(&self.domain)).expect("the domain is right");
        let problem = parse_problem(&source(&self.problem), &domain, None).expect("the problem is right");
        Arc::new(ground(Arc::new(domain), Arc::new(problem), &Limits::default()).expect("within limits"))
    }
}

/// Time that this process's threads have had a processor; not a number where the system does not tell.
pub fn processor_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let nanoseconds = |thread: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(thread.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    threads.flatten().filter_map(nanoseconds).sum::<f64>() / 1e9
}

/// The tasks that grounding is measured on: a tiny one of the kind
/// that data sets are made of, and of each kind a small one (some thousand operators) and a large one (some 100,000).
pub fn grounding_suite() -> Vec<Pddl> {
    vec![
        kitchen(),
        logistics::generate(4, 4, 2, 20, 1),
        logistics::generate(16, 9, 8, 120, 1),
        survey::generate(4, 20, 8, 6, 1),
        survey::generate(14, 90, 60, 24, 1),
        pipeline::generate(5, 12, 1),
        pipeline::generate(10, 60, 1),
    ]
}

/// The manipulation domain with five movable things.
fn kitchen() -> Pddl {
    let domain = include_str!("../../python/strips_lm/domains/manipulation/domain.pddl");
    let strings = |parts: &[&str]| parts.iter().map(|&part| part.to_owned()).collect::<Vec<_>>();
    let objects = ["shelf - fixture", "pot - vessel", "crate - container", "tongs - tool", "cup plum - movable"];
    let init = [
        "(inworkspace table) (inworkspace pot) (inworkspace crate) (inworkspace tongs) (inworkspace cup)",
        "(on pot shelf) (on crate table) (on tongs table) (on cup shelf) (on plum table)",
    ];
    let goal = ["(on cup pot)", "(on pot table)", "(opened pot)"];
    Pddl::new("kitchen-5".to_owned(), domain, &strings(&objects), &strings(&init), &strings(&goal))
}
