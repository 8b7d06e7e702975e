//! The exceptions that Python sees, and the one place where core errors become them.

use pyo3::create_exception;
use pyo3::exceptions::{PyRuntimeError, PyValueError};

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
