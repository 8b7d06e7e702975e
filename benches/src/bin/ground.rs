//! Measures parsing and grounding for the peer comparison.
//!
//! `ground write DIR` writes the suite as `DIR/NAME/{domain,problem}.pddl`; `ground DOMAIN PROBLEM` grounds two files and
//! prints one JSON line with counts and seconds.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use strips_bench::grounding_suite;
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::task::{Limits, ground};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [command, folder] if command == "write" => write(Path::new(folder)),
        [domain, problem] => measure(domain, problem),
        _ => Err("usage: ground write DIR | ground DOMAIN PROBLEM".into()),
    }
}

fn write(folder: &Path) -> Result<(), Box<dyn Error>> {
    for task in grounding_suite() {
        let folder = folder.join(&task.name);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join("domain.pddl"), task.domain)?;
        fs::write(folder.join("problem.pddl"), task.problem)?;
        println!("{}", task.name);
    }
    Ok(())
}

fn measure(domain: &str, problem: &str) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    let domain_source = Source::from_bytes(domain, fs::read(domain)?)?;
    let problem_source = Source::from_bytes(problem, fs::read(problem)?)?;
    let domain = parse_domain(&domain_source)?;
    let problem = parse_problem(&problem_source, &domain, Some(&domain_source))?;
    let parsed = start.elapsed().as_secs_f64();
    let task = ground(Arc::new(domain), Arc::new(problem), &Limits::default())?;
    let total = start.elapsed().as_secs_f64();
    println!(
        "{{\"operators\":{},\"facts\":{},\"parse\":{parsed:.6},\"ground\":{:.6},\"total\":{total:.6}}}",
        task.operators.len(),
        task.facts.len(),
        total - parsed
    );
    Ok(())
}
