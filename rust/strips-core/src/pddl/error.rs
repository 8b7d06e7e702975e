//! What can be wrong with a PDDL text, and how to show it: place, message, source line with a caret, suggestion.

use std::fmt;
use std::ops::Deref;

use super::source::Source;
use crate::span::Span;

/// Characters of a source line that a message shows at most.
const WINDOW: usize = 120;

/// A PDDL text that was refused: a boxed [`Report`], which it dereferences to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PddlError(Box<Report>);

/// What is wrong, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// What is wrong.
    pub kind: PddlErrorKind,
    /// The name of the source.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1, in characters.
    pub column: usize,
    /// The bytes that are wrong.
    pub span: Span,
    /// The source line, or a window of it where it is long.
    excerpt: String,
    /// First and one past the last character to underline in `excerpt`.
    underline: (usize, usize),
}

/// The kinds of names that a PDDL text declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Declaration {
    /// A type.
    #[error("type")]
    Type,
    /// A predicate.
    #[error("predicate")]
    Predicate,
    /// A numeric function.
    #[error("function")]
    Function,
    /// A constant or object.
    #[error("object")]
    Object,
    /// An action.
    #[error("action")]
    Action,
    /// A parameter or quantified variable.
    #[error("variable")]
    Variable,
    /// A part of a definition, such as `:goal`.
    #[error("section")]
    Section,
}

/// What is wrong with a PDDL text.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PddlErrorKind {
    /// The bytes are not UTF-8.
    #[error("the file is not UTF-8 text{}", if *.utf16 { " (it looks like UTF-16)" } else { "" })]
    NotUtf8 {
        /// Whether a byte-order mark says UTF-16.
        utf16: bool,
    },
    /// Nothing but space and comments.
    #[error("the file holds no definition")]
    Empty,
    /// More bytes than spans can number.
    #[error("the file is larger than 4 GiB")]
    TooLarge,
    /// A character that no PDDL word may hold.
    #[error("unexpected character {character:?}")]
    Character {
        /// The character.
        character: char,
    },
    /// Lists inside lists beyond the reader's cap.
    #[error("lists are nested more than {limit} deep")]
    TooDeep {
        /// The cap.
        limit: usize,
    },
    /// A `(` without its `)`.
    #[error("this `(` is never closed")]
    Unclosed,
    /// A section inside another: a `)` is missing.
    #[error("a `)` is missing somewhere before this section begins")]
    UnclosedBefore,
    /// A `)` without its `(`.
    #[error("this `)` closes nothing")]
    SurplusClose,
    /// Something after the end of the definition.
    #[error("text after the end of the definition; is there a `)` too many before it?")]
    Trailing,
    /// Something other than the grammar allows here.
    #[error("expected {expected}, found {found}")]
    Expected {
        /// What the grammar allows.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// A part of PDDL that lies outside classical planning.
    #[error("{feature} are not supported")]
    Unsupported {
        /// The feature, in the plural.
        feature: &'static str,
    },
    /// A name that nothing declares.
    #[error("{} {what} `{name}`", if *.what == Declaration::Section { "unknown" } else { "undeclared" })]
    Undeclared {
        /// What kind of name.
        what: Declaration,
        /// The name.
        name: String,
        /// The nearest declared name, if one is near.
        suggestion: Option<String>,
    },
    /// A name declared twice.
    #[error("{what} `{name}` is declared twice")]
    Duplicate {
        /// What kind of name.
        what: Declaration,
        /// The name.
        name: String,
    },
    /// More or fewer arguments than declared.
    #[error("`{name}` takes {expected} argument{}, not {found}", if *.expected == 1 { "" } else { "s" })]
    Arity {
        /// The predicate or function.
        name: String,
        /// Number of parameters.
        expected: usize,
        /// Number of arguments.
        found: usize,
    },
    /// An argument that is not of the declared type.
    #[error("`{term}` is of type {found}, but {name} takes {wanted} here")]
    WrongType {
        /// The argument.
        term: String,
        /// Its type.
        found: String,
        /// What takes the argument.
        name: String,
        /// The type of the parameter.
        wanted: String,
    },
    /// A type that is a kind of itself.
    #[error("type `{name}` is its own supertype")]
    CyclicType {
        /// The type.
        name: String,
    },
    /// Derived predicates that depend on their own negation.
    #[error("derived predicate `{name}` depends on its own negation")]
    NotStratified {
        /// One of the predicates on the cycle.
        name: String,
    },
    /// A derived predicate in an effect or in `:init`.
    #[error("derived predicate `{name}` follows from its rules and cannot be set")]
    DerivedSet {
        /// The predicate.
        name: String,
    },
    /// A part that every definition must have.
    #[error("the definition has no `{section}`")]
    Missing {
        /// The part.
        section: &'static str,
    },
}

impl PddlErrorKind {
    /// The kind's name in words joined by underscores, for programs.
    pub fn name(&self) -> &'static str {
        match self {
            Self::NotUtf8 { .. } => "not_utf8",
            Self::Empty => "empty",
            Self::TooLarge => "too_large",
            Self::Character { .. } => "character",
            Self::TooDeep { .. } => "too_deep",
            Self::Unclosed | Self::UnclosedBefore => "unclosed",
            Self::SurplusClose => "surplus_close",
            Self::Trailing => "trailing",
            Self::Expected { .. } => "expected",
            Self::Unsupported { .. } => "unsupported",
            Self::Undeclared { .. } => "undeclared",
            Self::Duplicate { .. } => "duplicate",
            Self::Arity { .. } => "arity",
            Self::WrongType { .. } => "wrong_type",
            Self::CyclicType { .. } => "cyclic_type",
            Self::NotStratified { .. } => "not_stratified",
            Self::DerivedSet { .. } => "derived_set",
            Self::Missing { .. } => "missing",
        }
    }

    fn suggestion(&self) -> Option<&str> {
        match self {
            Self::Undeclared { suggestion, .. } => suggestion.as_deref(),
            _ => None,
        }
    }
}

/// An error before it is known in which source: what the parser's functions return.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fault {
    pub(crate) kind: PddlErrorKind,
    pub(crate) span: Span,
}

impl Fault {
    pub(crate) fn new(kind: PddlErrorKind, span: Span) -> Self {
        Self { kind, span }
    }

    pub(crate) fn expected(expected: &'static str, found: &str, span: Span) -> Self {
        Self::new(PddlErrorKind::Expected { expected, found: found.to_owned() }, span)
    }

    pub(crate) fn unsupported(feature: &'static str, span: Span) -> Self {
        Self::new(PddlErrorKind::Unsupported { feature }, span)
    }

    pub(crate) fn duplicate(what: Declaration, name: &str, span: Span) -> Self {
        Self::new(PddlErrorKind::Duplicate { what, name: name.to_owned() }, span)
    }

    pub(crate) fn within(self, source: &Source) -> PddlError {
        PddlError::new(self.kind, self.span, source)
    }
}

impl PddlError {
    /// The error of this kind at these bytes of the source.
    pub fn new(kind: PddlErrorKind, span: Span, source: &Source) -> Self {
        let (line, column) = source.position(span.start());
        let (excerpt, underline) = excerpt(source, span, column);
        Self(Box::new(Report { kind, file: source.name().to_owned(), line, column, span, excerpt, underline }))
    }
}

/// The source line around the span, and which of its characters to underline.
fn excerpt(source: &Source, span: Span, column: usize) -> (String, (usize, usize)) {
    let line = source.line_at(span.start());
    let from = if column > WINDOW { column - 1 - WINDOW / 2 } else { 0 };
    let visible = |character: char| if character.is_control() { ' ' } else { character };
    let shown: String = line.chars().skip(from).take(WINDOW).map(visible).collect();
    let start = column - 1 - from;
    let wide = source.text()[span.start()..span.end()].chars().take_while(|c| !matches!(c, '\n' | '\r')).count();
    let end = (start + wide.max(1)).min(shown.chars().count()).max(start + 1);
    (shown.trim_end().to_owned(), (start, end))
}

impl Deref for PddlError {
    type Target = Report;

    fn deref(&self) -> &Report {
        &self.0
    }
}

impl fmt::Display for PddlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}:{}:{}: {}", self.file, self.line, self.column, self.kind)?;
        let (start, end) = self.underline;
        write!(f, "  {}\n  {}{}", self.excerpt, " ".repeat(start), "^".repeat(end - start))?;
        self.kind.suggestion().map_or(Ok(()), |name| write!(f, "\nhint: did you mean `{name}`?"))
    }
}

impl std::error::Error for PddlError {}
