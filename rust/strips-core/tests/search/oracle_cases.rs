//! Counts and digests of real tasks whose truth was computed independently, where they lie beside the checkout.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use num_bigint::BigUint;
use serde_json::Value;
use sha2::{Digest, Sha256};
use strips_core::pddl::{Source, parse_domain, parse_problem};
use strips_core::search::{PlanSet, Semantics};
use strips_core::task::{Limits, Task, ground};

use crate::laws::plan_set;

const FIELDS: [(&str, Semantics); 3] =
    [("all", Semantics::Any), ("first_goal", Semantics::FirstGoal), ("simple", Semantics::Simple)];

/// Plans that are listed to compare digests; the counts of larger sets are compared all the same.
const MOST_LISTED: u32 = 30_000;

/// The folder of cases: `STRIPS_ORACLE_CASES`, or beside the checkout; a worktree may lie one level deeper.
fn folder() -> Option<PathBuf> {
    let beside = ["../../../shared/oracle-cases", "../../../../shared/oracle-cases"];
    let beside = beside.map(|path| Path::new(env!("CARGO_MANIFEST_DIR")).join(path));
    let named = std::env::var_os("STRIPS_ORACLE_CASES").map(PathBuf::from);
    named.into_iter().chain(beside).find(|folder| folder.join("truth.json").is_file())
}

fn load(folder: &Path, case: &str) -> Arc<Task> {
    let source = |file: &str| {
        let path = folder.join("cases").join(case).join(file);
        let bytes = std::fs::read(&path).expect("the case has its files");
        Source::from_bytes(path.display().to_string(), bytes).expect("the case is UTF-8")
    };
    let (domain_source, problem_source) = (source("domain.pddl"), source("problem.pddl"));
    let domain = parse_domain(&domain_source).unwrap_or_else(|error| panic!("{error}"));
    let problem =
        parse_problem(&problem_source, &domain, Some(&domain_source)).unwrap_or_else(|error| panic!("{error}"));
    let task = ground(Arc::new(domain), Arc::new(problem), &Limits::default()).expect("the task is small");
    Arc::new(task)
}

/// The first half of the digest of all plans of one length, as the cases define it.
fn digest(set: &PlanSet, length: usize) -> String {
    let first: BigUint = set.counts()[..length].iter().sum();
    let range = first.clone()..first + &set.counts()[length];
    let plans = set.plans_flat(range, &Limits::default()).expect("a few thousand plans");
    let name = |operator: &strips_core::task::OperatorId| set.task().operator_name(*operator);
    let line = |plan: strips_core::search::Plan| plan.0.iter().map(name).collect::<Vec<_>>().join(" ") + "\n";
    let mut lines: Vec<String> = plans.iter().map(line).collect();
    lines.sort_unstable();
    let hash = Sha256::digest(lines.concat());
    hash.iter().take(16).fold(String::new(), |text, byte| text + &format!("{byte:02x}"))
}

fn check(set: &PlanSet, counts: &Value, digests: &Value, what: &str) {
    for (length, count) in set.counts().iter().enumerate() {
        if let Some(wanted) = counts[length].as_str() {
            assert_eq!(count.to_string(), wanted, "{what}, plans of {length} steps");
        }
        match digests[length].as_str() {
            Some(wanted) if *count <= BigUint::from(MOST_LISTED) => {
                assert_eq!(digest(set, length), wanted, "{what}, digest of {length} steps");
            }
            _ => {}
        }
    }
}

#[test]
fn counts_and_digests_are_the_independent_ones() {
    let Some(folder) = folder() else {
        println!("SKIPPED: no oracle cases beside the checkout, and STRIPS_ORACLE_CASES names none");
        return;
    };
    let text = std::fs::read_to_string(folder.join("truth.json")).expect("found above");
    let truth: BTreeMap<String, Value> = serde_json::from_str(&text).expect("the truth is JSON");
    for (case, truth) in &truth {
        let task = load(&folder, case);
        let horizon = truth["T"].as_u64().expect("each case has a horizon") as usize;
        for (field, semantics) in FIELDS {
            let what = format!("{case} {}", semantics.name());
            check(&plan_set(&task, horizon, semantics), &truth[field], &truth["digest"][field], &what);
        }
    }
}
