//! Third-party PDDL files, where they are at hand: `../shared/oracle-cases` beside the repository.

use std::fs;
use std::path::{Path, PathBuf};

use strips_core::pddl::{PddlError, Source, parse_domain, parse_problem, print_domain, print_problem};

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
