//! Autocorrelation of values along contours, by Geyer's initial positive sequence (`docs/math.md`, section 11).

use super::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Least integrated autocorrelation time: a convention.
const LEAST_CORRELATION: f64 = 0.2;

/// Autocovariance of a lag, within regions of these numbers of values.
struct Product<'a> {
    values: &'a [f64],
    counts: &'a [usize],
    lag: usize,
}

impl NullaryFnOnce for Product<'_> {
    type Output = f64;

    #[inline(always)]
    fn call(self) -> f64 {
        let (mut sum, mut rest) = (Lanes::ZERO, 0.0);
        for region in split(self.values, self.counts) {
            let later = &region[self.lag.min(region.len())..];
            let (groups, later_groups) = (region[..later.len()].as_chunks::<LANES>(), later.as_chunks::<LANES>());
            groups.0.iter().zip(later_groups.0).for_each(|(a, b)| sum += Lanes(*a) * Lanes(*b));
            groups.1.iter().zip(later_groups.1).for_each(|(a, b)| rest += a * b);
        }
        sum.sum() + rest
    }
}

fn product(values: &[f64], counts: &[usize], lag: usize) -> f64 {
    vectorized(Product { values, counts, lag })
}

/// Integrated autocorrelation time: the ratio of the variance of a long sum of neighbors to that of independent ones; below one where
/// neighbors alternate, as the steps of a staircase do.
///
/// `1 + 2 sum of the autocorrelations`, summed in pairs up to the first pair that is not positive (Geyer 1992, section 3.3).
pub fn correlation(values: &[f64], counts: &[usize]) -> f64 {
    let square = product(values, counts, 0);
    if square <= 0.0 {
        return 1.0;
    }
    let longest = counts.iter().max().copied().unwrap_or(0);
    let pair = |lag| (product(values, counts, lag) + product(values, counts, lag + 1)) / square;
    let pairs = (0..longest.max(1)).step_by(2).map(pair).take_while(|&pair| pair > 0.0);
    (2.0 * pairs.sum::<f64>() - 1.0).max(LEAST_CORRELATION)
}

/// By how many standard deviations of chance the sum of differences exceeds zero: by their own scatter about the mean of their
/// region, since that a region fits one pose as a whole and another not at all is no chance (`docs/math.md`, eq. 11.7).
pub fn sigmas(differences: &[f64], counts: &[usize]) -> f64 {
    let scatter: Vec<f64> = split(differences, counts).flat_map(centered).collect();
    let square = scatter.iter().map(|value| value * value).sum::<f64>() * correlation(&scatter, counts).max(1.0);
    differences.iter().sum::<f64>() / square.sqrt().max(f64::MIN_POSITIVE)
}

/// Consecutive parts of these lengths.
pub(crate) fn split<'a, T>(values: &'a [T], lengths: &'a [usize]) -> impl Iterator<Item = &'a [T]> + 'a {
    let mut rest = values;
    lengths.iter().map(move |&length| {
        let (part, others) = rest.split_at(length);
        rest = others;
        part
    })
}

pub(crate) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

pub(crate) fn centered(values: &[f64]) -> Vec<f64> {
    let mean = mean(values);
    values.iter().map(|value| value - mean).collect()
}
