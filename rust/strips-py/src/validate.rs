//! `Verdict` and `Judgement`: what the oracle says of a plan, and of a generated text.

use std::collections::HashMap;

use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedStr;
use pyo3::types::PyDict;
use strips_core::plan;
use strips_core::task::limits::{LimitError, Limits};
use strips_core::validate::{self, JudgeError};

use crate::error::{limit_error, pddl_error};
use crate::interrupt;
use crate::pddl::Domain;

/// What is wrong with a plan, and where; or that it is valid.
#[pyclass(frozen, eq, module = "strips_lm._native")]
#[derive(Clone, PartialEq)]
pub struct Verdict(pub validate::Verdict);

#[pymethods]
impl Verdict {
    /// `valid`, or what is wrong: `syntax`, `unknown_action`, `unknown_object`, `arity`, `type`, `inapplicable` or
    /// `goal_not_reached`.
    #[getter]
    fn outcome(&self) -> &'static str {
        self.0.outcome.name()
    }

    /// The step at fault, from 1; the plan's length + 1 for the goal; `None` for `valid` and `syntax`.
    #[getter]
    fn step(&self) -> Option<usize> {
        self.0.step
    }

    /// The line at fault, from 1; `None` where there is none.
    #[getter]
    fn line(&self) -> Option<usize> {
        self.0.line
    }

    /// The literals that do not hold and should, as PDDL.
    #[getter]
    fn missing(&self) -> Vec<String> {
        self.0.missing.clone()
    }

    /// Of a valid plan: what it raises `total-cost` by where the problem minimizes that, else its length.
    #[getter]
    fn cost(&self) -> Option<f64> {
        self.0.cost
    }

    /// What is wrong, in a sentence.
    #[getter]
    fn reason(&self) -> &str {
        &self.0.reason
    }

    /// Whether the plan is valid.
    #[getter]
    fn is_valid(&self) -> bool {
        self.0.is_valid()
    }

    /// The verdict as `validate --json` prints it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let table = PyDict::new(py);
        table.set_item("verdict", self.outcome())?;
        table.set_item("step", self.0.step)?;
        table.set_item("line", self.0.line)?;
        table.set_item("missing", &self.0.missing)?;
        table.set_item("reason", &self.0.reason)?;
        Ok(table)
    }

    fn __repr__(&self) -> String {
        format!("<Verdict {}: {}>", self.outcome(), self.0.reason)
    }
}

/// What the oracle says of a generated text.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Judgement(validate::Judgement);

#[pymethods]
impl Judgement {
    /// The verdict on the plan; `syntax` where the text is malformed.
    #[getter]
    fn verdict(&self) -> Verdict {
        Verdict(self.0.verdict.clone())
    }

    /// The plan in IPC form, in the domain's action names.
    #[getter]
    fn plan(&self) -> &str {
        &self.0.plan
    }

    /// Whether the text came to its end token.
    #[getter]
    fn finished(&self) -> bool {
        self.0.finished
    }

    /// How many steps the text has.
    #[getter]
    fn steps(&self) -> usize {
        self.0.steps
    }

    /// How many of them can be applied, from the first.
    #[getter]
    fn executable_steps(&self) -> usize {
        self.0.executable_steps
    }

    /// How many states the text says.
    #[getter]
    fn states_total(&self) -> usize {
        self.0.trace.states
    }

    /// How many of them are the true ones.
    #[getter]
    fn states_right(&self) -> usize {
        self.0.trace.right
    }

    /// The step, from 1, after which the first wrong state stands; `None` where all are right.
    #[getter]
    fn first_wrong_state(&self) -> Option<usize> {
        self.0.trace.first_wrong
    }

    fn __repr__(&self) -> String {
        format!("<Judgement {}: {} steps>", self.0.verdict.outcome.name(), self.0.steps)
    }
}

/// Splits a text of many plans, separated by blank lines: each plan's number of lines before it, and its text.
#[pyfunction]
pub fn split_plans(text: &str) -> Vec<(usize, &str)> {
    plan::split_plans(text)
}

/// Prompts' problems, read and grounded once, to judge any number of generated texts against.
///
/// `words[i]` gives the domain's action or predicate for a word of the texts for `problems[i]` (PDDL).
#[pyclass(frozen, module = "strips_lm._native")]
pub struct Judge(validate::Judge);

#[pymethods]
impl Judge {
    /// Raises `PddlError` where a problem is wrong, `LimitError` where one is too large, `ValueError` where the lists
    /// differ in length.
    #[new]
    fn new(
        py: Python<'_>,
        domain: &Domain,
        problems: Vec<PyBackedStr>,
        words: Vec<HashMap<String, String>>,
    ) -> PyResult<Self> {
        let domain = domain.ast.clone();
        let prepared = interrupt::run(py, &Limits::default(), |limits| {
            let problems: Vec<&str> = problems.iter().map(AsRef::as_ref).collect();
            match validate::Judge::new(&domain, &problems, words, limits) {
                Err(JudgeError::Limit(LimitError::Interrupted)) => Err(LimitError::Interrupted),
                prepared => Ok(prepared),
            }
        })?;
        match prepared {
            Ok(judge) => Ok(Self(judge)),
            Err(JudgeError::Pddl(error)) => Err(pddl_error(py, &error)),
            Err(JudgeError::Limit(error)) => Err(limit_error(py, &error)),
            Err(error @ JudgeError::Lengths { .. }) => Err(PyValueError::new_err(error.to_string())),
        }
    }

    /// Judges texts in parallel, each for the problem of its number: parses it, maps its words back to the domain's,
    /// validates the plan and compares its states with the true ones.
    ///
    /// Raises `ValueError` where the lists differ in length, `IndexError` where there is no problem of a number.
    fn judge(&self, py: Python<'_>, numbers: Vec<usize>, completions: Vec<PyBackedStr>) -> PyResult<Vec<Judgement>> {
        if numbers.len() != completions.len() {
            let (numbers, texts) = (numbers.len(), completions.len());
            return Err(PyValueError::new_err(format!("{numbers} numbers of problems for {texts} texts")));
        }
        if let Some(number) = numbers.iter().find(|&&number| number >= self.0.len()) {
            return Err(PyIndexError::new_err(format!("there is no problem {number}, but {}", self.0.len())));
        }
        let judged = interrupt::run(py, &Limits::default(), |limits| {
            let texts = numbers.iter().copied().zip(completions.iter().map(AsRef::as_ref));
            self.0.judge(&texts.collect::<Vec<_>>(), limits)
        })?;
        Ok(judged.into_iter().map(Judgement).collect())
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        format!("<Judge of {} problems>", self.0.len())
    }
}

/// Judges generated texts, each for a problem of its own: `Judge(domain, problems, words)`, used once.
///
/// Raises what `Judge` does.
#[pyfunction]
pub fn judge(
    py: Python<'_>,
    domain: &Domain,
    problems: Vec<PyBackedStr>,
    completions: Vec<PyBackedStr>,
    words: Vec<HashMap<String, String>>,
) -> PyResult<Vec<Judgement>> {
    let numbers = (0..problems.len()).collect();
    Judge::new(py, domain, problems, words)?.judge(py, numbers, completions)
}
