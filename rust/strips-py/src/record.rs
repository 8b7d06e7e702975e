//! `RecordStream`: a data set's records as columns of flat arrays, which Arrow takes over without a copy.

use std::sync::Arc;

use numpy::IntoPyArray;
use pyo3::exceptions::{PyIndexError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::{ThreadPool, ThreadPoolBuilder};
use strips_core::pddl::Source;
use strips_core::record::{self, Batch, DomainFiles, ProblemTable, RecordConfig, RecordError, Split, TextLists, Texts};
use strips_core::task::{LimitError as CoreLimitError, Limits};

use crate::error::{DataError, limit_error, pddl_error};
use crate::interrupt;

/// A file's name and its text.
type File = (String, String);

/// All records of a data set, made on demand: any range of any split, the same bytes for any number of threads.
#[pyclass(frozen, module = "strips_lm._native")]
pub struct RecordStream {
    core: Arc<record::RecordStream>,
    pool: Arc<ThreadPool>,
}

#[pymethods]
impl RecordStream {
    #[new]
    #[pyo3(signature = (config, domain, lexicon=None, templates=vec![], random=None, large=None, problems=vec![], jobs=0))]
    #[expect(clippy::too_many_arguments, reason = "one for each file of a domain's folder")]
    fn new(
        py: Python<'_>,
        config: &str,
        domain: File,
        lexicon: Option<File>,
        templates: Vec<File>,
        random: Option<File>,
        large: Option<File>,
        problems: Vec<File>,
        jobs: usize,
    ) -> PyResult<Self> {
        interrupt::load_numpy(py)?;
        let config: RecordConfig =
            serde_json::from_str(config).map_err(|error| DataError::new_err(format!("configuration: {error}")))?;
        let source = |(name, text): File| Source::new(name, text);
        let files = DomainFiles {
            domain: source(domain),
            lexicon: lexicon.map(source),
            templates: templates.into_iter().map(source).collect(),
            random: random.map(source),
            large: large.map(source),
            problems: problems.into_iter().map(source).collect(),
        };
        let pool = ThreadPoolBuilder::new().num_threads(jobs).build();
        let pool = Arc::new(pool.map_err(|error| PyRuntimeError::new_err(error.to_string()))?);
        let made = interrupt::run(py, &Limits::default(), |limits| {
            match pool.install(|| record::RecordStream::new(&files, config, limits.clone())) {
                Err(RecordError::Limit(CoreLimitError::Interrupted)) => Err(CoreLimitError::Interrupted),
                made => Ok(made),
            }
        })?;
        let core = Arc::new(made.map_err(|error| record_error(py, &error))?);
        Ok(Self { core, pool })
    }

    /// The splits that have records, in the order of the data set, and how many each has.
    #[getter]
    fn splits(&self) -> Vec<(&'static str, u64)> {
        self.core.splits().into_iter().map(|(split, records)| (split.name(), records)).collect()
    }

    /// A line for each given problem whose own goal gives no records, with its file.
    #[getter]
    fn left_out(&self) -> Vec<String> {
        self.core.left_out().to_vec()
    }

    /// The records `start..stop` of a split, as columns.
    ///
    /// A column of numbers is an array, one of texts is `(offsets, bytes)`, one of lists `(offsets, (offsets, bytes))`.
    fn batch<'py>(&self, py: Python<'py>, split: &str, start: u64, stop: u64) -> PyResult<Bound<'py, PyDict>> {
        let split = Split::from_name(split).ok_or_else(|| PyValueError::new_err(format!("no split {split:?}")))?;
        if start > stop || stop > self.core.len(split) {
            return Err(PyIndexError::new_err("the split does not have as many records"));
        }
        let batch = interrupt::run(py, &Limits::default(), |limits| {
            self.pool.install(|| self.core.batch_within(split, start..stop, limits))
        })?;
        batch_columns(py, batch)
    }

    /// The problems that the records refer to, as columns.
    fn problems<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let table =
            interrupt::run(py, &Limits::default(), |limits| self.pool.install(|| self.core.problem_table(limits)))?;
        problem_columns(py, table)
    }
}

fn record_error(py: Python<'_>, error: &RecordError) -> PyErr {
    match error {
        RecordError::Pddl(error) => pddl_error(py, error),
        RecordError::Limit(error) => limit_error(py, error),
        other => DataError::new_err(other.to_string()),
    }
}

fn batch_columns(py: Python<'_>, batch: Batch) -> PyResult<Bound<'_, PyDict>> {
    let columns = PyDict::new(py);
    columns.set_item("index", batch.index.into_pyarray(py))?;
    columns.set_item("prompt", texts(py, batch.prompt)?)?;
    columns.set_item("completion", texts(py, batch.completion)?)?;
    columns.set_item("negative", texts(py, batch.negative)?)?;
    columns.set_item("plan", texts(py, batch.plan)?)?;
    columns.set_item("negative_kind", texts(py, batch.negative_kind)?)?;
    columns.set_item("negative_verdict", texts(py, batch.negative_verdict)?)?;
    columns.set_item("negative_step", batch.negative_step.into_pyarray(py))?;
    columns.set_item("problem_id", batch.problem_id.into_pyarray(py))?;
    columns.set_item("names", lists(py, batch.names)?)?;
    columns.set_item("words", lists(py, batch.words)?)?;
    columns.set_item("template", texts(py, batch.template)?)?;
    columns.set_item("style", texts(py, batch.style)?)?;
    columns.set_item("goal_style", texts(py, batch.goal_style)?)?;
    columns.set_item("steps", batch.steps.into_pyarray(py))?;
    columns.set_item("optimal_steps", batch.optimal_steps.into_pyarray(py))?;
    columns.set_item("plan_count", texts(py, batch.plan_count)?)?;
    columns.set_item("seed", batch.seed.into_pyarray(py))?;
    Ok(columns)
}

fn problem_columns(py: Python<'_>, table: ProblemTable) -> PyResult<Bound<'_, PyDict>> {
    let columns = PyDict::new(py);
    columns.set_item("problem_id", table.problem_id.into_pyarray(py))?;
    columns.set_item("problem", texts(py, table.problem)?)?;
    columns.set_item("domain", texts(py, table.domain)?)?;
    columns.set_item("template", texts(py, table.template)?)?;
    columns.set_item("num_objects", table.num_objects.into_pyarray(py))?;
    columns.set_item("canonical_hash", texts(py, table.canonical_hash)?)?;
    columns.set_item("shortest", table.shortest.into_pyarray(py))?;
    columns.set_item("goal_style", texts(py, table.goal_style)?)?;
    Ok(columns)
}

fn texts(py: Python<'_>, column: Texts) -> PyResult<Bound<'_, PyAny>> {
    Ok((column.offsets.into_pyarray(py), column.bytes.into_pyarray(py)).into_pyobject(py)?.into_any())
}

fn lists(py: Python<'_>, column: TextLists) -> PyResult<Bound<'_, PyAny>> {
    Ok((column.offsets.into_pyarray(py), texts(py, column.texts)?).into_pyobject(py)?.into_any())
}
