//! Constrained decoding by the oracle, in a model's own token ids.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use strips_core::search::SuccessorGenerator;
use strips_core::text::automaton::{self, MaskError, SpokenTask, Walk};

use crate::interrupt;
use crate::task::Task;
use crate::text::{CanonicalCodec, Legend};

/// Says which tokens may come next if every step is to be executable; states are forced, not chosen.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct MaskedDecoder {
    codec: Py<CanonicalCodec>,
    stop_at_goal: bool,
    core: Mutex<automaton::MaskedDecoder>,
}

#[pymethods]
impl MaskedDecoder {
    /// A decoder without rows; `vocabulary` are the model's tokens by id. With `stop_at_goal` the end is the only token
    /// where the goal holds; else a plan may also go on there.
    #[new]
    #[pyo3(signature = (codec, vocabulary, *, stop_at_goal = true))]
    fn new(codec: &Bound<'_, CanonicalCodec>, vocabulary: Vec<String>, stop_at_goal: bool) -> Self {
        let core = Mutex::new(automaton::MaskedDecoder::new(&codec.get().core, &vocabulary));
        Self { codec: codec.clone().unbind(), stop_at_goal, core }
    }

    /// Begins a row for each task and the legend of its prompt; `names` are the prompt's names of the task's objects
    /// where they are not the problem's own. Gives back the first row's number and the tokens forced in each.
    #[pyo3(signature = (tasks, legends, names = None))]
    fn add(
        &self,
        py: Python<'_>,
        tasks: Vec<PyRef<'_, Task>>,
        legends: Vec<PyRef<'_, Legend>>,
        names: Option<Vec<Vec<String>>>,
    ) -> PyResult<(usize, Vec<Vec<u32>>)> {
        let rows = tasks.len();
        if legends.len() != rows || names.as_ref().is_some_and(|names| names.len() != rows) {
            return Err(PyValueError::new_err("as many legends and names as tasks"));
        }
        let codec = &self.codec.get().core;
        let cores: Vec<_> = tasks.iter().map(|task| task.core.clone()).collect();
        let legends: Vec<_> = legends.iter().map(|legend| legend.core.clone()).collect();
        if let Some(names) = &names {
            check_names(&cores, names)?;
        }
        interrupt::detached(py, || {
            let spoken = (0..rows).map(|row| {
                let (task, names) = (cores[row].clone(), names.as_ref().map(|names| &names[row][..]));
                let generator = Arc::new(SuccessorGenerator::new(&task));
                Arc::new(SpokenTask::new(task, generator, codec.clone(), &legends[row], names, self.stop_at_goal))
            });
            let mut core = self.core();
            let first = core.len();
            core.add(spoken.collect()).map(|forced| (first, forced))
        })?
        .map_err(error)
    }

    /// Tells each of `rows` (none twice) the token chosen for it; gives back the tokens forced after it.
    fn advance(&self, py: Python<'_>, rows: Vec<usize>, tokens: Vec<u32>) -> PyResult<Vec<Vec<u32>>> {
        if rows.len() != tokens.len() {
            return Err(PyValueError::new_err("as many tokens as rows"));
        }
        py.detach(|| self.core().advance(&rows, &tokens)).map_err(error)
    }

    /// Which tokens may come next: flags (rows, vocabulary). A row without any is stuck or has ended.
    fn mask<'py>(&self, py: Python<'py>, rows: Vec<usize>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let core = self.core();
        let width = core.vocabulary_size();
        let mut flags = vec![false; rows.len() * width];
        core.mask(&rows, &mut flags).map_err(error)?;
        PyArray1::from_vec(py, flags).reshape([rows.len(), width])
    }

    /// Of each of `rows`, `ended` (its plan is valid), `stuck` (nothing may come) or `open`.
    fn status(&self, rows: Vec<usize>) -> PyResult<Vec<&'static str>> {
        let core = self.core();
        rows.into_iter().map(|row| core.walk(row).map(status).map_err(error)).collect()
    }

    /// Takes steps back in a row that is stuck, to the last state from which a step leads to a state never visited: the
    /// number of steps left and the tokens forced after them, or `None` where nothing is left to try.
    fn backtrack(&self, row: usize) -> PyResult<Option<(usize, Vec<u32>)>> {
        self.core().backtrack(row).map_err(error)
    }

    /// The tokens of the shortest plan through states that a row, which has ended, came to; `None` if its own is that short.
    fn shortened(&self, py: Python<'_>, row: usize) -> PyResult<Option<Vec<u32>>> {
        py.detach(|| self.core().shortened(row)).map_err(error)
    }

    /// The operators of a row so far, such as `(pick cup)`.
    fn plan(&self, row: usize) -> PyResult<Vec<String>> {
        let core = self.core();
        let walk = core.walk(row).map_err(error)?;
        Ok(walk.plan().iter().map(|&operator| walk.task().operator_name(operator)).collect())
    }

    /// A new row that goes on from where `row` is; its number.
    fn fork(&self, row: usize) -> PyResult<usize> {
        self.core().fork(row).map_err(error)
    }

    /// Forgets rows; their numbers are not given again.
    fn remove(&self, rows: Vec<usize>) {
        self.core().remove(&rows);
    }

    fn __len__(&self) -> usize {
        self.core().len()
    }
}

impl MaskedDecoder {
    fn core(&self) -> MutexGuard<'_, automaton::MaskedDecoder> {
        self.core.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn status(walk: &Walk) -> &'static str {
    match (walk.has_ended(), walk.is_stuck()) {
        (true, _) => "ended",
        (_, true) => "stuck",
        _ => "open",
    }
}

fn check_names(tasks: &[Arc<strips_core::task::Task>], names: &[Vec<String>]) -> PyResult<()> {
    let fits = tasks.iter().zip(names).all(|(task, names)| task.problem.objects.len() == names.len());
    if fits { Ok(()) } else { Err(PyValueError::new_err("a name for each object of each task")) }
}

fn error(error: MaskError) -> PyErr {
    PyValueError::new_err(error.to_string())
}
