//! Third-party tasks, where they are at hand (`../shared/oracle-cases`): a plain forward search over the grounded task
//! must find the states, operators and sequence counts that others computed.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use num_bigint::BigUint;
use serde_json::Value;
use strips_core::pddl::{PddlError, Source, parse_domain, parse_problem};
use strips_core::task::{Limits, State, Task, ground};

fn root() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/oracle-cases");
    if !root.is_dir() {
        eprintln!("SKIPPED: {} is not there", root.display());
        return None;
    }
    Some(root)
}

fn task(folder: &Path) -> Result<Task, PddlError> {
    let read = |name: &str| Source::from_bytes(name, fs::read(folder.join(name)).expect("a file of a case"));
    let domain_source = read("domain.pddl")?;
    let domain = parse_domain(&domain_source)?;
    let problem = parse_problem(&read("problem.pddl")?, &domain, Some(&domain_source))?;
    Ok(ground(Arc::new(domain), Arc::new(problem), &Limits::default()).expect("within limits"))
}

/// How many states are reached in at most `longest` steps, and how many operators can be used on the way.
fn explore(task: &Task, longest: usize) -> (usize, usize) {
    let mut seen: HashSet<State> = HashSet::from([task.init.clone()]);
    let mut layer = vec![task.init.clone()];
    let mut used = HashSet::new();
    for _ in 0..longest {
        for state in std::mem::take(&mut layer) {
            for (number, operator) in task.operators.iter().enumerate().filter(|(_, it)| it.applicable(&state)) {
                used.insert(number);
                let next = task.apply(operator, &state);
                if seen.insert(next.clone()) {
                    layer.push(next);
                }
            }
        }
    }
    (seen.len(), used.len())
}

/// For each length, how many executable sequences there are and how many of them end in a goal state.
fn sequences(task: &Task, longest: usize) -> Vec<(BigUint, BigUint)> {
    let mut layer: HashMap<State, BigUint> = HashMap::from([(task.init.clone(), BigUint::from(1u32))]);
    let mut counts = Vec::new();
    for _ in 0..=longest {
        let goals = layer.iter().filter(|(state, _)| task.goal.holds(state)).map(|(_, count)| count);
        counts.push((layer.values().sum(), goals.sum()));
        let mut next: HashMap<State, BigUint> = HashMap::new();
        for (state, count) in &layer {
            for operator in task.operators.iter().filter(|operator| operator.applicable(state)) {
                *next.entry(task.apply(operator, state)).or_default() += count;
            }
        }
        layer = next;
    }
    counts
}

fn check(name: &str, task: &Task, truth: &Value) {
    let longest = truth["T"].as_u64().expect("a number") as usize;
    let (states, used) = explore(task, longest);
    assert_eq!(used as u64, truth["n_ops_applicable"].as_u64().expect("a number"), "{name}: operators");
    assert_eq!(states as u64, truth["n_states"].as_u64().expect("a number"), "{name}: states");
    for (length, (executable, goal)) in sequences(task, longest).into_iter().enumerate() {
        assert_eq!(truth["executable"][length], executable.to_string(), "{name}: sequences of length {length}");
        assert_eq!(truth["all"][length], goal.to_string(), "{name}: plans of length {length}");
    }
}

#[test]
fn third_party_tasks_have_the_known_states_operators_and_counts() {
    let Some(root) = root() else { return };
    let truth = fs::read_to_string(root.join("truth.json")).expect("the truth");
    let truth: BTreeMap<String, Value> = serde_json::from_str(&truth).expect("JSON");
    for (name, truth) in &truth {
        match task(&root.join("cases").join(name)) {
            Ok(task) => check(name, &task, truth),
            Err(error) if truth["group"] == "lenient" => eprintln!("refused: {error}"),
            Err(error) => panic!("{error}"),
        }
    }
}
