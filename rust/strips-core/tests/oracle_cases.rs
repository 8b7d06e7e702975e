//! Third-party PDDL files, where they are at hand: `../shared/oracle-cases` beside the repository.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use strips_core::pddl::{PddlError, Source, parse_domain, parse_problem, print_domain, print_problem};
use strips_core::task::{Limits, ground};
use strips_core::validate::{Validator, validate};

fn cases() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/oracle-cases");
    if !root.is_dir() {
        eprintln!("SKIPPED: {} is not there", root.display());
        return None;
    }
    Some(root)
}

fn folders(root: &Path) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> =
        fs::read_dir(root).expect("a folder of cases").map(|entry| entry.expect("an entry").path()).collect();
    folders.retain(|path| path.is_dir());
    folders.sort();
    folders
}

fn source(path: &Path) -> Result<Source, PddlError> {
    Source::from_bytes(path.display().to_string(), fs::read(path).expect("a file of a case"))
}

fn parse(folder: &Path) -> Result<(), PddlError> {
    let domain_source = source(&folder.join("domain.pddl"))?;
    let mut domain = parse_domain(&domain_source)?;
    let problem_source = source(&folder.join("problem.pddl"))?;
    let mut problem = parse_problem(&problem_source, &domain, Some(&domain_source))?;
    let mut again = parse_domain(&Source::new("printed", print_domain(&domain)))?;
    let mut problem_again = parse_problem(&Source::new("printed", print_problem(&problem, &domain)), &again, None)?;
    (domain.warnings, again.warnings) = (Vec::new(), Vec::new());
    (problem.warnings, problem_again.warnings) = (Vec::new(), Vec::new());
    assert_eq!(domain, again, "parse after print is the identity: {}", folder.display());
    assert_eq!(problem, problem_again, "parse after print is the identity: {}", folder.display());
    Ok(())
}

#[test]
fn real_files_parse() {
    let Some(root) = cases() else { return };
    for folder in folders(&root.join("cases")) {
        let lenient = folder.display().to_string().contains("lenient");
        match parse(&folder) {
            Ok(()) => {}
            Err(error) if lenient => eprintln!("refused: {error}"),
            Err(error) => panic!("{error}"),
        }
    }
}

#[test]
fn malformed_files_are_refused_where_they_are_wrong() {
    let Some(root) = cases() else { return };
    let text = fs::read_to_string(root.join("malformed/expected.json")).expect("expectations");
    let expected: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for folder in folders(&root.join("malformed")) {
        let name = folder.file_name().expect("a name").to_string_lossy().into_owned();
        let case = &expected[&name];
        let outcome = parse(&folder);
        match case["expect"].as_str().expect("an expectation") {
            "accept" => assert!(outcome.is_ok(), "{name}: {}", outcome.expect_err("refused")),
            "reject" => {
                let error = outcome.err().unwrap_or_else(|| panic!("{name} is accepted: {}", case["reason"]));
                if let Some(range) = case["line"].as_array() {
                    let bound = |index: usize| range[index].as_u64().expect("a line") as usize;
                    assert!((bound(0)..=bound(1)).contains(&error.line), "{name}: {range:?} {error}");
                }
                println!("{error}\n");
            }
            _ => println!("{name}: {outcome:?}"),
        }
    }
}

fn validator(folder: &Path) -> Validator {
    let domain = parse_domain(&source(&folder.join("domain.pddl")).expect("UTF-8")).expect("a right domain");
    let problem_source = source(&folder.join("problem.pddl")).expect("UTF-8");
    let problem = parse_problem(&problem_source, &domain, None).expect("a right problem");
    let task = ground(Arc::new(domain), Arc::new(problem), &Limits::default()).expect("a small task");
    Validator::new(Arc::new(task))
}

#[test]
fn plans_get_the_verdicts_that_others_gave_them() {
    let Some(root) = cases() else { return };
    let text = fs::read_to_string(root.join("plans/expected.json")).expect("expectations");
    let expected: Vec<serde_json::Value> = serde_json::from_str(&text).expect("JSON");
    for case in &expected {
        let field = |name: &str| case[name].as_str().expect("a string");
        let validator = validator(&root.join("cases").join(field("case")));
        let plan = fs::read_to_string(root.join("plans").join(field("file"))).expect("a plan");
        let verdict = validator.validate(&plan);
        assert_eq!(verdict, validate(validator.task(), &plan), "the fast and the slow way agree");
        let wanted = match field("reason") {
            "precondition" => "inapplicable",
            "goal" => "goal_not_reached",
            other => other,
        };
        assert_eq!(verdict.outcome.name(), wanted, "{} {verdict:?}", field("file"));
        if let Some(step) = case["step"].as_u64() {
            assert_eq!(verdict.step, Some(step as usize), "{} {verdict:?}", field("file"));
        }
        if wanted != "goal_not_reached" {
            assert_eq!(verdict.line, case["line"].as_u64().map(|line| line as usize), "{}", field("file"));
        }
        let missing: Vec<&str> = case["missing"].as_array().into_iter().flatten().filter_map(|m| m.as_str()).collect();
        if missing != ["<formula>"] {
            assert_eq!(verdict.missing, missing, "{}", field("file"));
        }
        println!("{}: {}", field("file"), verdict.reason);
    }
}
