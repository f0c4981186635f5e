//! A deterministic work budget, counted and not timed, so that answers are the same on any machine; and a cancellation callback.
//!
//! A search runs on one thread, and its budget is that thread's: kernels charge it without an argument. Only searches for further
//! answers check whether it is exhausted. Those found by then are assessed.
//!
//! A thread of a pool may take up another task in the middle of one, where that waits for a pool of its own. So tasks of a pool have a
//! [`TaskBudget`]: each has the limit that its caller had when all of them began, whatever else its thread was at.

use std::cell::{Cell, RefCell};
use std::sync::Arc;

/// Cancellation callback; true cancels. It is called now and then on the thread that works.
pub type Cancel = Arc<dyn Fn() -> bool + Send + Sync>;

/// Work between two calls of the cancellation callback: some milliseconds.
const POLL_INTERVAL: u64 = 4_000_000;

/// A thread's budget, in edge evaluations.
struct Budget {
    remaining: Cell<u64>,
    /// All that was charged, also beyond a limit.
    charged: Cell<u64>,
    /// Work until the cancellation callback is called again.
    until_poll: Cell<u64>,
    cancel: RefCell<Option<Cancel>>,
    canceled: Cell<bool>,
}

thread_local! {
    static BUDGET: Budget = const {
        Budget {
            remaining: Cell::new(u64::MAX),
            charged: Cell::new(0),
            until_poll: Cell::new(POLL_INTERVAL),
            cancel: RefCell::new(None),
            canceled: Cell::new(false),
        }
    };
}

/// Charges the budget by so many edges, or work that takes as long.
pub fn charge(edges: usize) {
    BUDGET.with(|budget| budget.charge(edges as u64));
}

/// Calls the cancellation callback as often as for so many edges, in work that is charged as a whole.
pub fn poll(edges: usize) {
    BUDGET.with(|budget| budget.poll(edges as u64));
}

/// Whether the budget is exhausted or the work canceled: the search ends.
pub fn is_exhausted() -> bool {
    is_canceled() || BUDGET.with(|budget| budget.remaining.get() == 0)
}

/// Whether the work was canceled, so that any answer will do.
pub fn is_canceled() -> bool {
    BUDGET.with(|budget| budget.canceled.get())
}

/// Work that may charge so much, or what is left of a bound around it, and whether it did charge it.
pub fn limited<T>(most: u64, work: impl FnOnce() -> T) -> (T, bool) {
    let before = BUDGET.with(|budget| budget.remaining.get());
    let given = most.min(before);
    let rest = Restored { before, given };
    BUDGET.with(|budget| budget.remaining.set(given));
    let found = work();
    let spent = is_exhausted();
    drop(rest);
    (found, spent)
}

/// Work, and how much it measured.
pub fn measured<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let before = charged();
    let found = work();
    (found, charged() - before)
}

/// The charge of this thread so far.
pub fn charged() -> u64 {
    BUDGET.with(|budget| budget.charged.get())
}

/// Work that ends early, with whatever it has by then, once `cancel` returns true; `None` then.
pub fn cancellable<T>(cancel: Cancel, work: impl FnOnce() -> T) -> Option<T> {
    let _waiting = CancelScope::new(cancel);
    let found = work();
    (!is_canceled()).then_some(found)
}

/// The budget of work on other threads in place of this one, with its cancellation.
pub struct TaskBudget {
    remaining: u64,
    cancel: Option<Cancel>,
    canceled: bool,
}

impl TaskBudget {
    /// The budget of this thread.
    pub fn new() -> Self {
        BUDGET.with(|budget| Self {
            remaining: budget.remaining.get(),
            cancel: budget.cancel.borrow().clone(),
            canceled: budget.canceled.get(),
        })
    }

    /// Work on any thread, which counts nothing to what that was at, and how much it measured.
    pub fn run<T>(&self, work: impl FnOnce() -> T) -> (T, u64) {
        let _instead = Replaced::new(Budget {
            remaining: Cell::new(self.remaining),
            charged: Cell::new(0),
            until_poll: Cell::new(POLL_INTERVAL),
            cancel: RefCell::new(self.cancel.clone()),
            canceled: Cell::new(self.canceled),
        });
        let found = work();
        (found, charged())
    }

    /// Charges the caller with the sum over all tasks.
    pub fn end(self, measured: u64) {
        BUDGET.with(|budget| budget.charge(measured));
    }
}

impl Default for TaskBudget {
    fn default() -> Self {
        Self::new()
    }
}

/// Another budget in place of the thread's, which is given back, also after a panic.
struct Replaced(Budget);

impl Replaced {
    fn new(own: Budget) -> Self {
        BUDGET.with(|budget| budget.swap(&own));
        Self(own)
    }
}

impl Drop for Replaced {
    fn drop(&mut self) {
        BUDGET.with(|budget| budget.swap(&self.0));
    }
}

impl Budget {
    fn swap(&self, other: &Self) {
        self.remaining.swap(&other.remaining);
        self.charged.swap(&other.charged);
        self.until_poll.swap(&other.until_poll);
        self.cancel.swap(&other.cancel);
        self.canceled.swap(&other.canceled);
    }

    fn charge(&self, edges: u64) {
        self.remaining.set(self.remaining.get().saturating_sub(edges));
        self.charged.set(self.charged.get().saturating_add(edges));
        self.poll(edges);
    }

    fn poll(&self, edges: u64) {
        match self.until_poll.get().checked_sub(edges) {
            Some(rest) => self.until_poll.set(rest),
            None => self.ask(),
        }
    }

    fn ask(&self) {
        self.until_poll.set(POLL_INTERVAL);
        // The question may be long, and must not find the cell borrowed.
        let cancel = self.cancel.borrow().clone();
        if !self.canceled.get() && cancel.is_some_and(|cancel| cancel()) {
            self.canceled.set(true);
        }
    }
}

/// Gives back, also after a panic, what a bound left of the one around it.
struct Restored {
    before: u64,
    given: u64,
}

impl Drop for Restored {
    fn drop(&mut self) {
        BUDGET.with(|budget| budget.remaining.set(self.before - (self.given - budget.remaining.get())));
    }
}

/// Leaves the thread, also after a panic, as it was.
struct CancelScope {
    cancel: Option<Cancel>,
    canceled: bool,
}

impl CancelScope {
    fn new(cancel: Cancel) -> Self {
        BUDGET.with(|budget| Self {
            cancel: budget.cancel.replace(Some(cancel)),
            canceled: budget.canceled.replace(false),
        })
    }
}

impl Drop for CancelScope {
    fn drop(&mut self) {
        BUDGET.with(|budget| {
            *budget.cancel.borrow_mut() = self.cancel.take();
            budget.canceled.set(self.canceled);
        });
    }
}

#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn work_without_a_limit_is_never_exhausted() {
        charge(usize::MAX / 2);
        assert!(!is_exhausted());
    }

    #[test]
    fn a_limit_is_exhausted_once_its_work_is_done() {
        let work = || {
            let rounds = (0..100).take_while(|_| !is_exhausted()).inspect(|_| charge(7)).count();
            (rounds, is_exhausted())
        };
        assert_eq!(limited(70, work), ((10, true), true));
        assert_eq!(limited(1000, work), ((100, false), false));
        assert!(!is_exhausted());
    }

    #[test]
    fn work_is_counted_within_bounds_and_around_them() {
        let around = || {
            charge(3);
            limited(100, || measured(|| charge(5)).1).0
        };
        assert_eq!(measured(around), (5, 8));
        assert_eq!(measured(|| limited(5, || charge(9)).1), (true, 9));
    }

    #[test]
    fn a_bound_within_another_takes_from_it() {
        let (inner, outer) = limited(100, || {
            let inner = limited(1000, || charge(60)).1;
            charge(39);
            assert!(!is_exhausted());
            charge(1);
            inner
        });
        assert!(!inner && outer);
    }

    #[test]
    fn a_panic_leaves_no_bound_behind() {
        let panicked = catch_unwind(|| {
            limited(10, || {
                charge(10);
                panic!("on purpose")
            })
        });
        assert!(panicked.is_err() && !is_exhausted());
    }

    #[test]
    fn cancellation_ends_the_work_and_that_alone() {
        let asked = Arc::new(AtomicUsize::new(0));
        let cancel: Cancel = {
            let asked = asked.clone();
            Arc::new(move || asked.fetch_add(1, Ordering::Relaxed) == 2)
        };
        let rounds = Cell::new(0);
        let work = || {
            while !is_exhausted() && rounds.get() < 100 {
                charge(POLL_INTERVAL as usize + 1);
                rounds.set(rounds.get() + 1);
            }
        };
        assert_eq!(cancellable(cancel, work), None);
        assert_eq!((rounds.get(), asked.load(Ordering::Relaxed)), (3, 3));
        assert!(!is_exhausted());
        assert_eq!(cancellable(Arc::new(|| false), || 5), Some(5));
    }

    #[test]
    fn a_task_of_a_pool_has_its_callers_bound_and_not_its_threads() {
        let (caller, spent) = limited(100, || {
            charge(30);
            let carried = TaskBudget::new();
            // As on a thread of the pool that waits in the middle of another task.
            let (tasks, other) = measured(|| {
                let task = || carried.run(|| (is_exhausted(), charge(60), is_exhausted(), charge(10), is_exhausted()));
                limited(5, || [task(), task()])
            });
            assert_eq!((tasks.1, other), (false, 0), "the other task had none of it");
            for ((begun, (), on_the_way, (), ended), measured) in tasks.0 {
                assert_eq!((begun, on_the_way, ended, measured), (false, false, true, 70));
            }
            assert!(!is_exhausted());
            measured(|| carried.end(140)).1
        });
        assert_eq!((caller, spent), (140, true));
    }

    #[test]
    fn a_task_of_a_pool_ends_with_its_callers_cancellation_and_gives_its_thread_back() {
        let asked = cancellable(Arc::new(|| true), || {
            let carried = TaskBudget::new();
            let task = || carried.run(|| (charge(POLL_INTERVAL as usize + 1), is_canceled()).1).0;
            std::thread::scope(|scope| scope.spawn(task).join().unwrap())
        });
        assert_eq!(asked, Some(true), "the caller itself has not asked yet");
        let carried = TaskBudget::new();
        assert!(catch_unwind(std::panic::AssertUnwindSafe(|| carried.run(|| panic!("on purpose")))).is_err());
        assert!(!is_canceled() && !is_exhausted());
    }
}
