//! How much work a search may still do, counted and not timed, so that its answer is the same on any machine; and whether
//! anybody still waits for it.
//!
//! A search runs on one thread, and what it may spend is that thread's: kernels count what they do without being handed
//! anything. Only what looks for further answers asks whether the rest is spent. What was found by then is judged as ever.
//!
//! A thread of a pool may take up another task in the middle of one, where that waits for a pool of its own. So tasks of a
//! pool are [`Carried`]: each has the bound that its caller had when all of them began, whatever else its thread was at.

use std::cell::{Cell, RefCell};
use std::sync::Arc;

/// Whether nobody waits for the answer any more; asked now and then on the thread that works.
pub type Stop = Arc<dyn Fn() -> bool + Send + Sync>;

/// Work between two questions whether anybody waits: some milliseconds of the second that users do.
const PATIENCE: u64 = 4_000_000;

/// What a thread may spend; edges that are looked at are its unit.
struct Effort {
    left: Cell<u64>,
    /// All that was spent, also what went beyond a bound.
    done: Cell<u64>,
    /// Work until it is asked again whether anybody waits.
    unasked: Cell<u64>,
    stop: RefCell<Option<Stop>>,
    stopped: Cell<bool>,
}

thread_local! {
    static EFFORT: Effort = const {
        Effort {
            left: Cell::new(u64::MAX),
            done: Cell::new(0),
            unasked: Cell::new(PATIENCE),
            stop: RefCell::new(None),
            stopped: Cell::new(false),
        }
    };
}

/// Counts so many edges that were looked at, or work that takes as long.
pub fn spend(edges: usize) {
    EFFORT.with(|effort| effort.spend(edges as u64));
}

/// Asks as often whether anybody waits as if so many edges were looked at, of work that was counted as a whole.
pub fn pass(edges: usize) {
    EFFORT.with(|effort| effort.pass(edges as u64));
}

/// Whether nothing further is to be looked for.
pub fn is_spent() -> bool {
    is_stopped() || EFFORT.with(|effort| effort.left.get() == 0)
}

/// Whether nobody waits for the answer any more, so that any answer will do.
pub fn is_stopped() -> bool {
    EFFORT.with(|effort| effort.stopped.get())
}

/// Work that may spend so much, or what is left of a bound around it, and whether it did spend it.
pub fn bounded<T>(most: u64, work: impl FnOnce() -> T) -> (T, bool) {
    let before = EFFORT.with(|effort| effort.left.get());
    let given = most.min(before);
    let rest = Rest { before, given };
    EFFORT.with(|effort| effort.left.set(given));
    let found = work();
    let spent = is_spent();
    drop(rest);
    (found, spent)
}

/// Work, and how much it counted.
pub fn counted<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let before = done();
    let found = work();
    (found, done() - before)
}

/// What this thread has counted so far.
pub fn done() -> u64 {
    EFFORT.with(|effort| effort.done.get())
}

/// Work that ends early, with whatever it has by then, once `stop` says that nobody waits for it; `None` then.
pub fn interruptible<T>(stop: Stop, work: impl FnOnce() -> T) -> Option<T> {
    let _waiting = Waiting::new(stop);
    let found = work();
    (!is_stopped()).then_some(found)
}

/// What work on other threads may spend in place of this one, and whether anybody waits for it.
pub struct Carried {
    left: u64,
    stop: Option<Stop>,
    stopped: bool,
}

impl Carried {
    /// That of this thread.
    pub fn new() -> Self {
        EFFORT.with(|effort| Self {
            left: effort.left.get(),
            stop: effort.stop.borrow().clone(),
            stopped: effort.stopped.get(),
        })
    }

    /// Work on any thread, which counts nothing to what that was at, and how much it counted.
    pub fn run<T>(&self, work: impl FnOnce() -> T) -> (T, u64) {
        let _instead = Instead::new(Effort {
            left: Cell::new(self.left),
            done: Cell::new(0),
            unasked: Cell::new(PATIENCE),
            stop: RefCell::new(self.stop.clone()),
            stopped: Cell::new(self.stopped),
        });
        let found = work();
        (found, done())
    }

    /// Counts to the caller what all tasks together have counted.
    pub fn end(self, counted: u64) {
        EFFORT.with(|effort| effort.spend(counted));
    }
}

impl Default for Carried {
    fn default() -> Self {
        Self::new()
    }
}

/// Another effort in place of the thread's, which is given back, also after a panic.
struct Instead(Effort);

impl Instead {
    fn new(own: Effort) -> Self {
        EFFORT.with(|effort| effort.swap(&own));
        Self(own)
    }
}

impl Drop for Instead {
    fn drop(&mut self) {
        EFFORT.with(|effort| effort.swap(&self.0));
    }
}

impl Effort {
    fn swap(&self, other: &Self) {
        self.left.swap(&other.left);
        self.done.swap(&other.done);
        self.unasked.swap(&other.unasked);
        self.stop.swap(&other.stop);
        self.stopped.swap(&other.stopped);
    }

    fn spend(&self, edges: u64) {
        self.left.set(self.left.get().saturating_sub(edges));
        self.done.set(self.done.get().saturating_add(edges));
        self.pass(edges);
    }

    fn pass(&self, edges: u64) {
        match self.unasked.get().checked_sub(edges) {
            Some(rest) => self.unasked.set(rest),
            None => self.ask(),
        }
    }

    fn ask(&self) {
        self.unasked.set(PATIENCE);
        // The question may be long, and must not find the cell borrowed.
        let stop = self.stop.borrow().clone();
        if !self.stopped.get() && stop.is_some_and(|stop| stop()) {
            self.stopped.set(true);
        }
    }
}

/// Gives back, also after a panic, what a bound left of the one around it.
struct Rest {
    before: u64,
    given: u64,
}

impl Drop for Rest {
    fn drop(&mut self) {
        EFFORT.with(|effort| effort.left.set(self.before - (self.given - effort.left.get())));
    }
}

/// Leaves the thread, also after a panic, as it was.
struct Waiting {
    stop: Option<Stop>,
    stopped: bool,
}

impl Waiting {
    fn new(stop: Stop) -> Self {
        EFFORT.with(|effort| Self { stop: effort.stop.replace(Some(stop)), stopped: effort.stopped.replace(false) })
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        EFFORT.with(|effort| {
            *effort.stop.borrow_mut() = self.stop.take();
            effort.stopped.set(self.stopped);
        });
    }
}

#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn work_without_a_bound_is_never_spent() {
        spend(usize::MAX / 2);
        assert!(!is_spent());
    }

    #[test]
    fn a_bound_is_spent_once_its_work_is_done() {
        let look = || {
            let rounds = (0..100).take_while(|_| !is_spent()).inspect(|_| spend(7)).count();
            (rounds, is_spent())
        };
        assert_eq!(bounded(70, look), ((10, true), true));
        assert_eq!(bounded(1000, look), ((100, false), false));
        assert!(!is_spent());
    }

    #[test]
    fn work_is_counted_within_bounds_and_around_them() {
        let around = || {
            spend(3);
            bounded(100, || counted(|| spend(5)).1).0
        };
        assert_eq!(counted(around), (5, 8));
        assert_eq!(counted(|| bounded(5, || spend(9)).1), (true, 9));
    }

    #[test]
    fn a_bound_within_another_takes_from_it() {
        let (inner, outer) = bounded(100, || {
            let inner = bounded(1000, || spend(60)).1;
            spend(39);
            assert!(!is_spent());
            spend(1);
            inner
        });
        assert!(!inner && outer);
    }

    #[test]
    fn a_panic_leaves_no_bound_behind() {
        let panicked = catch_unwind(|| {
            bounded(10, || {
                spend(10);
                panic!("on purpose")
            })
        });
        assert!(panicked.is_err() && !is_spent());
    }

    #[test]
    fn nobody_waiting_ends_the_work_and_that_alone() {
        let asked = Arc::new(AtomicUsize::new(0));
        let stop: Stop = {
            let asked = asked.clone();
            Arc::new(move || asked.fetch_add(1, Ordering::Relaxed) == 2)
        };
        let rounds = Cell::new(0);
        let work = || {
            while !is_spent() && rounds.get() < 100 {
                spend(PATIENCE as usize + 1);
                rounds.set(rounds.get() + 1);
            }
        };
        assert_eq!(interruptible(stop, work), None);
        assert_eq!((rounds.get(), asked.load(Ordering::Relaxed)), (3, 3));
        assert!(!is_spent());
        assert_eq!(interruptible(Arc::new(|| false), || 5), Some(5));
    }

    #[test]
    fn a_task_of_a_pool_has_its_callers_bound_and_not_its_threads() {
        let (caller, spent) = bounded(100, || {
            spend(30);
            let carried = Carried::new();
            // As on a thread of the pool that waits in the middle of another task.
            let (tasks, other) = counted(|| {
                let task = || carried.run(|| (is_spent(), spend(60), is_spent(), spend(10), is_spent()));
                bounded(5, || [task(), task()])
            });
            assert_eq!((tasks.1, other), (false, 0), "the other task had none of it");
            for ((begun, (), on_the_way, (), ended), counted) in tasks.0 {
                assert_eq!((begun, on_the_way, ended, counted), (false, false, true, 70));
            }
            assert!(!is_spent());
            counted(|| carried.end(140)).1
        });
        assert_eq!((caller, spent), (140, true));
    }

    #[test]
    fn a_task_of_a_pool_ends_when_nobody_waits_for_its_caller_and_gives_its_thread_back() {
        let asked = interruptible(Arc::new(|| true), || {
            let carried = Carried::new();
            let task = || carried.run(|| (spend(PATIENCE as usize + 1), is_stopped()).1).0;
            std::thread::scope(|scope| scope.spawn(task).join().unwrap())
        });
        assert_eq!(asked, Some(true), "the caller itself has not asked yet");
        let carried = Carried::new();
        assert!(catch_unwind(std::panic::AssertUnwindSafe(|| carried.run(|| panic!("on purpose")))).is_err());
        assert!(!is_stopped() && !is_spent());
    }
}
