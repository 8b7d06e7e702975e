//! `Prover`: written records held against their problems.

use pyo3::prelude::*;
use pyo3::pybacked::PyBackedStr;
use strips_core::proof::{self, Written};

use crate::error::DataError;
use crate::interrupt;
use crate::pddl::Domain;

/// The columns of one record that can be proven.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Row {
    problem_id: usize,
    prompt: PyBackedStr,
    completion: PyBackedStr,
    negative: PyBackedStr,
    plan: PyBackedStr,
    negative_kind: PyBackedStr,
    negative_verdict: PyBackedStr,
    negative_step: usize,
    names: Vec<PyBackedStr>,
    words: Vec<PyBackedStr>,
    style: PyBackedStr,
    goal_style: PyBackedStr,
    steps: usize,
}

impl Row {
    fn written(&self) -> Written<'_> {
        Written {
            problem_id: self.problem_id,
            prompt: &self.prompt,
            completion: &self.completion,
            negative: &self.negative,
            plan: &self.plan,
            negative_kind: &self.negative_kind,
            negative_verdict: &self.negative_verdict,
            negative_step: self.negative_step,
            names: self.names.iter().map(|name| &**name).collect(),
            words: self.words.iter().map(|word| &**word).collect(),
            style: &self.style,
            goal_style: &self.goal_style,
            steps: self.steps,
        }
    }
}

/// Proves records from their columns and the problems' PDDL alone.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Prover(proof::Prover);

#[pymethods]
impl Prover {
    #[new]
    fn new(domain: &Domain, problems: Vec<String>) -> Self {
        Self(proof::Prover::new(domain.ast.clone(), problems))
    }

    /// Each problem's canonical hash and number of objects; `state_goals` says which problems ask for a whole state.
    ///
    /// Raises `DataError` where a problem cannot be read or grounded.
    fn hashes(&self, py: Python<'_>, state_goals: Vec<bool>) -> PyResult<Vec<(String, usize)>> {
        let found = interrupt::detached(py, || self.0.hashes(&state_goals))?;
        found.map_err(|(id, fault)| DataError::new_err(format!("problem {id}: {fault}")))
    }

    /// What is wrong with each record (a mapping from columns to values), `None` for nothing; in parallel.
    fn check(&self, py: Python<'_>, rows: Vec<Row>) -> PyResult<Vec<Option<String>>> {
        interrupt::detached(py, || {
            let written: Vec<Written<'_>> = rows.iter().map(Row::written).collect();
            self.0.check_many(&written).into_iter().map(|fault| fault.map(|fault| fault.to_string())).collect()
        })
    }
}
