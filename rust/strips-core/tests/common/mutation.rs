//! Texts of the project's own corpus with a few tokens or lists changed: what people write by mistake.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

use strips_core::pddl::ast::{Domain, Problem};
use strips_core::pddl::{PddlError, Source, parse_domain, parse_problem, print_domain, print_problem};
use strips_core::random::Random;

/// Domain and problem of each valid folder.
static CORPUS: LazyLock<Vec<[String; 2]>> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/valid");
    let entries = fs::read_dir(folder).expect("the corpus is part of the repository");
    let mut folders: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    folders.sort();
    let read = |path: PathBuf| fs::read_to_string(path).expect("a file of the corpus");
    folders.iter().map(|path| ["domain.pddl", "problem.pddl"].map(|name| read(path.join(name)))).collect()
});

/// What may come to stand anywhere.
const STRAYS: [&str; 24] = [
    "(",
    ")",
    "()",
    "and",
    "or",
    "not",
    "imply",
    "forall",
    "exists",
    "when",
    "either",
    "object",
    "=",
    "-",
    "?x",
    "?",
    ":",
    "1",
    ":init",
    ":goal",
    ":parameters",
    ":precondition",
    ":effect",
    "\u{e9}\u{1f600}",
];

/// A domain and a problem, one of them changed in one to three places, where they are still accepted.
///
/// # Panics
/// Panics where a text is refused without a place within it, or accepted but printed as another.
pub fn accepted_mutation(seed: u64) -> Option<(Arc<Domain>, Arc<Problem>)> {
    let mut random = Random::new(seed, 2);
    let mut texts = random.choice(&CORPUS).clone();
    let changed = random.below(2);
    texts[changed] = mutate(&texts[changed], &mut random);
    let [domain_text, problem_text] = texts;
    let mut domain = checked(&domain_text, parse_domain(&Source::new("domain", domain_text.clone())))?;
    let read = |text: &str, domain: &Domain| parse_problem(&Source::new("problem", text.to_owned()), domain, None);
    let mut problem = checked(&problem_text, read(&problem_text, &domain))?;
    let printed = print_domain(&domain);
    let mut domain_again =
        parse_domain(&Source::new("printed", printed.clone())).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(printed, print_domain(&domain_again), "of {domain_text}");
    let printed = print_problem(&problem, &domain);
    let mut problem_again = read(&printed, &domain_again).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(printed, print_problem(&problem_again, &domain_again), "of {problem_text}");
    let kept = [&mut domain.warnings, &mut domain_again.warnings, &mut problem.warnings, &mut problem_again.warnings];
    kept.into_iter().for_each(Vec::clear);
    assert_eq!(domain, domain_again, "of {domain_text}");
    assert_eq!(problem, problem_again, "of {problem_text}");
    Some((Arc::new(domain), Arc::new(problem)))
}

/// What was read, if it was; else the refusal must say where.
fn checked<T>(text: &str, read: Result<T, PddlError>) -> Option<T> {
    read.map_err(|error| {
        let said = error.to_string();
        assert!(said.contains(&format!("{}:{}:{}: ", error.file, error.line, error.column)), "{said}");
        assert!(1 <= error.line && error.line <= text.lines().count().max(1), "{said} of {text}");
        assert!(text.get(error.span.start()..error.span.end()).is_some(), "{said} of {text}");
    })
    .ok()
}

/// One to three changes, most of which leave the parentheses in balance.
fn mutate(text: &str, random: &mut Random) -> String {
    let mut tokens = tokens(text);
    for _ in 0..=random.below(3) {
        let is_list = random.chance(0.4);
        let places: Vec<usize> = (0..tokens.len()).filter(|&place| starts(&tokens[place], is_list)).collect();
        if places.is_empty() {
            break;
        }
        let (at, other) = (*random.choice(&places), *random.choice(&places));
        let (part, other_part) = (list_at(&tokens, at), list_at(&tokens, other));
        let copy = tokens[other_part].to_vec();
        match random.below(16) {
            0 => drop(tokens.remove(at)),
            1 => tokens.truncate(at + 1),
            2 => tokens.insert(at, (*random.choice(&STRAYS)).to_owned()),
            3 => drop(tokens.splice(at..=at, [(*random.choice(&STRAYS)).to_owned()])),
            4 | 5 => drop(tokens.drain(part)),
            6..9 => drop(tokens.splice(at..at, copy)),
            9..12 if !is_list => tokens.swap(at, other),
            _ => drop(tokens.splice(part, copy)),
        }
    }
    tokens.chunks(9).map(|line| line.join(" ") + "\n").collect()
}

fn starts(token: &str, list: bool) -> bool {
    if list { token == "(" } else { token != "(" && token != ")" }
}

/// Parentheses and words, without comments.
fn tokens(text: &str) -> Vec<String> {
    let code = text.trim_start_matches('\u{feff}').lines().map(|line| line.split(';').next().unwrap_or_default());
    let spaced = code.collect::<Vec<_>>().join("\n").replace('(', " ( ").replace(')', " ) ");
    spaced.split_whitespace().map(str::to_owned).collect()
}

/// The list that begins at a token, or the token alone where none does.
fn list_at(tokens: &[String], at: usize) -> std::ops::Range<usize> {
    let mut depth = 0_i32;
    for (place, token) in tokens.iter().enumerate().skip(at) {
        depth += i32::from(token == "(") - i32::from(token == ")");
        if depth <= 0 {
            return at..place + 1;
        }
    }
    at..tokens.len()
}
