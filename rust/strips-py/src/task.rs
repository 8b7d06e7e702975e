//! `Task`: a problem, grounded.

use std::sync::Arc;
use std::time::Duration;

use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use strips_core::search::PlanSet as CorePlanSet;
use strips_core::task::limits::Limits;
use strips_core::task::{self, OperatorId};

use crate::interrupt;
use crate::operators::OperatorNames;
use crate::pddl::{Domain, Problem};
use crate::plan_set::{PlanSet, semantics_of};

/// A problem grounded to facts and operators; nothing that can ever be applied is left out.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Task {
    pub core: Arc<task::Task>,
    names: Arc<OperatorNames>,
}

#[pymethods]
impl Task {
    /// Grounds a problem.
    ///
    /// Raises `LimitError` where the task has more operators or facts than allowed, needs more memory, or takes longer.
    #[new]
    #[pyo3(signature = (domain, problem, *, max_operators = None, max_facts = None, max_bytes = None, time_limit = None))]
    fn new(
        py: Python<'_>,
        domain: &Domain,
        problem: &Problem,
        max_operators: Option<usize>,
        max_facts: Option<usize>,
        max_bytes: Option<usize>,
        time_limit: Option<f64>,
    ) -> PyResult<Self> {
        let mut limits = limits(max_bytes, time_limit)?;
        limits.operators = max_operators.unwrap_or(limits.operators);
        limits.facts = max_facts.unwrap_or(limits.facts);
        let (domain, problem) = (domain.ast.clone(), problem.ast.clone());
        let core = interrupt::run(py, &limits, |limits| task::ground(domain, problem, limits))?;
        let core = Arc::new(core);
        Ok(Self { names: Arc::new(OperatorNames::new(core.clone())), core })
    }

    /// How many facts can differ between reachable states.
    #[getter]
    fn num_facts(&self) -> usize {
        self.core.facts.len()
    }

    /// How many operators there are.
    #[getter]
    fn num_operators(&self) -> usize {
        self.core.operators.len()
    }

    /// An operator's name, such as `(pick cup)`.
    fn operator_name(&self, operator: usize) -> PyResult<String> {
        if operator >= self.core.operators.len() {
            return Err(PyIndexError::new_err(format!("there are {} operators", self.core.operators.len())));
        }
        Ok(self.core.operator_name(OperatorId::from(operator)))
    }

    /// All plans of at most `max_steps` steps; `semantics` is `first-goal`, `any` or `simple`.
    ///
    /// Raises `LimitError` where the state space has more states than allowed, needs more memory, or takes longer.
    #[pyo3(signature = (max_steps, semantics = "first-goal", *, max_states = None, max_bytes = None, time_limit = None))]
    fn plan_set(
        &self,
        py: Python<'_>,
        max_steps: usize,
        semantics: &str,
        max_states: Option<usize>,
        max_bytes: Option<usize>,
        time_limit: Option<f64>,
    ) -> PyResult<PlanSet> {
        let semantics = semantics_of(semantics)?;
        let mut limits = limits(max_bytes, time_limit)?;
        limits.states = max_states.unwrap_or(limits.states);
        let task = self.core.clone();
        let core = interrupt::run(py, &limits, |limits| CorePlanSet::new(task, max_steps, semantics, limits))?;
        Ok(PlanSet::new(self.names.clone(), core))
    }

    fn __repr__(&self) -> String {
        let task = &self.core;
        format!("<Task {}: {} facts, {} operators>", task.problem.name, task.facts.len(), task.operators.len())
    }
}

/// The limits that every long call takes.
fn limits(max_bytes: Option<usize>, time_limit: Option<f64>) -> PyResult<Limits> {
    let time = time_limit.map(Duration::try_from_secs_f64).transpose();
    let time = time.map_err(|error| PyValueError::new_err(format!("time_limit: {error}")))?;
    let default = Limits::default();
    Ok(Limits { bytes: max_bytes.unwrap_or(default.bytes), time, ..default })
}
