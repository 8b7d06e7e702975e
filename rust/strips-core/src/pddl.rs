//! PDDL: text to a checked syntax tree, and back. The only place that knows the language's surface.
//!
//! [`parse_domain`] and [`parse_problem`] read a [`Source`] in linear time and either resolve every name or return a
//! [`PddlError`] that points at the first mistake. [`print_domain`] and [`print_problem`] write what parses back to an
//! equal tree. Knows nothing of grounding or search.

pub mod ast;
mod display;
mod edit_distance;
pub(crate) mod error;
mod lexer;
mod lookup;
mod parser;
mod source;
mod stratify;
pub(crate) mod tree;

pub(crate) use edit_distance::nearest;
pub(crate) use stratify::strata;

pub use display::{print_condition, print_domain, print_problem};
pub use error::{Declaration, PddlError, PddlErrorKind, Report};
pub use parser::{parse_domain, parse_problem};
pub use source::Source;
