//! The same work on many items, on all cores where the crate has threads.

use crate::error::Result;

/// Items that are worked on in a row: enough that threads are worth it.
const CHUNK: usize = 16;

/// `work` of every item, in order; the same on any number of threads (all cores when `None`).
#[cfg(feature = "batch")]
pub(super) fn mapped<T: Sync, A: Send>(
    items: &[T],
    threads: Option<usize>,
    work: impl Fn(&T) -> A + Sync,
) -> Result<Vec<A>> {
    let chunks: Vec<&[T]> = items.chunks(CHUNK).collect();
    let done = crate::batch::in_parallel(&chunks, threads, |chunk| Ok(chunk.iter().map(&work).collect::<Vec<A>>()))?;
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
    work: impl Fn(&T) -> A + Sync,
) -> Result<Vec<A>> {
    let _ = CHUNK;
    Ok(items.iter().map(work).collect())
}
