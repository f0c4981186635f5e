//! Work without the interpreter that Ctrl-C ends all the same.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use regionpose::internals::budget::{self, Cancel};

/// How often signals are looked for while other threads work: a hundred times in the second that users wait.
const LOOK: Duration = Duration::from_millis(10);

/// The exception that a signal's handler raised, if one did.
#[derive(Clone, Default)]
struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Runs the handlers of signals that came, which only the main thread does; whether one raised.
    fn look(&self) -> bool {
        self.look_at(&|_| Ok(()))
    }

    /// Runs the handlers of signals, and what else is to be run meanwhile; whether one raised.
    fn look_at(&self, watch: &impl Fn(Python<'_>) -> PyResult<()>) -> bool {
        let Err(error) = Python::attach(|py| py.check_signals().and_then(|()| watch(py))) else { return false };
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        true
    }

    /// What was found, unless a handler raised meanwhile.
    fn or<T>(&self, found: T) -> PyResult<T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(found), Err)
    }
}

/// Work on this thread, without the interpreter.
pub fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let raised = Raised::default();
    let stop: Cancel = {
        let raised = raised.clone();
        Arc::new(move || raised.look())
    };
    let found = py.detach(|| budget::cancellable(stop, work));
    // Only an exception ends it early.
    raised.or(found)?.ok_or_else(|| PyKeyboardInterrupt::new_err(()))
}

/// Work on other threads, without the interpreter; it is handed what tells them that nobody waits any more.
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
            while ended.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if !stopped.load(Ordering::Relaxed) && raised.look_at(&watch) {
                    stopped.store(true, Ordering::Relaxed);
                }
            }
            worker.join().unwrap_or_else(|panic| resume_unwind(panic))
        })
    });
    raised.or(found)
}
