//! `strips_lm._native`: the whole surface that Python sees, on one screen.
//!
//! Converts, detaches from the interpreter, calls `strips_core` or `strips_decode`, converts back. Holds no algorithm.

#![allow(clippy::needless_pass_by_value, reason = "the interpreter hands arguments over by value")]

mod attention;
mod automaton;
mod error;
mod gpt2;
mod interrupt;
mod operators;
mod pddl;
mod plan_set;
mod prompt;
mod proof;
mod record;
mod state_graph;
mod task;
mod text;
mod transitions;
mod validate;

use pyo3::pymodule;

#[pymodule]
mod _native {
    use pyo3::prelude::*;
    use strips_core::validate::Outcome;

    #[pymodule_export]
    use crate::attention::{attend, attend_back};
    #[pymodule_export]
    use crate::automaton::MaskedDecoder;
    #[pymodule_export]
    use crate::error::{DataError, LimitError, PddlError};
    #[pymodule_export]
    use crate::gpt2::{Gpt2Rows, Gpt2Weights};
    #[pymodule_export]
    use crate::pddl::{Domain, Problem};
    #[pymodule_export]
    use crate::plan_set::{PlanIterator, PlanSet, Plans};
    #[pymodule_export]
    use crate::prompt::render_prompt;
    #[pymodule_export]
    use crate::proof::Prover;
    #[pymodule_export]
    use crate::record::RecordStream;
    #[pymodule_export]
    use crate::state_graph::state_graph;
    #[pymodule_export]
    use crate::task::Task;
    #[pymodule_export]
    use crate::text::{CanonicalCodec, Completion, Legend, parse_completions, split_texts};
    #[pymodule_export]
    use crate::validate::{Judge, Judgement, Verdict, judge, split_plans};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("OUTCOMES", Outcome::ALL.map(Outcome::name))?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
