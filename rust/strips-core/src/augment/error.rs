//! What can be wrong with a lexicon, and where.

use std::fmt;

use crate::pddl::Source;

/// A lexicon that was refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LexiconError {
    /// What is wrong.
    pub kind: LexiconErrorKind,
    /// The name of the source.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1, in characters.
    pub column: usize,
    excerpt: String,
}

/// What is wrong with a lexicon.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LexiconErrorKind {
    /// It is no TOML.
    #[error("{0}")]
    Toml(String),
    /// A table that a lexicon does not have.
    #[error("no table `{0}` in a lexicon; there are `objects`, `actions` and `predicates`")]
    UnknownTable(String),
    /// A list other than the two.
    #[error("no list `{0}`; there are `trained` and `held_out`")]
    UnknownList(String),
    /// A table for a type, action or predicate that the domain lacks.
    #[error("the domain has no {what} `{name}`")]
    Undeclared {
        /// `type`, `action` or `predicate`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// Another kind of value than expected.
    #[error("expected {0}")]
    Expected(&'static str),
    /// A word that the text format cannot carry.
    #[error("`{0}` is no name: lower-case letters, digits, `_` and `-`, beginning with a letter")]
    NotAName(String),
    /// A word that stands twice, or that the domain uses for something else.
    #[error("`{name}` is already {what}")]
    Taken {
        /// The word.
        name: String,
        /// What it already is.
        what: &'static str,
    },
}

impl LexiconError {
    /// The error of this kind at this byte of the source.
    pub fn new(kind: LexiconErrorKind, offset: usize, source: &Source) -> Self {
        let (line, column) = source.position(offset);
        Self { kind, file: source.name().to_owned(), line, column, excerpt: source.line_at(offset).to_owned() }
    }
}

impl fmt::Display for LexiconError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, file, line, column, excerpt } = self;
        let margin = " ".repeat(column - 1);
        write!(f, "{file}:{line}:{column}: {kind}\n  {excerpt}\n  {margin}^")
    }
}

impl std::error::Error for LexiconError {}
