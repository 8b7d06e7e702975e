//! `strips_lm._native`: the whole surface that Python sees, on one screen.
//!
//! Converts, detaches from the interpreter, calls `strips_core`, converts back. Holds no algorithm.

use pyo3::pymodule;

#[pymodule]
mod _native {}
