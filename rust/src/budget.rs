//! A deterministic work budget, counted and not timed, so that answers are the same on any machine; and a cancellation callback.
//!
//! Searches and kernels take a budget as their last argument and charge it. Only searches for further answers check whether it is
//! exhausted. Those found by then are assessed.
//!
//! A budget is one thread's. Tasks of a pool have budgets of their own ([`TaskBudget`]): each has the limit that its caller had when all
//! of them began, and the caller is charged with their sum.

use std::cell::Cell;
use std::fmt::{Debug, Formatter, Result};
use std::rc::Rc;
use std::sync::Arc;

/// Cancellation callback; true cancels. It is called now and then on the thread that works.
pub type Cancel = Arc<dyn Fn() -> bool + Send + Sync>;

/// Work between two calls of the cancellation callback: some milliseconds.
const POLL_INTERVAL: u64 = 4_000_000;

/// A budget of work, in edge evaluations.
pub struct Budget {
    remaining: Cell<u64>,
    /// All that was charged, also beyond a limit.
    charged: Cell<u64>,
    /// Shared with the budgets within limits.
    cancellation: Rc<Cancellation>,
}

struct Cancellation {
    cancel: Option<Cancel>,
    canceled: Cell<bool>,
    /// Work until the callback is called again.
    until_poll: Cell<u64>,
}

impl Budget {
    /// A budget without a limit.
    pub fn unlimited() -> Self {
        Self::new(u64::MAX, None, false)
    }

    /// A budget without a limit, of work that ends early, with what was found by then, once `cancel` returns true.
    pub fn cancellable(cancel: Cancel) -> Self {
        Self::new(u64::MAX, Some(cancel), false)
    }

    fn new(remaining: u64, cancel: Option<Cancel>, canceled: bool) -> Self {
        let (canceled, until_poll) = (Cell::new(canceled), Cell::new(POLL_INTERVAL));
        let cancellation = Rc::new(Cancellation { cancel, canceled, until_poll });
        Self { remaining: Cell::new(remaining), charged: Cell::new(0), cancellation }
    }

    /// Charges the budget by so many edges, or work that takes as long.
    pub fn charge(&self, edges: usize) {
        self.charge_sum(edges as u64);
    }

    /// Charges the budget by the sum over all tasks of a pool.
    pub fn charge_sum(&self, edges: u64) {
        self.remaining.set(self.remaining.get().saturating_sub(edges));
        self.charged.set(self.charged.get().saturating_add(edges));
        self.cancellation.poll(edges);
    }

    /// Calls the cancellation callback as often as for so many edges, in work that is charged as a whole.
    pub fn poll(&self, edges: usize) {
        self.cancellation.poll(edges as u64);
    }

    /// The charge so far.
    pub fn charged(&self) -> u64 {
        self.charged.get()
    }

    /// Whether the budget is exhausted or the work canceled: the search ends.
    pub fn is_exhausted(&self) -> bool {
        self.is_canceled() || self.remaining.get() == 0
    }

    /// Whether the work was canceled, so that any answer will do.
    pub fn is_canceled(&self) -> bool {
        self.cancellation.canceled.get()
    }

    /// Work that may charge so much, or what is left of this budget, and whether it did charge it.
    pub fn limited<T>(&self, most: u64, work: impl FnOnce(&Self) -> T) -> (T, bool) {
        let given = most.min(self.remaining.get());
        let (remaining, cancellation) = (Cell::new(given), self.cancellation.clone());
        let inner = Self { remaining, charged: Cell::new(0), cancellation };
        let found = work(&inner);
        self.remaining.set(self.remaining.get() - (given - inner.remaining.get()));
        self.charged.set(self.charged.get().saturating_add(inner.charged.get()));
        (found, inner.is_exhausted())
    }

    /// What the budgets of a pool's tasks begin with.
    pub fn for_tasks(&self) -> TaskBudget {
        let Cancellation { cancel, canceled, .. } = self.cancellation.as_ref();
        TaskBudget { remaining: self.remaining.get(), cancel: cancel.clone(), canceled: canceled.get() }
    }
}

impl Debug for Budget {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> Result {
        let Self { remaining, charged, .. } = self;
        let mut shown = formatter.debug_struct("Budget");
        shown.field("remaining", remaining).field("charged", charged).finish_non_exhaustive()
    }
}

impl Cancellation {
    fn poll(&self, edges: u64) {
        match self.until_poll.get().checked_sub(edges) {
            Some(rest) => self.until_poll.set(rest),
            None => self.ask(),
        }
    }

    #[cold]
    fn ask(&self) {
        self.until_poll.set(POLL_INTERVAL);
        if !self.canceled.get() && self.cancel.as_ref().is_some_and(|cancel| cancel()) {
            self.canceled.set(true);
        }
    }
}

/// The limit and the cancellation of tasks on other threads.
pub struct TaskBudget {
    remaining: u64,
    cancel: Option<Cancel>,
    canceled: bool,
}

impl TaskBudget {
    /// The budget of one task.
    pub fn begin(&self) -> Budget {
        Budget::new(self.remaining, self.cancel.clone(), self.canceled)
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn work_without_a_limit_is_never_exhausted() {
        let budget = Budget::unlimited();
        budget.charge(usize::MAX / 2);
        assert!(!budget.is_exhausted());
    }

    #[test]
    fn a_limit_is_exhausted_once_its_work_is_done() {
        let work = |budget: &Budget| {
            let rounds = (0..100).take_while(|_| !budget.is_exhausted()).inspect(|_| budget.charge(7)).count();
            (rounds, budget.is_exhausted())
        };
        let budget = Budget::unlimited();
        assert_eq!(budget.limited(70, work), ((10, true), true));
        assert_eq!(budget.limited(1000, work), ((100, false), false));
        assert!(!budget.is_exhausted());
    }

    #[test]
    fn work_is_counted_within_limits_and_around_them() {
        let budget = Budget::unlimited();
        budget.charge(3);
        let within = |budget: &Budget| {
            budget.charge(5);
            budget.charged()
        };
        assert_eq!((budget.limited(100, within), budget.charged()), ((5, false), 8));
        assert_eq!((budget.limited(5, |budget| budget.charge(9)).1, budget.charged()), (true, 17));
    }

    #[test]
    fn a_limit_within_another_takes_from_it() {
        let (inner, outer) = Budget::unlimited().limited(100, |budget| {
            let inner = budget.limited(1000, |budget| budget.charge(60)).1;
            budget.charge(39);
            assert!(!budget.is_exhausted());
            budget.charge(1);
            inner
        });
        assert!(!inner && outer);
    }

    #[test]
    fn a_limit_takes_no_more_than_itself_from_the_one_around_it() {
        Budget::unlimited().limited(100, |budget| {
            assert!(budget.limited(10, |budget| budget.charge(95)).1);
            budget.charge(89);
            assert!(!budget.is_exhausted());
            budget.charge(1);
            assert!(budget.is_exhausted());
        });
    }

    #[test]
    fn a_panic_leaves_no_limit_behind() {
        let budget = Budget::unlimited();
        let panicked = catch_unwind(AssertUnwindSafe(|| {
            budget.limited(10, |budget| {
                budget.charge(10);
                panic!("on purpose")
            })
        }));
        assert!(panicked.is_err() && !budget.is_exhausted());
    }

    #[test]
    fn cancellation_ends_the_work_and_that_alone() {
        let asked = Arc::new(AtomicUsize::new(0));
        let cancel: Cancel = {
            let asked = asked.clone();
            Arc::new(move || asked.fetch_add(1, Ordering::Relaxed) == 2)
        };
        let budget = Budget::cancellable(cancel);
        let mut rounds = 0;
        while !budget.is_exhausted() && rounds < 100 {
            budget.charge(POLL_INTERVAL as usize + 1);
            rounds += 1;
        }
        assert!(budget.is_canceled());
        assert_eq!((rounds, asked.load(Ordering::Relaxed)), (3, 3));
        assert!(!Budget::unlimited().is_canceled());
        let other = Budget::cancellable(Arc::new(|| false));
        other.charge(POLL_INTERVAL as usize + 1);
        assert!(!other.is_exhausted());
    }

    #[test]
    fn what_is_canceled_within_a_limit_is_canceled_around_it_and_the_other_way_round() {
        let budget = Budget::cancellable(Arc::new(|| true));
        let ((before, after), spent) = budget.limited(u64::MAX, |budget| {
            let before = budget.is_canceled();
            budget.poll(usize::MAX);
            (before, budget.is_canceled())
        });
        assert_eq!((before, after, spent, budget.is_canceled(), budget.charged()), (false, true, true, true, 0));
        assert_eq!(budget.limited(1, Budget::is_exhausted), (true, true));
    }

    #[test]
    fn work_within_limits_is_counted_until_the_next_poll() {
        let budget = Budget::cancellable(Arc::new(|| true));
        let half = |budget: &Budget| budget.charge(POLL_INTERVAL as usize / 2 + 1);
        assert!(!budget.limited(u64::MAX, half).1 && budget.limited(u64::MAX, half).1);
    }

    #[test]
    fn a_task_of_a_pool_has_its_callers_limit() {
        let (caller, spent) = Budget::unlimited().limited(100, |budget| {
            budget.charge(30);
            let tasks = budget.for_tasks();
            let task = || {
                let budget = tasks.begin();
                let begun = budget.is_exhausted();
                budget.charge(60);
                let on_the_way = budget.is_exhausted();
                budget.charge(10);
                (begun, on_the_way, budget.is_exhausted(), budget.charged())
            };
            let ended =
                std::thread::scope(|scope| [(); 2].map(|()| scope.spawn(task)).map(|each| each.join().unwrap()));
            assert_eq!(ended, [(false, false, true, 70); 2]);
            assert!(!budget.is_exhausted());
            budget.charge_sum(140);
            budget.charged()
        });
        assert_eq!((caller, spent), (170, true));
    }

    #[test]
    fn a_task_of_a_pool_ends_with_its_callers_cancellation() {
        let budget = Budget::cancellable(Arc::new(|| true));
        let tasks = budget.for_tasks();
        let task = || {
            let budget = tasks.begin();
            budget.charge(POLL_INTERVAL as usize + 1);
            budget.is_canceled()
        };
        assert!(std::thread::scope(|scope| scope.spawn(task).join().unwrap()));
        assert!(!budget.is_canceled(), "the caller itself has not asked yet");
        budget.poll(usize::MAX);
        assert!(budget.for_tasks().begin().is_canceled());
    }
}
