//! How neighbors on a contour vary together (`docs/math.md`, section 11).

/// The least that a sum of neighbors may vary against independent ones: a convention.
const LEAST_CORRELATION: f64 = 0.2;

/// Share of the longest region over which neighbors are followed: beyond it too few pairs are left. A convention.
const FOLLOWED: f64 = 0.25;

/// Autocovariance of a lag, within regions of these numbers of values.
fn product(values: &[f64], counts: &[usize], lag: usize) -> f64 {
    let (mut sum, mut first) = (0.0, 0);
    for &count in counts {
        let region = &values[first..first + count];
        sum += region.iter().zip(&region[lag.min(count)..]).map(|(a, b)| a * b).sum::<f64>();
        first += count;
    }
    sum
}

/// How much more a long sum of neighbors varies than if they were independent: less where they take turns, as the steps of a
/// staircase do.
///
/// `1 + 2 sum of the autocorrelations`, summed in pairs up to the first pair that is not positive (Geyer 1992, section 3.3).
pub fn correlation(values: &[f64], counts: &[usize]) -> f64 {
    let square = product(values, counts, 0);
    if square <= 0.0 {
        return 1.0;
    }
    let longest = counts.iter().max().map_or(0.0, |&count| FOLLOWED * count as f64) as usize;
    let pair = |lag| (product(values, counts, lag) + product(values, counts, lag + 1)) / square;
    let pairs = (0..longest.max(1)).step_by(2).map(pair).take_while(|&pair| pair > 0.0);
    (2.0 * pairs.sum::<f64>() - 1.0).max(LEAST_CORRELATION)
}
