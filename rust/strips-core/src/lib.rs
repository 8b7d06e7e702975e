//! A complete STRIPS oracle: PDDL text in; plans, counts, verdicts and training records out.
//!
//! Modules in the order of their dependencies, each importing only those before it:
//! `span` ← `pddl` ← `task` ← `plan` ← `search`, `validate` ← `text`, `augment`, `negative` ← `record` ← `proof`.
//!
//! Knows no Python, no Parquet and no command line: text and numbers in, values out.

pub mod augment;
pub mod negative;
pub mod pddl;
pub mod plan;
pub mod proof;
pub mod random;
pub mod record;
pub mod search;
pub mod span;
pub mod task;
pub mod text;
pub mod validate;
