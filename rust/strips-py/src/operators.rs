//! Operators by name: what Python sees of them.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyString, PyTuple};
use strips_core::task::{OperatorId, Task};

/// A step of a plan as Python may give it.
#[derive(FromPyObject)]
pub enum Step {
    /// An operator's id.
    Id(u32),
    /// Its name, such as `(pick cup)`.
    Name(String),
}

/// The operators' names, made when first needed.
pub struct OperatorNames {
    task: Arc<Task>,
    strings: PyOnceLock<Vec<Py<PyString>>>,
    ids: OnceLock<HashMap<String, u32>>,
}

impl OperatorNames {
    pub fn new(task: Arc<Task>) -> Self {
        Self { task, strings: PyOnceLock::new(), ids: OnceLock::new() }
    }

    /// The operator that a step means; `None` where a name is none.
    pub fn id(&self, step: Step) -> PyResult<Option<OperatorId>> {
        match step {
            Step::Id(id) if (id as usize) < self.task.operators.len() => Ok(Some(OperatorId(id))),
            Step::Id(id) => Err(PyIndexError::new_err(format!("there is no operator {id}"))),
            Step::Name(name) => Ok(self.ids().get(&name.to_lowercase()).map(|&id| OperatorId(id))),
        }
    }

    /// A plan as a tuple of names.
    pub fn plan<'py>(&self, py: Python<'py>, operators: impl Iterator<Item = u32>) -> PyResult<Bound<'py, PyTuple>> {
        let strings = self.strings.get_or_init(py, || {
            let name = |index| PyString::new(py, &self.task.operator_name(OperatorId::from(index))).unbind();
            (0..self.task.operators.len()).map(name).collect()
        });
        PyTuple::new(py, operators.map(|id| strings[id as usize].bind(py)).collect::<Vec<_>>())
    }

    fn ids(&self) -> &HashMap<String, u32> {
        let count = self.task.operators.len() as u32;
        self.ids.get_or_init(|| (0..count).map(|id| (self.task.operator_name(OperatorId(id)), id)).collect())
    }
}
