//! Work without the interpreter's lock that Ctrl-C cancels.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use regionpose::internals::budget::{Budget, Cancel};

/// Interval between polls of signals while other threads work: Ctrl-C takes effect at once for a user.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// The exception that a signal's handler raised, if one did.
#[derive(Clone, Default)]
struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Runs the handlers of pending signals, which only the main thread does; whether one raised.
    fn poll(&self) -> bool {
        self.poll_with(&|_| Ok(()))
    }

    /// Runs the handlers of pending signals, and `watch`; whether one raised.
    fn poll_with(&self, watch: &impl Fn(Python<'_>) -> PyResult<()>) -> bool {
        let Err(error) = Python::attach(|py| py.check_signals().and_then(|()| watch(py))) else { return false };
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        true
    }

    /// The result, or the error that a handler raised meanwhile.
    fn or_interrupted<T>(&self, found: Option<T>) -> PyResult<T> {
        let raised = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        // Only an exception ends work early.
        raised.map_or(found.ok_or_else(|| PyKeyboardInterrupt::new_err(())), Err)
    }
}

/// What all budgets of this process were charged, in edge evaluations.
static CHARGED: AtomicU64 = AtomicU64::new(0);

/// Work charged so far to the budgets of searches and meshes of this process, in edge evaluations.
#[pyfunction]
pub fn work_counter() -> u64 {
    CHARGED.load(Ordering::Relaxed)
}

/// Work within a budget of its own, which is counted; `None` where it was canceled.
fn cancellable<T>(cancel: Cancel, work: impl FnOnce(&Budget) -> T) -> Option<T> {
    let budget = Budget::cancellable(cancel);
    let found = work(&budget);
    CHARGED.fetch_add(budget.charged(), Ordering::Relaxed);
    (!budget.is_canceled()).then_some(found)
}

/// Work on this thread, without the interpreter.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce(&Budget) -> T + Send) -> PyResult<T> {
    let raised = Raised::default();
    let stop: Cancel = {
        let raised = raised.clone();
        Arc::new(move || raised.poll())
    };
    let found = py.detach(|| cancellable(stop, work));
    raised.or_interrupted(found)
}

/// Work on other threads, without the interpreter.
pub fn detached_threads<T: Send>(py: Python<'_>, work: impl FnOnce(&Budget) -> T + Send) -> PyResult<T> {
    watched_threads(py, |_| Ok(()), work)
}

/// The same, `watch` being run on the calling thread a hundred times a second until it fails, which ends the work.
pub fn watched_threads<T: Send>(
    py: Python<'_>,
    watch: impl Fn(Python<'_>) -> PyResult<()> + Sync,
    work: impl FnOnce(&Budget) -> T + Send,
) -> PyResult<T> {
    let (raised, stopped) = (Raised::default(), Arc::new(AtomicBool::new(false)));
    let stop: Cancel = {
        let stopped = stopped.clone();
        Arc::new(move || stopped.load(Ordering::Relaxed))
    };
    let found = py.detach(|| {
        thread::scope(|scope| {
            let (end, ended) = channel::<()>();
            let worker = scope.spawn(move || {
                // Dropped with the work's end, also by a panic.
                let _end = end;
                cancellable(stop, work)
            });
            while ended.recv_timeout(POLL_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                if !stopped.load(Ordering::Relaxed) && raised.poll_with(&watch) {
                    stopped.store(true, Ordering::Relaxed);
                }
            }
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    });
    raised.or_interrupted(found)
}
