//! `Task`: a problem, grounded.

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedStr;
use pyo3::types::PyTuple;
use strips_core::search::{PlanSet as CorePlanSet, TransitionSystem, shortest_plan};
use strips_core::task::limits::Limits;
use strips_core::task::{self, OperatorId};
use strips_core::validate::{Outcome, Validator};

use crate::interrupt;
use crate::operators::OperatorNames;
use crate::pddl::{Domain, Problem};
use crate::plan_set::{PlanSet, semantics_of};
use crate::transitions::batch_error;
use crate::validate::Verdict;

/// A problem grounded to facts and operators; nothing that can ever be applied is left out.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Task {
    pub core: Arc<task::Task>,
    names: Arc<OperatorNames>,
    validator: OnceLock<Validator>,
    transitions: OnceLock<TransitionSystem>,
}

impl Task {
    /// The task's transition system, compiled off the interpreter when first needed.
    pub fn transitions(&self, py: Python<'_>) -> &TransitionSystem {
        py.detach(|| self.transitions.get_or_init(|| TransitionSystem::new(self.core.clone())))
    }

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
        let names = Arc::new(OperatorNames::new(core.clone()));
        Ok(Self { names, core, validator: OnceLock::new(), transitions: OnceLock::new() })
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

    /// The first of the shortest plans of at most `max_steps` steps, or `None` where there is none: what the plan set of
    /// any semantics begins with, by a search that ends where it meets the goal.
    ///
    /// Raises `LimitError` as `plan_set` does.
    #[pyo3(signature = (max_steps = None, *, max_states = None, max_bytes = None, time_limit = None))]
    fn shortest_plan<'py>(
        &self,
        py: Python<'py>,
        max_steps: Option<usize>,
        max_states: Option<usize>,
        max_bytes: Option<usize>,
        time_limit: Option<f64>,
    ) -> PyResult<Option<Bound<'py, PyTuple>>> {
        let mut limits = limits(max_bytes, time_limit)?;
        limits.states = max_states.unwrap_or(limits.states);
        let plan = interrupt::run(py, &limits, |limits| shortest_plan(&self.core, max_steps, limits))?;
        let name = |id: OperatorId| self.core.operator_name(id);
        plan.map(|plan| PyTuple::new(py, plan.0.into_iter().map(name))).transpose()
    }

    /// The initial state, as one row (1, words).
    fn initial_state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u64>>> {
        self.rows(py, self.transitions(py).init())
    }

    /// Packs states given by their true atoms, such as `(on cup table)`: (states, words). Atoms that can never become
    /// false may be left out, derived ones are computed.
    ///
    /// Raises `ValueError` where no reachable state has an atom.
    fn pack<'py>(&self, py: Python<'py>, states: Vec<Vec<PyBackedStr>>) -> PyResult<Bound<'py, PyArray2<u64>>> {
        let system = self.transitions(py);
        let pack = || states.iter().map(|atoms| system.state_of(atoms)).collect::<Result<Vec<_>, _>>();
        let packed = interrupt::detached(py, pack)?.map_err(|error| batch_error(py, &error))?;
        self.rows(py, packed.concat())
    }

    /// The atoms of each state, those that never change and derived ones included.
    fn atoms(&self, py: Python<'_>, states: PyReadonlyArray2<'_, u64>) -> PyResult<Vec<Vec<String>>> {
        self.batch(py, &states, &Limits::default(), TransitionSystem::atoms)
    }

    /// Whether each state satisfies the goal.
    fn is_goal<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, u64>,
    ) -> PyResult<Bound<'py, PyArray1<bool>>> {
        let goals = self.batch(py, &states, &Limits::default(), |system, words, _| system.are_goals(words))?;
        Ok(goals.into_pyarray(py))
    }

    /// The operators that may be applied in each state: those of state `i` are `operators[offsets[i]:offsets[i + 1]]`,
    /// ascending.
    #[expect(clippy::type_complexity, reason = "two arrays")]
    fn applicable<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, u64>,
    ) -> PyResult<(Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<i64>>)> {
        let found = self.batch(py, &states, &Limits::default(), |system, words, limits| {
            let found = system.applicable(words, limits)?;
            let offsets: Vec<i64> = found.offsets.into_iter().map(u64::cast_signed).collect();
            Ok((found.operators, offsets))
        })?;
        Ok((found.0.into_pyarray(py), found.1.into_pyarray(py)))
    }

    /// The state after `operators[i]` in `states[i]`, for each row.
    ///
    /// Raises `ValueError` where an operator is not applicable; it names the first such row.
    fn successor<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, u64>,
        operators: PyReadonlyArray1<'py, u32>,
    ) -> PyResult<Bound<'py, PyArray2<u64>>> {
        let operators: Vec<u32> = operators.as_array().iter().copied().collect();
        let next = self.batch(py, &states, &Limits::default(), |system, words, limits| {
            system.successors(words, &operators, limits)
        })?;
        self.rows(py, next)
    }

    /// The fewest steps from each state to the goal, -1 where there is no way of at most `max_steps`.
    ///
    /// Raises `LimitError` where the states within so many steps are more than allowed, need more memory, or take longer.
    #[pyo3(signature = (states, max_steps = None, *, max_states = None, max_bytes = None, time_limit = None))]
    fn distance_to_goal<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, u64>,
        max_steps: Option<usize>,
        max_states: Option<usize>,
        max_bytes: Option<usize>,
        time_limit: Option<f64>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let mut limits = limits(max_bytes, time_limit)?;
        limits.states = max_states.unwrap_or(limits.states);
        let steps = |distance: Option<usize>| distance.and_then(|steps| i64::try_from(steps).ok()).unwrap_or(-1);
        let distances = self.batch(py, &states, &limits, |system, words, limits| {
            let distances = system.distances_to_goal(words, max_steps, limits)?;
            Ok(distances.into_iter().map(steps).collect::<Vec<i64>>())
        })?;
        Ok(distances.into_pyarray(py))
    }

    /// The verdict on a plan in IPC form.
    fn validate(&self, py: Python<'_>, text: PyBackedStr) -> PyResult<Verdict> {
        interrupt::detached(py, || Verdict(self.validator().validate(&text)))
    }

    /// The verdict on each plan, in order; in parallel.
    fn validate_many(&self, py: Python<'_>, texts: Vec<PyBackedStr>) -> PyResult<Vec<Verdict>> {
        let verdicts = interrupt::run(py, &Limits::default(), |limits| self.validator().validate_many(&texts, limits))?;
        Ok(verdicts.into_iter().map(Verdict).collect())
    }

    /// The outcome of each plan, in order, as a position in `OUTCOMES`; in parallel.
    fn outcomes<'py>(&self, py: Python<'py>, texts: Vec<PyBackedStr>) -> PyResult<Bound<'py, PyArray1<u8>>> {
        let code = |outcomes: Vec<Outcome>| outcomes.into_iter().map(Outcome::code).collect::<Vec<_>>();
        let work = |limits: &Limits| self.validator().outcomes(&texts, limits).map(code);
        Ok(interrupt::run(py, &Limits::default(), work)?.into_pyarray(py))
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
        let outcomes = interrupt::run(py, &Limits::default(), |limits| {
            self.validator().outcomes_of_operators(operators, offsets, limits)
        })?;
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
