//! `Task`: a problem, grounded.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedStr;
use strips_core::search::PlanSet as CorePlanSet;
use strips_core::task::limits::Limits;
use strips_core::task::{self, OperatorId};
use strips_core::validate::{Outcome, Validator};

use crate::interrupt;
use crate::operators::OperatorNames;
use crate::pddl::{Domain, Problem};
use crate::plan_set::{PlanSet, semantics_of};
use crate::validate::Verdict;

/// A problem grounded to facts and operators; nothing that can ever be applied is left out.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Task {
    pub core: Arc<task::Task>,
    names: Arc<OperatorNames>,
    validator: OnceLock<Validator>,
}

impl Task {
    fn validator(&self) -> &Validator {
        self.validator.get_or_init(|| Validator::new(self.core.clone()))
    }
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
        Ok(Self { names: Arc::new(OperatorNames::new(core.clone())), core, validator: OnceLock::new() })
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

    /// The verdict on a plan in IPC form.
    fn validate(&self, py: Python<'_>, text: PyBackedStr) -> PyResult<Verdict> {
        interrupt::detached(py, || Verdict(self.validator().validate(&text)))
    }

    /// The verdict on each plan, in order; in parallel.
    fn validate_many(&self, py: Python<'_>, texts: Vec<PyBackedStr>) -> PyResult<Vec<Verdict>> {
        let verdicts = interrupt::detached(py, || self.validator().validate_many(&texts))?;
        Ok(verdicts.into_iter().map(Verdict).collect())
    }

    /// The outcome of each plan, in order, as a position in `OUTCOMES`; in parallel.
    fn outcomes<'py>(&self, py: Python<'py>, texts: Vec<PyBackedStr>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let code = |outcomes: Vec<Outcome>| outcomes.into_iter().map(Outcome::code).collect::<Vec<_>>();
        Ok(interrupt::detached(py, || code(self.validator().outcomes(&texts)))?.into_pyarray(py))
    }

    /// The outcome of each plan given as operator ids, plan `i` being `operators[offsets[i]:offsets[i + 1]]`: positions in
    /// `OUTCOMES`, and the step at fault (0 where there is none); in parallel.
    ///
    /// Raises `ValueError` where the offsets do not ascend within the operators.
    #[expect(clippy::type_complexity, reason = "two arrays")]
    fn validate_ids<'py>(
        &self,
        py: Python<'py>,
        operators: PyReadonlyArray1<'py, u32>,
        offsets: PyReadonlyArray1<'py, i64>,
    ) -> PyResult<(Bound<'py, PyArray1<u8>>, Bound<'py, PyArray1<u32>>)> {
        let (operators, offsets) = (operators.as_slice()?, offsets.as_slice()?);
        let outcomes = interrupt::detached(py, || self.validator().outcomes_of_operators(operators, offsets))?;
        let outcomes = outcomes.ok_or_else(|| PyValueError::new_err("offsets must ascend within the operators"))?;
        let (codes, steps): (Vec<u8>, Vec<u32>) = outcomes.into_iter().map(|(o, step)| (o.code(), step)).unzip();
        Ok((codes.into_pyarray(py), steps.into_pyarray(py)))
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
