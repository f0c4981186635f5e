//! Many problems at once, on a pool of threads of its own.

use rayon::ThreadPoolBuilder;
use rayon::prelude::*;

use crate::error::{Error, Result};

/// `solve` of every problem, in order, on `threads` threads (all cores when `None`); the same whatever their number.
///
/// # Errors
/// When the threads cannot be started or their number is zero.
pub fn in_parallel<P: Sync, A: Send>(
    problems: &[P],
    threads: Option<usize>,
    solve: impl Fn(&P) -> A + Sync,
) -> Result<Vec<A>> {
    if threads == Some(0) {
        return Err(Error::OutOfRange { item: "threads", found: "0".into(), needed: "at least 1".into() });
    }
    // A pool of its own: the process-wide one deadlocks in a forked child.
    let pool = ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build().map_err(|error| Error::Threads {
        reason: error.to_string(),
    })?;
    Ok(pool.install(|| problems.par_iter().map(&solve).collect()))
}
