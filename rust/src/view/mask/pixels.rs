//! The values of a mask, row by row.

use crate::error::Error;

/// Share of a pixel at which the contour of a mask runs.
pub const CONTOUR_LEVEL: f64 = 0.5;

/// A pixel's value: an integer, 0 or one other, or coverage in [0, 1].
pub trait MaskValue: Copy + PartialEq {
    /// Share of the pixel that is covered.
    fn coverage(self) -> f64;

    /// Whether a mask that holds `other` than 0 may hold this value.
    fn is_valid(self, other: Option<Self>) -> bool;

    /// What is wrong with the values of a mask that holds one that is not valid.
    fn refusal(values: &[Self]) -> Error;
}

macro_rules! integer_values {
    ($($integer:ty),*) => {$(
        impl MaskValue for $integer {
            fn coverage(self) -> f64 {
                if self == 0 { 0.0 } else { 1.0 }
            }

            fn is_valid(self, other: Option<Self>) -> bool {
                self == 0 || other.is_none_or(|other| self == other)
            }

            fn refusal(values: &[Self]) -> Error {
                let distinct: std::collections::BTreeSet<_> = values.iter().collect();
                Error::MaskIntegers { found: distinct.len() }
            }
        }
    )*};
}

macro_rules! coverage_values {
    ($($float:ty),*) => {$(
        impl MaskValue for $float {
            fn coverage(self) -> f64 {
                f64::from(self)
            }

            fn is_valid(self, _: Option<Self>) -> bool {
                (0.0..=1.0).contains(&self)
            }

            fn refusal(values: &[Self]) -> Error {
                // Unlike the least of f64::min, NaN stays.
                let least = |low: f64, value: f64| if low <= value || low.is_nan() { low } else { value };
                let shares = || values.iter().map(|&value| f64::from(value));
                let low = shares().fold(f64::INFINITY, least);
                let high = -shares().map(|share| -share).fold(f64::INFINITY, least);
                Error::MaskCoverage { found: format!("{low:?} to {high:?}").to_lowercase() }
            }
        }
    )*};
}

integer_values!(u8, i8, u16, i16, u32, i32, u64, i64);
coverage_values!(f32, f64);

/// A mask, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Mask<'a, T> {
    pub(super) values: &'a [T],
    pub(super) columns: usize,
}

impl<'a, T: MaskValue> Mask<'a, T> {
    /// The mask of `values` in rows of `columns`; `None` where they fill no whole rows or there are none.
    pub fn new(values: &'a [T], columns: usize) -> Option<Self> {
        let fills = columns > 0 && !values.is_empty() && values.len().is_multiple_of(columns);
        fills.then_some(Self { values, columns })
    }

    pub(super) fn rows(&self) -> usize {
        self.values.len() / self.columns
    }

    pub(super) fn row(&self, index: usize) -> &'a [T] {
        &self.values[index * self.columns..(index + 1) * self.columns]
    }
}
