//! The values of a mask, in one pass: what they are, where they lie, and which run above the level.

use std::ops::Range;

use super::pixels::{CONTOUR_LEVEL, Mask, MaskValue};
use crate::error::{Error, Result};

/// Values that are compared at once: some registers of the processor for every type.
const CHUNK: usize = 64;

/// Columns at which rows change sides of the level, each row's in turn.
#[derive(Debug, Default)]
pub(super) struct Runs {
    /// Where runs at or above the level begin, and where they end (excluded), in turns.
    changes: Vec<usize>,
    /// Number of changes before the end of each row.
    ends: Vec<usize>,
}

impl Runs {
    /// The changes of a row.
    pub(super) fn row(&self, index: usize) -> &[usize] {
        let begin = if index == 0 { 0 } else { self.ends[index - 1] };
        &self.changes[begin..self.ends[index]]
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.ends.len()
    }
}

/// Values, window and runs of a mask, by one pass.
pub(super) struct Scan {
    /// Rows from the first to the last that hold any coverage, and columns of the same.
    pub(super) rows: Range<usize>,
    pub(super) columns: Range<usize>,
    pub(super) binary: bool,
    /// Runs of those rows.
    pub(super) runs: Runs,
}

impl Scan {
    /// # Errors
    /// As of [`super::MaskContours::of`].
    pub(super) fn of<T: MaskValue>(mask: Mask<'_, T>) -> Result<Self> {
        let mut pass = Pass::new();
        for index in 0..mask.rows() {
            let held = pass.takes(mask.row(index)).ok_or_else(|| T::refusal(mask.values))?;
            pass.ends_row(index, held);
        }
        // A pixel at the level itself is no more than a point of the contour.
        if pass.highest > CONTOUR_LEVEL { Ok(pass.scan()) } else { Err(Error::EmptyMask) }
    }
}

/// A scan under way.
struct Pass<T> {
    /// The least and the largest row and column that hold any coverage.
    rows: Option<[usize; 2]>,
    columns: [usize; 2],
    /// The first value other than 0.
    other: Option<T>,
    highest: f64,
    binary: bool,
    /// Runs of the rows from the first that holds any coverage on.
    runs: Runs,
}

impl<T: MaskValue> Pass<T> {
    fn new() -> Self {
        let (columns, runs) = ([usize::MAX, 0], Runs::default());
        Self { rows: None, columns, other: None, highest: 0.0, binary: true, runs }
    }

    /// Whether a row holds any coverage; `None` where a value is not valid. The row's runs are kept.
    fn takes(&mut self, row: &[T]) -> Option<bool> {
        let (mut above, mut held) = (false, false);
        for (column, count, value) in value_runs(row) {
            let share = self.checked_share(value)?;
            if (share >= CONTOUR_LEVEL) != above {
                above = !above;
                self.runs.changes.push(column);
            }
            if share > 0.0 {
                held = true;
                self.columns = [self.columns[0].min(column), self.columns[1].max(column + count - 1)];
            }
        }
        if above {
            self.runs.changes.push(row.len());
        }
        Some(held)
    }

    /// The coverage of a valid value.
    fn checked_share(&mut self, value: T) -> Option<f64> {
        if !value.is_valid(self.other) {
            return None;
        }
        let share = value.coverage();
        if share > 0.0 {
            self.other = self.other.or(Some(value));
            self.highest = self.highest.max(share);
            self.binary &= share == 1.0;
        }
        Some(share)
    }

    fn ends_row(&mut self, index: usize, held: bool) {
        if held {
            self.rows = Some([self.rows.map_or(index, |[first, _]| first), index]);
        }
        if self.rows.is_some() {
            self.runs.ends.push(self.runs.changes.len());
        }
    }

    /// The result of the pass, without the rows below the last one that holds coverage.
    fn scan(mut self) -> Scan {
        let range = |[first, last]: [usize; 2]| first..last + 1;
        let rows = self.rows.map_or(0..0, range);
        self.runs.ends.truncate(rows.len());
        Scan { rows, columns: range(self.columns), binary: self.binary, runs: self.runs }
    }
}

/// Where each run of one value begins, its length, and that value.
fn value_runs<T: MaskValue>(row: &[T]) -> impl Iterator<Item = (usize, usize, T)> + '_ {
    let mut begin = 0;
    std::iter::from_fn(move || {
        let value = *row.get(begin)?;
        let run = (begin, run_length(&row[begin..], value), value);
        begin += run.1;
        Some(run)
    })
}

/// Number of values up to the first that is another.
fn run_length<T: MaskValue>(values: &[T], value: T) -> usize {
    // Without an early end within a chunk, which would keep the compiler from comparing its values at once.
    let is_same = |chunk: &&[T]| !chunk.iter().fold(false, |differs, &other| differs | (other != value));
    let same = CHUNK * values.chunks_exact(CHUNK).take_while(is_same).count();
    values[same..].iter().position(|&other| other != value).map_or(values.len(), |more| same + more)
}
