//! Distances of which a part is clean and the rest disturbed: two normal distributions, a narrow and a wide one.

/// Least distance that is told from zero, pixels, and the ratio of neighbouring bins, far finer than the scales.
const FIRST_BIN: f64 = 0.05;
const BIN_RATIO: f64 = 1.15;

/// Bins, up to 6e4 pixels.
const BINS: usize = 100;

/// Ratio of neighbouring scales that are tried.
const SCALE_RATIO: f64 = 1.5;

/// Steps of expectation and maximization for the share and the wide scale at each narrow one.
const ITERATIONS: usize = 8;

/// Bounds of the disturbed share.
const SHARES: (f64, f64) = (1e-3, 0.999);

/// The wide scale over the narrow one at least.
const WIDE: f64 = 2.0;

/// Standard deviation of a normal distribution over its median absolute value.
const SIGMA_OVER_MEDIAN: f64 = 1.482_602_218_505_602;

/// A normal distribution of the clean distances and a wider one of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixture {
    /// Standard deviation of the clean ones, pixels.
    pub sigma: f64,
    /// Standard deviation of the disturbed ones, pixels.
    pub wide: f64,
    /// Share of the disturbed ones.
    pub disturbed: f64,
    /// Mean logarithm of the density, in 1 / pixels.
    pub likelihood: f64,
}

impl Mixture {
    /// Probability that a distance is a clean one.
    pub fn clean_probability(&self, distance: f64) -> f64 {
        let [clean, other] = self.densities(distance);
        clean / (clean + other).max(f64::MIN_POSITIVE)
    }

    /// Logarithm of the density at a distance, in 1 / pixels.
    pub fn log_density(&self, distance: f64) -> f64 {
        self.densities(distance).iter().sum::<f64>().max(f64::MIN_POSITIVE).ln()
    }

    /// Densities of the clean ones and of the others at a distance.
    fn densities(&self, distance: f64) -> [f64; 2] {
        let square = distance * distance;
        [(1.0 - self.disturbed) * density(square, self.sigma), self.disturbed * density(square, self.wide)]
    }
}

/// A histogram of absolute distances, in pixels, in steps of a constant ratio.
#[derive(Debug, Clone)]
pub struct Distances {
    /// (mean square, share) of each bin that holds any.
    bins: Vec<(f64, f64)>,
}

impl Distances {
    /// The histogram of these distances.
    pub fn new(distances: impl Iterator<Item = f64>) -> Self {
        let mut sums = vec![(0.0, 0.0); BINS];
        let mut count = 0.0;
        for distance in distances {
            let size = distance.abs();
            let bin = ((size / FIRST_BIN).max(1.0).ln() / BIN_RATIO.ln()) as usize;
            let (squares, held) = &mut sums[bin.min(BINS - 1)];
            *squares += size * size;
            *held += 1.0;
            count += 1.0;
        }
        let bins = sums.into_iter().filter(|bin| bin.1 > 0.0).map(|(squares, held)| (squares / held, held / count));
        Self { bins: bins.collect() }
    }

    /// Standard deviation of a normal distribution with the same median, pixels.
    pub fn robust_sigma(&self) -> f64 {
        let mut below = 0.0;
        let median = self.bins.iter().find(|(_, share)| {
            below += share;
            below >= 0.5
        });
        SIGMA_OVER_MEDIAN * median.map_or(0.0, |(square, _)| square.sqrt())
    }

    /// Share of the distances beyond a limit, pixels.
    pub fn share_beyond(&self, limit: f64) -> f64 {
        self.bins.iter().filter(|(square, _)| *square > limit * limit).map(|(_, share)| share).sum()
    }

    /// The likeliest mixture whose narrow scale is at least `finest` pixels.
    pub fn mixture(&self, finest: f64) -> Mixture {
        let mean_square = self.mean_square();
        let mut best = self.mixture_of(finest, mean_square);
        let mut sigma = finest * SCALE_RATIO;
        while sigma * sigma < SCALE_RATIO * mean_square {
            let other = self.mixture_of(sigma, mean_square);
            if other.likelihood > best.likelihood {
                best = other;
            }
            sigma *= SCALE_RATIO;
        }
        best
    }

    fn mean_square(&self) -> f64 {
        self.bins.iter().map(|(square, share)| square * share).sum()
    }

    /// The likeliest share and wide scale for a narrow scale, by expectation and maximization.
    fn mixture_of(&self, sigma: f64, mean_square: f64) -> Mixture {
        let mut wide = (1.2 * mean_square.sqrt()).max(WIDE * sigma);
        let mut disturbed = 0.3;
        let narrow: Vec<f64> = self.bins.iter().map(|bin| density(bin.0, sigma)).collect();
        let mut totals = vec![0.0; narrow.len()];
        for _ in 0..ITERATIONS {
            let (mut share_sum, mut square_sum) = (0.0, 0.0);
            for ((&(square, share), &narrow), total) in self.bins.iter().zip(&narrow).zip(&mut totals) {
                let other = disturbed * density(square, wide);
                *total = ((1.0 - disturbed) * narrow + other).max(f64::MIN_POSITIVE);
                share_sum += share * other / *total;
                square_sum += share * square * other / *total;
            }
            disturbed = share_sum.clamp(SHARES.0, SHARES.1);
            wide = (square_sum / share_sum.max(f64::MIN_POSITIVE)).sqrt().max(WIDE * sigma);
        }
        // Of the densities before the last step.
        let likelihood = self.bins.iter().zip(&totals).map(|(bin, total)| bin.1 * total.ln()).sum();
        Mixture { sigma, wide, disturbed, likelihood }
    }
}

/// Normal density at a squared distance.
fn density(square: f64, sigma: f64) -> f64 {
    (-0.5 * square / (sigma * sigma)).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt())
}
