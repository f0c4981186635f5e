//! The same work on many items, on all cores where the crate has threads.

use crate::budget::Budget;
use crate::error::Result;

/// Items that are worked on in a row: enough that threads are worth it.
const CHUNK: usize = 16;

/// `work` of every item, in order; the same on any number of threads (all cores when `None`).
#[cfg(feature = "batch")]
pub(super) fn mapped<T: Sync, A: Send>(
    items: &[T],
    threads: Option<usize>,
    work: impl Fn(&T, &Budget) -> A + Sync,
    budget: &Budget,
) -> Result<Vec<A>> {
    let chunks: Vec<&[T]> = items.chunks(CHUNK).collect();
    let all = |chunk: &&[T], budget: &Budget| {
        // A chunk is shorter than the interval between two polls, and each has a budget of its own.
        budget.poll(usize::MAX);
        Ok(chunk.iter().map(|item| work(item, budget)).collect::<Vec<A>>())
    };
    let done = crate::batch::in_parallel_within(&chunks, threads, all, budget)?;
    // Of a thread that ended early the caller must know, or would take what it has for an answer.
    budget.poll(usize::MAX);
    let mut made = Vec::with_capacity(items.len());
    for chunk in done {
        made.extend(chunk?);
    }
    Ok(made)
}

/// `work` of every item, in order.
#[cfg(not(feature = "batch"))]
pub(super) fn mapped<T: Sync, A: Send>(
    items: &[T],
    _threads: Option<usize>,
    work: impl Fn(&T, &Budget) -> A + Sync,
    budget: &Budget,
) -> Result<Vec<A>> {
    let all = |chunk: &[T]| {
        budget.poll(usize::MAX);
        chunk.iter().map(|item| work(item, budget)).collect::<Vec<A>>()
    };
    Ok(items.chunks(CHUNK).flat_map(all).collect())
}
