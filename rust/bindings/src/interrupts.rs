//! Work without the interpreter's lock that Ctrl-C cancels.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use regionpose::internals::budget::{self, Cancel};

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
    fn or<T>(&self, found: T) -> PyResult<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(found), Err)
    }
}

/// Work on this thread, without the interpreter.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let raised = Raised::default();
    let stop: Cancel = {
        let raised = raised.clone();
        Arc::new(move || raised.poll())
    };
    let found = py.detach(|| budget::cancellable(stop, work));
    // Only an exception ends it early.
    raised.or(found)?.ok_or_else(|| PyKeyboardInterrupt::new_err(()))
}

/// Work on other threads, without the interpreter; `work` receives their cancellation callback.
pub fn detached_threads<T: Send>(py: Python<'_>, work: impl FnOnce(&Cancel) -> T + Send) -> PyResult<T> {
    watched_threads(py, |_| Ok(()), work)
}

/// The same, `watch` being run on the calling thread a hundred times a second until it fails, which ends the work.
pub fn watched_threads<T: Send>(
    py: Python<'_>,
    watch: impl Fn(Python<'_>) -> PyResult<()> + Sync,
    work: impl FnOnce(&Cancel) -> T + Send,
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
                work(&stop)
            });
            while ended.recv_timeout(POLL_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                if !stopped.load(Ordering::Relaxed) && raised.poll_with(&watch) {
                    stopped.store(true, Ordering::Relaxed);
                }
            }
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    });
    raised.or(found)
}
