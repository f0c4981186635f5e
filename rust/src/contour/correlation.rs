//! How neighbours on a contour vary together (`docs/math.md`, section 11).

/// Pieces over which neighbours are taken to vary together, or in turns.
const WINDOW: usize = 12;

/// The least that a sum of neighbours may vary against independent ones.
const LEAST_CORRELATION: f64 = 0.2;

/// How many neighbours vary as one: `1 + 2 sum of the autocorrelations` up to the first that is not positive.
pub fn correlation(values: &[f64]) -> f64 {
    let product = |lag: usize| values.iter().zip(&values[lag..]).map(|(a, b)| a * b).sum::<f64>();
    let square = product(0);
    if square <= 0.0 {
        return 1.0;
    }
    let lags = (1..values.len() / 4).map(|lag| product(lag) / square).take_while(|&rho| rho > 0.0);
    1.0 + 2.0 * lags.sum::<f64>()
}

/// How much more a long sum of neighbours varies than if they were independent, by Bartlett's window: less where they take
/// turns, as the steps of a staircase do.
pub fn long_run(values: &[f64]) -> f64 {
    let product = |lag: usize| values.iter().zip(&values[lag.min(values.len())..]).map(|(a, b)| a * b).sum::<f64>();
    let square = product(0).max(f64::MIN_POSITIVE);
    let lags = (1..WINDOW).map(|lag| (1.0 - lag as f64 / WINDOW as f64) * product(lag) / square);
    (1.0 + 2.0 * lags.sum::<f64>()).max(LEAST_CORRELATION)
}
