//! The project's own PDDL corpus, `tests/data`: what is valid parses and prints back, what is not gets its diagnostic.
//!
//! The diagnostic of each invalid file lies beside it. `UPDATE_SNAPSHOTS=1 cargo test` writes them anew.

use std::fs;
use std::path::{Path, PathBuf};

use strips_core::pddl::ast::{Domain, Problem, Warning};
use strips_core::pddl::{PddlError, Source, parse_domain, parse_problem, print_domain, print_problem};

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data")
}

fn entries(folder: &str) -> Vec<PathBuf> {
    let read = fs::read_dir(data().join(folder)).expect("the corpus is part of the repository");
    let mut paths: Vec<PathBuf> = read.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths
}

/// The file under the name that diagnostics call it by.
fn source(path: &Path) -> Result<Source, PddlError> {
    let name = path.strip_prefix(data()).expect("a path in the corpus").display().to_string();
    Source::from_bytes(name, fs::read(path).expect("a file of the corpus"))
}

fn parse(folder: &Path) -> Result<(Domain, Problem), PddlError> {
    let domain_source = source(&folder.join("domain.pddl"))?;
    let domain = parse_domain(&domain_source)?;
    let problem = parse_problem(&source(&folder.join("problem.pddl"))?, &domain, Some(&domain_source))?;
    Ok((domain, problem))
}

#[test]
fn parse_after_print_is_the_identity() {
    for folder in entries("valid") {
        let (mut domain, mut problem) = parse(&folder).unwrap_or_else(|error| panic!("{error}"));
        let printed = print_domain(&domain);
        let mut again =
            parse_domain(&Source::new("printed", printed.clone())).unwrap_or_else(|error| panic!("{error}"));
        let text = print_problem(&problem, &domain);
        let mut problem_again =
            parse_problem(&Source::new("printed", text), &again, None).expect("it was just printed");
        assert_eq!(printed, print_domain(&again), "{}", folder.display());
        let kept = [&mut domain.warnings, &mut again.warnings, &mut problem.warnings, &mut problem_again.warnings];
        kept.into_iter().for_each(Vec::clear);
        assert_eq!(domain, again, "{}", folder.display());
        assert_eq!(problem, problem_again, "{}", folder.display());
    }
}

#[test]
fn what_the_standard_forbids_and_we_accept_is_warned_of() {
    for folder in entries("valid") {
        let (domain, problem) = parse(&folder).unwrap_or_else(|error| panic!("{error}"));
        let lines = |name: &str, warnings: &[Warning]| {
            let source = source(&folder.join(name)).expect("it was just read");
            let line = |warning: &Warning| {
                let (line, column) = source.position(warning.span.start());
                format!("{}:{line}:{column}: {}\n", source.name(), warning.message)
            };
            warnings.iter().map(line).collect::<String>()
        };
        let all = lines("domain.pddl", &domain.warnings) + &lines("problem.pddl", &problem.warnings);
        compare(&folder.join("warnings.txt"), &all);
    }
}

#[test]
fn every_mistake_gets_its_diagnostic() {
    let blocks = source(&data().join("valid/blocks/domain.pddl")).expect("UTF-8");
    let blocks = parse_domain(&blocks).expect("a right domain");
    for path in entries("invalid").into_iter().filter(|path| path.extension().is_none_or(|kind| kind == "pddl")) {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let outcome = match name.split('-').next() {
            _ if path.is_dir() => parse(&path).map(|_| ()),
            Some("domain") => source(&path).and_then(|source| parse_domain(&source)).map(|_| ()),
            _ => source(&path).and_then(|source| parse_problem(&source, &blocks, None)).map(|_| ()),
        };
        let error = outcome.expect_err(&format!("{name} is accepted"));
        compare(&path.with_extension("txt"), &format!("{error}\n"));
    }
}

fn compare(path: &Path, text: &str) {
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        fs::write(path, text).expect("the corpus is writable");
    }
    let expected = fs::read_to_string(path).unwrap_or_default();
    assert_eq!(expected, text, "the snapshot {} differs; UPDATE_SNAPSHOTS=1 writes it anew", path.display());
}
