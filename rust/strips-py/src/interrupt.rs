//! Long work: off the interpreter, on a pool that survives `fork`, and Ctrl-C answered meanwhile.
//!
//! The work runs on the pool while the calling thread waits detached and wakes every [`POLL`] to let Python handle
//! signals. When a handler raises, the flag in the work's [`Limits`] is set, the work ends at its next check, and the
//! exception goes to the caller. A pool's threads do not exist in a forked child, so each process gets its own pool.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use numpy::PyArray1;
use pyo3::PyResult;
use pyo3::exceptions::PyRuntimeError;
use pyo3::marker::Python;
use rayon::{ThreadPool, ThreadPoolBuilder};
use strips_core::task::limits::{LimitError, Limits};

use crate::error::limit_error;

/// How often a waiting call looks for signals.
const POLL: Duration = Duration::from_millis(20);

/// What a worker's stack may hold: recursion over deep conditions needs more than a thread's usual 2 MiB.
const STACK: usize = 64 << 20;

/// This process's pool, with the id of the process that made it.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Runs `work` on the pool and returns what it gives, or the exception that a signal handler raised meanwhile.
pub fn run<T: Send>(
    py: Python<'_>,
    limits: &Limits,
    work: impl FnOnce(&Limits) -> Result<T, LimitError> + Send,
) -> PyResult<T> {
    let flag = Arc::new(AtomicBool::new(false));
    let limits = Limits { interrupt: Some(flag.clone()), ..*limits };
    let mut result = None;
    pool()?.in_place_scope(|scope| {
        let (done, mut finished) = channel::<()>();
        let slot = &mut result;
        scope.spawn(move |_| {
            *slot = Some(work(&limits));
            drop(done);
        });
        while !py.detach(|| ended(&mut finished)) {
            if let Err(raised) = py.check_signals() {
                flag.store(true, Ordering::Relaxed);
                while !py.detach(|| ended(&mut finished)) {}
                return Err(raised);
            }
        }
        // A signal of the last moment: the caller's next Python code may be where an exception is a panic.
        py.check_signals()
    })?;
    result.expect("the scope waits for the work, and passes its panics on").map_err(|error| limit_error(py, &error))
}

/// Loads the C API of `numpy` while nothing is at stake: the crate does so with the first array, runs Python code for it,
/// and panics where a signal that came during the work before is raised in there.
pub fn load_numpy(py: Python<'_>) -> PyResult<()> {
    py.import("numpy")?;
    py.check_signals()?;
    PyArray1::<u8>::zeros(py, 0, false);
    Ok(())
}

/// Waits a little for the work; whether it has ended. The exclusive borrow lets the wait happen off the interpreter.
fn ended(finished: &mut Receiver<()>) -> bool {
    finished.recv_timeout(POLL) != Err(RecvTimeoutError::Timeout)
}

/// As [`run`], for work that knows no limits and is short or chunked by the caller.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    run(py, &Limits::default(), |_| Ok(work()))
}

/// The pool of this process, made at the first call. A parent's pool is leaked in the child: joining its threads, which
/// do not exist here, would wait for ever.
fn pool() -> PyResult<Arc<ThreadPool>> {
    let mut slot = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    match slot.take() {
        Some((owner, pool)) if owner == process => *slot = Some((owner, pool)),
        other => {
            std::mem::forget(other);
            let made = ThreadPoolBuilder::new().stack_size(STACK).build();
            let pool = made.map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
            *slot = Some((process, Arc::new(pool)));
        }
    }
    let (_, pool) = slot.as_ref().expect("filled above");
    Ok(pool.clone())
}
