//! Budgets for work whose size cannot be told beforehand: grounding, exploring, enumerating.
//!
//! A budget that is spent ends the work with a [`LimitError`], long before the machine's own limits would. Byte counts
//! are estimates of what the structures hold, not what the allocator took.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// How much work may be done. The default suits a machine with 8 GB of memory and sets no time.
#[derive(Clone, Debug)]
pub struct Limits {
    /// Most operators of a task.
    pub operators: usize,
    /// Most facts of a task.
    pub facts: usize,
    /// Most states of a state space.
    pub states: usize,
    /// Most bytes that the structures of one call may hold.
    pub bytes: usize,
    /// Longest time that one call may take.
    pub time: Option<Duration>,
    /// Ends the work as soon as somebody sets it.
    pub interrupt: Option<Arc<AtomicBool>>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            operators: 10_000_000,
            facts: 10_000_000,
            states: 100_000_000,
            bytes: 4 << 30,
            time: None,
            interrupt: None,
        }
    }
}

/// Which budget was spent.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LimitError {
    /// The task has more operators than allowed.
    #[error("more than {limit} operators")]
    Operators {
        /// The budget.
        limit: usize,
    },
    /// The task has more facts than allowed.
    #[error("more than {limit} facts")]
    Facts {
        /// The budget.
        limit: usize,
    },
    /// The state space has more states than allowed.
    #[error("more than {limit} states")]
    States {
        /// The budget.
        limit: usize,
    },
    /// The structures hold more bytes than allowed.
    #[error("more than {limit} bytes of memory")]
    Bytes {
        /// The budget.
        limit: usize,
    },
    /// The call took longer than allowed.
    #[error("more than {} seconds", limit.as_secs_f64())]
    Time {
        /// The budget.
        limit: Duration,
    },
    /// Somebody set [`Limits::interrupt`].
    #[error("interrupted")]
    Interrupted,
}

impl LimitError {
    /// The cause in one word, as the command line and Python name it.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Operators { .. } => "operators",
            Self::Facts { .. } => "facts",
            Self::States { .. } => "states",
            Self::Bytes { .. } => "bytes",
            Self::Time { .. } => "time",
            Self::Interrupted => "interrupted",
        }
    }
}

/// The limits of one call that has begun: knows when its time is up.
///
/// ```
/// use strips_core::task::Limits;
/// let limits = Limits { operators: 3, ..Limits::default() };
/// let watch = limits.start();
/// assert!(watch.check().is_ok() && watch.operators(3).is_ok());
/// assert_eq!(watch.operators(4).unwrap_err().kind(), "operators");
/// ```
#[derive(Clone, Debug)]
pub struct Watch {
    limits: Limits,
    deadline: Option<Instant>,
}

impl Limits {
    /// Starts the clock.
    pub fn start(&self) -> Watch {
        let deadline = self.time.and_then(|time| Instant::now().checked_add(time));
        Watch { limits: self.clone(), deadline }
    }
}

impl Watch {
    /// Whether time is up or somebody interrupted; some 30 ns, so call it every few hundred steps.
    ///
    /// # Errors
    /// [`LimitError::Interrupted`] and [`LimitError::Time`].
    pub fn check(&self) -> Result<(), LimitError> {
        if self.limits.interrupt.as_ref().is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            return Err(LimitError::Interrupted);
        }
        match (self.deadline, self.limits.time) {
            (Some(deadline), Some(limit)) if Instant::now() > deadline => Err(LimitError::Time { limit }),
            _ => Ok(()),
        }
    }

    /// Whether this many operators are allowed.
    ///
    /// # Errors
    /// [`LimitError::Operators`].
    pub fn operators(&self, count: usize) -> Result<(), LimitError> {
        let limit = self.limits.operators;
        if count > limit { Err(LimitError::Operators { limit }) } else { Ok(()) }
    }

    /// Whether this many facts are allowed.
    ///
    /// # Errors
    /// [`LimitError::Facts`].
    pub fn facts(&self, count: usize) -> Result<(), LimitError> {
        let limit = self.limits.facts;
        if count > limit { Err(LimitError::Facts { limit }) } else { Ok(()) }
    }

    /// Whether this many states are allowed.
    ///
    /// # Errors
    /// [`LimitError::States`].
    pub fn states(&self, count: usize) -> Result<(), LimitError> {
        let limit = self.limits.states;
        if count > limit { Err(LimitError::States { limit }) } else { Ok(()) }
    }

    /// Whether this many bytes are allowed.
    ///
    /// # Errors
    /// [`LimitError::Bytes`].
    pub fn bytes(&self, count: usize) -> Result<(), LimitError> {
        let limit = self.limits.bytes;
        if count > limit { Err(LimitError::Bytes { limit }) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_flag_ends_the_work() {
        let flag = Arc::new(AtomicBool::new(false));
        let watch = Limits { interrupt: Some(flag.clone()), ..Limits::default() }.start();
        assert_eq!(watch.check(), Ok(()));
        flag.store(true, Ordering::Relaxed);
        assert_eq!(watch.check(), Err(LimitError::Interrupted));
    }

    #[test]
    fn time_runs_out() {
        let limit = Duration::from_nanos(1);
        let watch = Limits { time: Some(limit), ..Limits::default() }.start();
        std::thread::sleep(Duration::from_millis(1));
        assert_eq!(watch.check(), Err(LimitError::Time { limit }));
    }
}
