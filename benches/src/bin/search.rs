//! Measures search for the peer comparison.
//!
//! `search write DIR` writes the tasks as `DIR/NAME/{domain,problem}.pddl`; `search first DOMAIN PROBLEM` looks for a first
//! plan and explores all states, on one thread; `search explore DOMAIN PROBLEM THREADS` explores all states, the best of
//! three times on the clock; `search plans DOMAIN PROBLEM HORIZON` lists all plans. One JSON line.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use num_bigint::BigUint;
use strips_bench::classics::{blocksworld, evening, gripper};
use strips_bench::processor_seconds;
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::search::{PlanSet, Reach, Semantics, StateSpace, shortest_plan};
use strips_core::task::{Limits, Task, ground};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["write", folder] => write(Path::new(folder)),
        ["first", domain, problem] => first(domain, problem),
        ["explore", domain, problem, threads] => explore(domain, problem, threads.parse()?),
        ["plans", domain, problem, horizon] => plans(domain, problem, horizon.parse()?),
        _ => Err("usage: search write DIR | search first DOMAIN PROBLEM | search explore DOMAIN PROBLEM THREADS | \
            search plans DOMAIN PROBLEM HORIZON"
            .into()),
    }
}

fn write(folder: &Path) -> Result<(), Box<dyn Error>> {
    for task in [gripper(4), gripper(8), gripper(12), blocksworld(6), blocksworld(8), evening()] {
        let folder = folder.join(&task.name);
        fs::create_dir_all(&folder)?;
        fs::write(folder.join("domain.pddl"), task.domain)?;
        fs::write(folder.join("problem.pddl"), task.problem)?;
        println!("{}", task.name);
    }
    Ok(())
}

fn load(domain: &str, problem: &str) -> Result<Arc<Task>, Box<dyn Error>> {
    let domain_source = Source::from_bytes(domain, fs::read(domain)?)?;
    let problem_source = Source::from_bytes(problem, fs::read(problem)?)?;
    let domain = parse_domain(&domain_source)?;
    let problem = parse_problem(&problem_source, &domain, Some(&domain_source))?;
    Ok(Arc::new(ground(Arc::new(domain), Arc::new(problem), &Limits::default())?))
}

fn first(domain: &str, problem: &str) -> Result<(), Box<dyn Error>> {
    let (task, limits) = (load(domain, problem)?, Limits::default());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let start = processor_seconds();
    let plan = pool.install(|| shortest_plan(&task, None, &limits))?;
    let middle = processor_seconds();
    let space = pool.install(|| StateSpace::reachable(&task, Reach::default(), &limits))?;
    let end = processor_seconds();
    println!(
        "{{\"steps\":{},\"first_plan\":{:.6},\"states\":{},\"explore\":{:.6}}}",
        plan.map_or(-1, |plan| plan.len().cast_signed()),
        middle - start,
        space.len(),
        end - middle
    );
    Ok(())
}

fn explore(domain: &str, problem: &str, threads: usize) -> Result<(), Box<dyn Error>> {
    let (task, limits) = (load(domain, problem)?, Limits::default());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let (mut seconds, mut states) = (f64::INFINITY, 0);
    for _ in 0..3 {
        let start = Instant::now();
        states = pool.install(|| StateSpace::reachable(&task, Reach::default(), &limits))?.len();
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let beside = StateSpace::explore(&task, Reach::default(), &limits)?.bytes_beside_states() as f64 / states as f64;
    println!("{{\"states\":{states},\"seconds\":{seconds:.6},\"bytes_beside\":{beside:.1}}}");
    Ok(())
}

fn plans(domain: &str, problem: &str, horizon: usize) -> Result<(), Box<dyn Error>> {
    let (task, limits, start) = (load(domain, problem)?, Limits::default(), Instant::now());
    let processor = processor_seconds();
    let set = PlanSet::new(task, horizon, Semantics::Any, &limits)?;
    let plans = set.plans_flat(BigUint::ZERO..set.count(), &limits)?;
    println!(
        "{{\"plans\":{},\"seconds\":{:.6},\"processor\":{:.6}}}",
        plans.len(),
        start.elapsed().as_secs_f64(),
        processor_seconds() - processor
    );
    Ok(())
}
