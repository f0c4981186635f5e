//! The robust likelihood of a pose: a mixture of two normal distributions, inliers and outliers, of the distances between contours
//! and projected boundaries (`docs/math.md`, eq. 11.5).

use super::degrees_of_freedom::PRIOR_OBSERVATIONS;
use super::readings::Reading;
use crate::noise::boundary::{CALIBRATION, HALF_LEVEL};
use crate::noise::contamination::PRIOR_SHARE;

/// Ratio of neighboring bins, far finer than the scales; those nearer than what calibrations leave are one: a convention.
const BIN_RATIO: f64 = 1.2;

/// Bins, up to 1e5 pixels.
const BINS: usize = 80;

/// Steps of expectation-maximization for the shares and the wide scale at a narrow one, and from those at half of
/// it: conventions.
const ITERATIONS: usize = 8;
const NEXT_ITERATIONS: usize = 3;

/// Initial values: the wide scale over the root of the mean square, and the disturbed share. Conventions.
const FIRST_WIDE: f64 = 1.2;
const FIRST_SHARE: f64 = 0.3;

/// Odds from which a piece is disturbed for certain in double precision: one less the inverse of more rounds to one.
const CERTAIN: f64 = 8.0 / f64::EPSILON;

/// Two normal distributions of distances, of the clean pieces and of the disturbed ones, and the share of these in each region.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Mixture {
    /// Standard deviation of the clean ones, pixels.
    pub sigma: f64,
    /// Standard deviation of the disturbed ones, pixels.
    pub outlier_sigma: f64,
    /// Share of the disturbed ones, region by region.
    pub outlier_fractions: Vec<f64>,
    /// Mean logarithm of the density over all pieces, in 1 / pixels.
    pub likelihood: f64,
}

impl Mixture {
    /// A mixture that is not fitted: half of the pieces of so many regions clean, the rest disturbed.
    #[doc(hidden)]
    pub fn even(sigma: f64, wide: f64, regions: usize) -> Self {
        Self {
            sigma,
            outlier_sigma: wide.max(HALF_LEVEL * sigma),
            outlier_fractions: vec![0.5; regions],
            likelihood: f64::NAN,
        }
    }

    /// Probability that a piece of a region is clean.
    #[doc(hidden)]
    pub fn clean_probability(&self, region: usize, reading: &Reading) -> f64 {
        self.odds(region).clean_probability(reading)
    }

    /// Logarithm of the density at a piece of a region, in 1 / pixels.
    #[doc(hidden)]
    pub fn log_density(&self, region: usize, reading: &Reading) -> f64 {
        let square = reading.robust_distance * reading.robust_distance;
        let disturbed = self.outlier_fractions[region];
        log_sum((1.0 - disturbed) * density(square, self.sigma), disturbed * density(square, self.outlier_sigma))
    }

    /// The odds that a region's pieces are disturbed, by their distance.
    #[doc(hidden)]
    pub fn odds(&self, region: usize) -> Odds {
        let (disturbed, ratio) = (self.outlier_fractions[region], self.sigma / self.outlier_sigma);
        Odds {
            nearest: disturbed / (1.0 - disturbed) * ratio,
            fall: 0.5 * (self.sigma.powi(-2) - self.outlier_sigma.powi(-2)),
            least: ratio * ratio,
        }
    }
}

/// Inlier probability and weight of a region's pieces by their distance.
#[derive(Debug, Clone, Copy)]
pub struct Odds {
    /// Odds of a piece at zero distance.
    nearest: f64,
    /// Decrease of the log odds per squared pixel.
    fall: f64,
    /// Weight of a piece that is disturbed for certain.
    least: f64,
}

impl Odds {
    /// Probability that a piece is clean.
    pub fn clean_probability(&self, reading: &Reading) -> f64 {
        1.0 / (1.0 + self.nearest * (self.fall * (reading.robust_distance * reading.robust_distance)).exp())
    }

    /// Weight of a piece's squared distance: derivative of the log density by it, over that of a clean piece.
    pub fn weight(&self, reading: &Reading) -> f64 {
        self.clean_and_weight(reading).1
    }

    /// Clean probability and weight.
    pub fn clean_and_weight(&self, reading: &Reading) -> (f64, f64) {
        let clean = self.clean_probability(reading);
        (clean, clean + (1.0 - clean) * self.least)
    }
}

/// Histograms of distances, in pixels, in steps of a constant ratio: one a region.
#[derive(Debug, Clone)]
pub struct Distances {
    /// (mean square, number) of each bin that holds any.
    regions: Vec<Vec<(f64, f64)>>,
    count: f64,
}

/// (mean square, number) of each bin that holds any of these distances.
fn binned(distances: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    let mut sums = [(0.0, 0.0); BINS];
    for distance in distances {
        let bin = ((distance / CALIBRATION).max(1.0).ln() / BIN_RATIO.ln()) as usize;
        let (squares, held) = &mut sums[bin.min(BINS - 1)];
        *squares += distance * distance;
        *held += 1.0;
    }
    sums.into_iter().filter(|bin| bin.1 > 0.0).map(|(squares, held)| (squares / held, held)).collect()
}

impl Distances {
    /// The histograms of readings, region by region.
    pub fn new<'a>(regions: impl Iterator<Item = &'a [Reading]>) -> Self {
        let regions: Vec<_> =
            regions.map(|region| binned(region.iter().map(|reading| reading.robust_distance))).collect();
        let count = regions.iter().flatten().map(|bin| bin.1).sum();
        Self { regions, count }
    }

    /// Root of the mean square of all distances, pixels.
    pub fn root_mean_square(&self) -> f64 {
        let squares: f64 = self.regions.iter().flatten().map(|(square, held)| square * held).sum();
        (squares / self.count.max(1.0)).sqrt()
    }

    /// The likeliest mixture whose narrow scale is at least `finest` pixels.
    pub fn mixture(&self, finest: f64) -> Mixture {
        let spread = self.root_mean_square();
        let mut best = self.mixture_of(finest, spread);
        let mut next = best.clone();
        while (HALF_LEVEL * next.sigma).powi(2) < HALF_LEVEL * spread * spread {
            next.sigma *= HALF_LEVEL;
            self.improve_times(NEXT_ITERATIONS, &mut next, None);
            if next.likelihood > best.likelihood {
                best = next.clone();
            }
        }
        self.improve_times(ITERATIONS, &mut best, Some(finest));
        best
    }

    /// The likeliest shares and wide scale for a narrow scale, by expectation-maximization.
    pub fn mixture_of(&self, sigma: f64, spread: f64) -> Mixture {
        let mut mixture = Mixture {
            sigma,
            outlier_sigma: (FIRST_WIDE * spread).max(HALF_LEVEL * sigma),
            outlier_fractions: vec![FIRST_SHARE; self.regions.len()],
            likelihood: f64::NAN,
        };
        self.improve_times(ITERATIONS, &mut mixture, None);
        mixture
    }

    fn improve_times(&self, times: usize, mixture: &mut Mixture, finest: Option<f64>) {
        (0..times).for_each(|_| self.improve(mixture, finest));
        mixture.likelihood = self.likelihood(mixture);
    }

    /// One step of expectation-maximization; the narrow scale stays as it is, or at least `finest` where that is given.
    fn improve(&self, mixture: &mut Mixture, finest: Option<f64>) {
        let (mut others, mut squares, mut all, mut all_squares) = (0.0, 0.0, 0.0, 0.0);
        let fall = 0.5 * (mixture.sigma.powi(-2) - mixture.outlier_sigma.powi(-2));
        let ratio = mixture.sigma / mixture.outlier_sigma;
        for (bins, share) in self.regions.iter().zip(&mut mixture.outlier_fractions) {
            let odds = *share / (1.0 - *share) * ratio;
            let (mut count, mut disturbed, certain) = (0.0, 0.0, (CERTAIN / odds).ln());
            for &(square, held) in bins {
                let exponent = fall * square;
                let clean = if exponent >= certain { 0.0 } else { 1.0 / (1.0 + odds * exponent.exp()) };
                let expected = held * (1.0 - clean);
                count += held;
                disturbed += expected;
                squares += square * expected;
                all_squares += square * held;
            }
            others += disturbed;
            all += count;
            // The prior counts as one observation.
            *share = (disturbed + PRIOR_OBSERVATIONS * PRIOR_SHARE) / (count + PRIOR_OBSERVATIONS);
        }
        if let Some(finest) = finest {
            mixture.sigma =
                ((all_squares - squares) / (all - others).max(f64::MIN_POSITIVE)).max(0.0).sqrt().max(finest);
        }
        mixture.outlier_sigma = (squares / others.max(f64::MIN_POSITIVE)).sqrt().max(HALF_LEVEL * mixture.sigma);
    }

    /// Mean logarithm of the density over all pieces.
    fn likelihood(&self, mixture: &Mixture) -> f64 {
        let of = |(bins, share): (&Vec<(f64, f64)>, &f64)| {
            let log = |&(square, held): &(f64, f64)| {
                held * log_sum(
                    (1.0 - share) * density(square, mixture.sigma),
                    share * density(square, mixture.outlier_sigma),
                )
            };
            bins.iter().map(log).sum::<f64>()
        };
        self.regions.iter().zip(&mixture.outlier_fractions).map(of).sum::<f64>() / self.count.max(1.0)
    }
}

fn log_sum(clean: f64, disturbed: f64) -> f64 {
    (clean + disturbed).max(f64::MIN_POSITIVE).ln()
}

/// Normal density at a squared distance.
fn density(square: f64, sigma: f64) -> f64 {
    (-0.5 * square / (sigma * sigma)).exp() / (sigma * (2.0 * std::f64::consts::PI).sqrt())
}
