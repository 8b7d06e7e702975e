//! Training records: problems from templates and random walks, solved once; names, words, plan and negative drawn anew
//! for each record.
//!
//! A [`RecordStream`] first makes its problems ([`Shape`]s: everything but names), sorted into splits that share
//! nothing they hold out, then gives any range of any split's records as columns. Each record is a pure function of
//! (configuration, seed, split, index), so threads, order and restarts cannot show. Knows no files and no Parquet.
//!
//! Price: the problems, about a tenth of a millisecond each, once; then about 12 µs a record and thread.

mod config;
mod draw;
mod exploration;
mod given_problems;
mod kept_problems;
mod large_problems;
mod midway_problems;
mod problems;
mod random_problems;
mod shape;
mod splits;
mod stream;
mod table;
mod template_problems;
#[cfg(test)]
mod tests;

pub use config::{ConfigMistake, PlanChoice, RecordConfig};
pub(crate) use shape::structure as structure_of;
pub use shape::{Shape, Source as ShapeSource};
pub use splits::Split;
pub use stream::{DomainFiles, RecordError, RecordStream};
pub use table::{Batch, ProblemTable, TextLists, Texts, UNKNOWN};
