//! A task's states in batches: arrays in, arrays out.

use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use strips_core::search::{BatchError, TransitionSystem};
use strips_core::task::limits::{LimitError, Limits};

use crate::error::limit_error;
use crate::interrupt;
use crate::task::Task;

impl Task {
    /// Runs a batch off the interpreter.
    pub fn batch<T: Send>(
        &self,
        py: Python<'_>,
        states: &PyReadonlyArray2<'_, u64>,
        limits: &Limits,
        work: impl FnOnce(&TransitionSystem, &[u64], &Limits) -> Result<T, BatchError> + Send,
    ) -> PyResult<T> {
        let (words, system) = (states.as_array(), self.transitions(py));
        let width = system.width();
        if words.ncols() != width {
            return Err(PyValueError::new_err(format!(
                "a state of this task has {width} words, not {}",
                words.ncols()
            )));
        }
        let words: Vec<u64> = words.iter().copied().collect();
        let done = interrupt::run(py, limits, |limits| match work(system, &words, limits) {
            Err(BatchError::Limit(LimitError::Interrupted)) => Err(LimitError::Interrupted),
            done => Ok(done),
        })?;
        done.map_err(|error| batch_error(py, &error))
    }

    /// Words as rows, a state each.
    pub fn rows<'py>(&self, py: Python<'py>, words: Vec<u64>) -> PyResult<Bound<'py, PyArray2<u64>>> {
        let width = self.transitions(py).width();
        let rows = words.len() / width;
        words.into_pyarray(py).reshape([rows, width])
    }
}

pub fn batch_error(py: Python<'_>, error: &BatchError) -> PyErr {
    match error {
        BatchError::Limit(error) => limit_error(py, error),
        error => PyValueError::new_err(error.to_string()),
    }
}
