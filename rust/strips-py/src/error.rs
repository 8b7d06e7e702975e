//! The exceptions that Python sees, and the one place where core errors become them.

use pyo3::create_exception;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use strips_core::pddl;
use strips_core::task::limits;

create_exception!(
    strips_lm._native,
    PddlError,
    PyValueError,
    "A PDDL text that is wrong: `kind`, `file`, `line`, `column` and `message`; `str` shows the line with a caret."
);
create_exception!(
    strips_lm._native,
    LimitError,
    PyRuntimeError,
    "A budget was spent before the work was done: `kind` says which (operators, facts, states, bytes or time)."
);
create_exception!(
    strips_lm._native,
    DataError,
    PyValueError,
    "A mistake in a template, lexicon or data file; `str` has its file, line and column."
);

/// The exception for a PDDL text that was refused.
pub fn pddl_error(py: Python<'_>, error: &pddl::PddlError) -> PyErr {
    let raised = PddlError::new_err(error.to_string());
    let fill = |value: &Bound<'_, PyAny>| -> PyResult<()> {
        value.setattr("kind", error.kind.name())?;
        value.setattr("file", &error.file)?;
        value.setattr("line", error.line)?;
        value.setattr("column", error.column)?;
        value.setattr("message", error.kind.to_string())
    };
    fill(raised.value(py)).map_or_else(|failed| failed, |()| raised)
}

/// The exception for a budget that was spent.
pub fn limit_error(py: Python<'_>, error: &limits::LimitError) -> PyErr {
    if *error == limits::LimitError::Interrupted {
        return PyKeyboardInterrupt::new_err(());
    }
    let raised = LimitError::new_err(error.to_string());
    raised.value(py).setattr("kind", error.kind()).map_or_else(|failed| failed, |()| raised)
}
