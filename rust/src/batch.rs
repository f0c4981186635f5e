//! Many problems at once, on a pool of threads of its own.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use crate::budget::Budget;
use crate::error::{Error, Result};

/// `solve` of every problem, in order, on `threads` threads (all cores when `None`); the same whatever their number. A problem that
/// panics has that error in its place ([`Error::Panicked`]), and the others have their answers.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::{ObservedRegion, Problem, WorldRegion, in_parallel};
/// # let corners = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)];
/// # let sign: Vec<_> = corners.iter().map(|&(x, y)| Vector3::new(x, y, 0.0)).collect();
/// let world = WorldRegion::from_rings(&[sign.clone()])?;
/// let images: Vec<ObservedRegion> = [3.0, 4.0, 5.0]
///     .map(|distance| sign.iter().map(|x| x + Vector3::new(-0.2, 0.1, distance)).collect())
///     .map(|bearings| ObservedRegion::new(vec![bearings], 20_000.0))
///     .to_vec();
/// let solve = |image: &ObservedRegion| {
///     Problem::new(std::slice::from_ref(image), std::slice::from_ref(&world))?.estimate()
/// };
/// // Each has an answer of its own: one that is refused leaves the others theirs.
/// let answers = in_parallel(&images, None, solve)?;
/// assert!(answers.iter().all(|answer| answer.is_ok()));
/// # Ok::<(), regionpose::Error>(())
/// ```
///
/// # Errors
/// When the threads cannot be started or their number is zero.
pub fn in_parallel<P: Sync, A: Send>(
    problems: &[P],
    threads: Option<usize>,
    solve: impl Fn(&P) -> Result<A> + Sync,
) -> Result<Vec<Result<A>>> {
    in_parallel_within(problems, threads, |problem, _| solve(problem), &Budget::unlimited())
}

/// The same within a budget: each problem has what is left of it now, and it is charged with their sum.
///
/// # Errors
/// As of [`in_parallel`].
pub fn in_parallel_within<P: Sync, A: Send>(
    problems: &[P],
    threads: Option<usize>,
    solve: impl Fn(&P, &Budget) -> Result<A> + Sync,
    budget: &Budget,
) -> Result<Vec<Result<A>>> {
    if threads == Some(0) {
        return Err(Error::InvalidOption { item: "threads", found: "0".into(), needed: "at least 1".into() });
    }
    // A pool of its own: the process-wide one deadlocks in a forked child.
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .map_err(|error| Error::Threads { reason: error.to_string() })?;
    // Nothing is shared that a panic could leave half done.
    let guarded = |problem, budget: &Budget| {
        catch_unwind(AssertUnwindSafe(|| solve(problem, budget))).unwrap_or_else(|held| Err(panicked(&*held)))
    };
    let tasks = budget.for_tasks();
    let task = |problem| {
        let budget = tasks.begin();
        (guarded(problem, &budget), budget.charged())
    };
    let solved: Vec<_> = pool.install(|| problems.par_iter().map(task).collect());
    budget.charge_sum(solved.iter().map(|(_, charged)| charged).sum());
    Ok(solved.into_iter().map(|(answer, _)| answer).collect())
}

/// The error of a panic, with its message.
fn panicked(held: &(dyn Any + Send)) -> Error {
    let text = held.downcast_ref::<&str>().copied().or_else(|| held.downcast_ref::<String>().map(String::as_str));
    Error::Panicked { reason: text.unwrap_or("nothing").to_owned() }
}
