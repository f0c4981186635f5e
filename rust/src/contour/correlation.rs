//! How neighbors on a contour vary together (`docs/math.md`, section 11).

/// Pieces over which neighbors are taken to vary together, or in turns: a convention.
const WINDOW: usize = 12;

/// The least that a sum of neighbors may vary against independent ones: a convention.
const LEAST_CORRELATION: f64 = 0.2;

/// Autocorrelation of a lag, within regions of these numbers of values, over `square`.
fn product(values: &[f64], counts: &[usize], lag: usize) -> f64 {
    let (mut sum, mut first) = (0.0, 0);
    for &count in counts {
        let region = &values[first..first + count];
        sum += region.iter().zip(&region[lag.min(count)..]).map(|(a, b)| a * b).sum::<f64>();
        first += count;
    }
    sum
}

/// How many neighbors vary as one: `1 + 2 sum of the autocorrelations` up to the first that is not positive, or to a quarter
/// of the longest region.
pub fn correlation(values: &[f64], counts: &[usize]) -> f64 {
    let square = product(values, counts, 0);
    if square <= 0.0 {
        return 1.0;
    }
    let longest = counts.iter().max().map_or(0, |count| count / 4);
    let lags = (1..longest).map(|lag| product(values, counts, lag) / square).take_while(|&rho| rho > 0.0);
    1.0 + 2.0 * lags.sum::<f64>()
}

/// How much more a long sum of neighbors varies than if they were independent, by Bartlett's window: less where they take
/// turns, as the steps of a staircase do.
pub fn long_run(values: &[f64], counts: &[usize]) -> f64 {
    let square = product(values, counts, 0).max(f64::MIN_POSITIVE);
    let lags = (1..WINDOW).map(|lag| (1.0 - lag as f64 / WINDOW as f64) * product(values, counts, lag) / square);
    (1.0 + 2.0 * lags.sum::<f64>()).max(LEAST_CORRELATION)
}
