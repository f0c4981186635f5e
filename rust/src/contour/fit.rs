//! Robust registration of projected boundaries to contours, by expectation maximization (`docs/math.md`, section 11).

use std::f64::consts::FRAC_PI_2;
use std::sync::OnceLock;

use nalgebra::{Matrix6, Vector6};

use super::mixture::{Distances, Mixture};
use super::readings::{Contour, Reading};
use super::region_preference::{RegionPreference, compare_by_region, of_counted};
use crate::budget::Budget;
use crate::equations::normal_equations::NormalEquations;
use crate::equations::step_bounds::{backtracked, clamped};
use crate::geometry::pose::{Pose, Tangent};
use crate::math::autocorrelation::{centered, correlation, mean, sigmas, split};
use crate::math::gaussian::Gaussian;
use crate::math::normal::MAD_TO_SIGMA;
use crate::math::odds::DECISIVE_DEVIANCE;
use crate::noise::boundary::{DRAWN, FINE, HALF_LEVEL, MEDIUM};
use crate::noise::contamination::{LEAST_RATIO, MAJORITY, PRIOR_SHARE};

/// Gauss-Newton steps from one reading of the nearest edges to the next at most: from 10 degrees off one step converges less often
/// than two (`cargo test directions::`), and a third takes a tenth more time. And such rounds at the finest scale: a convention.
const STEPS: usize = 2;
const LAST_ROUNDS: usize = 8;

/// A step that moves the boundary by less than this share of the pieces' distances, in the mean square, ends the iteration: a
/// tenth of the resolution of a thousand pieces.
const CONVERGED: f64 = 3e-3;

/// Added to the diagonal of the normal equations, as a share of it, so that a free direction stays where it is: above
/// their rounding, below the information of any piece.
const RIDGE: f64 = 1e-9;

/// A pose with the contours' residuals and their mixture.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContourFit {
    /// The pose about the problem's origin.
    pub pose: Pose,
    /// The distances' distribution.
    pub mixture: Mixture,
    readings: Vec<Reading>,
    /// Number of the readings of each region.
    counts: Vec<usize>,
    /// One piece in so many was read.
    step: usize,
    /// Probability of each reading to be clean, computed on demand.
    #[cfg_attr(feature = "serde", serde(skip))]
    clean: OnceLock<Vec<f64>>,
}

impl ContourFit {
    /// The fit at a pose about the problem's origin, from every `step`-th piece of the boundaries; `None` where a region is out
    /// of view.
    #[doc(hidden)]
    pub fn at(contours: &[Contour], pose: &Pose, step: usize, budget: &Budget) -> Option<Self> {
        Some(Self::of(*pose, Readings::at(contours, pose, step, budget)?, step))
    }

    fn of(pose: Pose, readings: Readings, step: usize) -> Self {
        let mixture = readings.distances().mixture(FINE);
        Self { pose, mixture, readings: readings.all, counts: readings.counts, step, clean: OnceLock::new() }
    }

    /// The one of two fits with the larger likelihood.
    fn max_likelihood(self, other: Self) -> Self {
        if other.mixture.likelihood > self.mixture.likelihood { other } else { self }
    }

    /// The readings of each region, and its number.
    #[doc(hidden)]
    pub fn regions(&self) -> impl Iterator<Item = (usize, &[Reading])> {
        split(&self.readings, &self.counts).enumerate()
    }

    /// One piece in so many was read.
    #[doc(hidden)]
    pub fn step(&self) -> usize {
        self.step
    }

    /// Root of the mean square of the distances of the contours' points, pixels.
    pub fn root_mean_square(&self) -> f64 {
        let square = |reading: &Reading| reading.distance * reading.distance + reading.spread;
        let squares: f64 = self.readings.iter().map(square).sum();
        (squares / self.readings.len().max(1) as f64).sqrt()
    }

    /// The distance beyond which a piece is an outlier, pixels.
    #[doc(hidden)]
    pub fn outlier_threshold(&self) -> f64 {
        LEAST_RATIO * self.mixture.sigma
    }

    fn of_each<T>(&self, value: impl Fn(usize, &Reading) -> T) -> Vec<T> {
        let value = &value;
        self.regions()
            .flat_map(|(region, readings)| readings.iter().map(move |reading| value(region, reading)))
            .collect()
    }

    fn clean(&self) -> &[f64] {
        self.clean.get_or_init(|| self.of_each(|region, reading| self.mixture.clean_probability(region, reading)))
    }

    /// Share of the clean pieces of each region.
    pub fn clean_shares(&self) -> Vec<f64> {
        split(self.clean(), &self.counts).map(mean).collect()
    }

    /// Whether the pieces scatter by less than a pixel, and hardly one lies far off.
    #[doc(hidden)]
    pub fn is_clean(&self) -> bool {
        let limit = self.outlier_threshold();
        let outliers = self.readings.iter().filter(|reading| reading.robust_distance > limit).count();
        self.mixture.sigma < MEDIUM && (outliers as f64) < PRIOR_SHARE * self.readings.len() as f64
    }

    /// Pieces of the contours that vary independently of each other.
    ///
    /// Where most of every contour is clean, the clean pieces, whose noise is hardly correlated; elsewhere stretches disturbed as
    /// a whole, or clean, some of which match a wrong pose by chance.
    pub fn independent(&self) -> f64 {
        let shares = self.clean_shares();
        if shares.iter().all(|&share| share > MAJORITY) {
            let clean = shares.iter().zip(&self.counts).map(|(share, &count)| share * count as f64);
            return self.step as f64 * clean.sum::<f64>();
        }
        let clean = self.clean();
        // A region that is disturbed as a whole has no information on the length of disturbances.
        let about_mean: Vec<f64> = split(clean, &self.counts).flat_map(centered).collect();
        clean.len() as f64 / correlation(&about_mean, &self.counts).max(1.0)
    }

    /// The contours' likelihood as a factor of the pose's left increment, to second order, of as many pieces as vary
    /// independently; `None` where a region is out of view.
    #[doc(hidden)]
    pub fn gaussian(&self, contours: &[Contour], budget: &Budget) -> Option<Gaussian> {
        let regions = self.region_gaussians(contours, budget)?.into_iter();
        let sum = regions.fold(Gaussian::default(), |sum, region| sum + region);
        Some(Gaussian { offset: self.independent() * self.mixture.likelihood, ..sum })
    }

    /// The same of each region's contour, but for a multiple.
    #[doc(hidden)]
    pub fn region_gaussians(&self, contours: &[Contour], budget: &Budget) -> Option<Vec<Gaussian>> {
        let share = self.independent() / self.readings.len().max(1) as f64;
        let factor = share / (self.mixture.sigma * self.mixture.sigma);
        let region = |((region, readings), contour): ((usize, &[Reading]), &Contour)| {
            let (odds, mut equations) = (self.mixture.odds(region), NormalEquations::default());
            let weight = |reading: &Reading| odds.weight(reading);
            contour.add_normal_equations(&self.pose, self.step, readings, weight, &mut equations, budget)?;
            let (information, vector) = (equations.information * factor, equations.gradient * -factor);
            Some(Gaussian { information, information_vector: vector, offset: 0.0 })
        };
        self.regions().zip(contours).map(region).collect()
    }

    /// Standard deviation of a normal boundary noise with the same mean distance, pixels (`docs/math.md`, eq. 6.6).
    pub fn noise(&self) -> f64 {
        let distances = self.readings.iter().map(|reading| reading.distance.abs());
        // Of a normal distribution, over its mean absolute deviation.
        FRAC_PI_2.sqrt() * distances.sum::<f64>() / self.readings.len().max(1) as f64
    }

    /// By how much the log likelihood exceeds that of another pose for the same pieces, over those that vary independently.
    ///
    /// Clean pieces are correlated, too, where they scatter by more than their own noise.
    #[doc(hidden)]
    pub fn gain_over(&self, other: &Self) -> f64 {
        let pulls = self.readings.iter().zip(self.clean()).map(|(reading, clean)| clean * reading.distance);
        let alike = correlation(&pulls.collect::<Vec<_>>(), &self.counts).max(1.0);
        let independent = self.independent().min((self.step * self.readings.len()) as f64 / alike);
        independent * (self.mixture.likelihood - other.mixture.likelihood)
    }

    /// Deviance of another pose on the same pieces, in variances (`docs/math.md`, eq. 11.7): twice the ratio of the log
    /// likelihoods, of no more pieces than there are degrees of freedom of the noise (`numbers`), bounded where the
    /// difference may be chance. Where regions belong to one of both poses alone, more regions decide, not longer contours, and of
    /// as many on either side those that lie farther off at the other pose.
    #[doc(hidden)]
    pub fn deviance_to(&self, other: &Self, numbers: f64) -> f64 {
        let preferences = self.region_preferences(other);
        compare_by_region(&preferences, [&self.distances(), &other.distances()], |counted| {
            let densities = |fit: &Self| fit.of_each(|region, reading| fit.mixture.log_density(region, reading));
            let differences = densities(self).into_iter().zip(densities(other)).map(|(a, b)| a - b).collect::<Vec<_>>();
            let share = self.independent().min(numbers) / self.readings.len().max(1) as f64;
            let (differences, counts) = of_counted(&differences, &self.counts, counted);
            let sigmas = sigmas(&differences, &counts);
            (2.0 * share * differences.iter().sum::<f64>()).min(DECISIVE_DEVIANCE * sigmas * sigmas.abs())
        })
    }

    /// Root of the mean square of the distances of each region's pieces, pixels.
    fn distances(&self) -> Vec<f64> {
        let of = |(_, readings): (usize, &[Reading])| {
            let squares: f64 = readings.iter().map(|reading| reading.robust_distance * reading.robust_distance).sum();
            (squares / readings.len().max(1) as f64).sqrt()
        };
        self.regions().map(of).collect()
    }

    /// Which of this pose and another each region belongs to: alone to one where half more of its contour lies on the projection
    /// than at the other. Both are held to the closer one's scatter, as of one photo.
    #[doc(hidden)]
    pub fn region_preferences(&self, other: &Self) -> Vec<RegionPreference> {
        let limit = self.outlier_threshold().min(other.outlier_threshold());
        let on_contour = |readings: &[Reading]| {
            readings.iter().filter(|reading| reading.robust_distance <= limit).count() as f64
                / readings.len().max(1) as f64
        };
        let shares = self.regions().zip(other.regions()).map(|((_, own), (_, others))| [own, others].map(on_contour));
        shares.map(|[own, others]| RegionPreference::of(own > others + MAJORITY, others > own + MAJORITY)).collect()
    }
}

/// Readings of several regions.
struct Readings {
    all: Vec<Reading>,
    counts: Vec<usize>,
}

impl Readings {
    fn at(contours: &[Contour], pose: &Pose, step: usize, budget: &Budget) -> Option<Self> {
        let mut all = Vec::with_capacity(contours.iter().map(|contour| contour.count(step)).sum());
        for contour in contours {
            contour.read(pose, step, &mut all, budget)?;
        }
        Some(Self { all, counts: contours.iter().map(|contour| contour.count(step)).collect() })
    }

    fn distances(&self) -> Distances {
        Distances::new(split(&self.all, &self.counts))
    }

    /// The distance within which half of the pieces lie, pixels.
    fn median(&self) -> f64 {
        let mut distances: Vec<f64> = self.all.iter().map(|reading| reading.robust_distance).collect();
        let middle = distances.len() / 2;
        if distances.is_empty() {
            return 0.0;
        }
        *distances.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    fn mean_log_density(&self, mixture: &Mixture) -> f64 {
        let regions = split(&self.all, &self.counts).enumerate();
        let of = |(region, readings): (usize, &[Reading])| {
            readings.iter().map(|reading| mixture.log_density(region, reading)).sum::<f64>()
        };
        regions.map(of).sum::<f64>() / self.all.len().max(1) as f64
    }
}

/// The likelihood of unrefined poses: mean log density of some pieces by one fixed mixture.
#[derive(Debug, Clone)]
pub struct FixedMixture<'a> {
    contours: &'a [Contour],
    step: usize,
    mixture: Mixture,
    budget: &'a Budget,
}

impl<'a> FixedMixture<'a> {
    /// The fixed mixture, evaluated at every `step`-th piece.
    pub fn new(contours: &'a [Contour], step: usize, budget: &'a Budget) -> Self {
        let size = contours.iter().map(Contour::size).fold(0.0, f64::max);
        Self { contours, step, mixture: Mixture::even(DRAWN, size / LEAST_RATIO, contours.len()), budget }
    }

    /// Minus the mean logarithm of the density at a pose; infinite where a region is out of view, and the largest number
    /// where the budget is exhausted.
    pub fn negative_log_density(&self, pose: &Pose) -> f64 {
        if self.budget.is_exhausted() {
            return f64::MAX;
        }
        let readings = Readings::at(self.contours, pose, self.step, self.budget);
        readings.map_or(f64::INFINITY, |readings| -readings.mean_log_density(&self.mixture))
    }
}

/// The most likely pose that is reached from a start on every `step`-th piece; a pose on the way where that is likelier.
///
/// Expectation-maximization, while the scale of the clean pieces falls from one at which half of them are to the finest:
/// what lies far off loses its weight step by step. `None` where a region is out of view at the start.
pub fn refined(contours: &[Contour], start: &Pose, step: usize, budget: &Budget) -> Option<ContourFit> {
    let readings = Readings::at(contours, start, step, budget)?;
    let scale = MAD_TO_SIGMA * readings.median();
    refined_from(contours, start, step, readings, scale, budget)
}

/// The same from a fit to fewer pieces, from whose own scatter the scale falls: outliers there stay so.
pub fn refined_again(contours: &[Contour], fit: &ContourFit, step: usize, budget: &Budget) -> Option<ContourFit> {
    let readings = Readings::at(contours, &fit.pose, step, budget)?;
    refined_from(contours, &fit.pose, step, readings, fit.outlier_threshold(), budget)
}

fn refined_from(
    contours: &[Contour],
    start: &Pose,
    step: usize,
    mut readings: Readings,
    mut scale: f64,
    budget: &Budget,
) -> Option<ContourFit> {
    let mut pose = *start;
    let mut likeliest = (f64::NEG_INFINITY, pose);
    loop {
        let distances = readings.distances();
        let mixture = distances.mixture_of(scale, distances.root_mean_square());
        if mixture.likelihood > likeliest.0 {
            likeliest = (mixture.likelihood, pose);
        }
        if budget.is_exhausted() {
            break;
        }
        // The comparison fails for a scale that is not finite, too.
        let last = !(scale > FINE && scale.is_finite());
        // Of a few pieces the place is not final.
        for _ in 0..if last && step == 1 { LAST_ROUNDS } else { 1 } {
            let (next, converged) = stepped(contours, pose, step, &readings, &mixture, budget);
            readings = Readings::at(contours, &next, step, budget)?;
            pose = next;
            if converged {
                break;
            }
        }
        if last {
            break;
        }
        scale = (scale / HALF_LEVEL).max(FINE);
    }
    let last = ContourFit::of(pose, readings, step);
    // A pose on the way is likelier still by a mixture whose scale is free.
    match likeliest.0 > last.mixture.likelihood {
        true => ContourFit::at(contours, &likeliest.1, step, budget).map(|fit| last.max_likelihood(fit)),
        false => Some(last),
    }
}

/// The pose after Gauss-Newton steps by the weights of one mixture, with each piece's edge fixed, and whether the first step
/// was below the tolerance.
fn stepped(
    contours: &[Contour],
    start: Pose,
    step: usize,
    readings: &Readings,
    mixture: &Mixture,
    budget: &Budget,
) -> (Pose, bool) {
    let mut pose = start;
    for number in 0..STEPS {
        let Some(equations) = equations_at(contours, &pose, step, readings, mixture, budget) else { break };
        let Some(increment) = gauss_newton(&equations) else { return (pose, true) };
        let Some(next) = advanced(contours, &pose, &increment) else { return (pose, true) };
        pose = next;
        if increment.dot(&(equations.information * increment)) <= CONVERGED * CONVERGED * equations.cost {
            return (pose, number == 0);
        }
    }
    (pose, false)
}

/// The normal equations of the distances by the weights of a mixture; `None` where a region is out of view.
fn equations_at(
    contours: &[Contour],
    pose: &Pose,
    step: usize,
    readings: &Readings,
    mixture: &Mixture,
    budget: &Budget,
) -> Option<NormalEquations> {
    let mut equations = NormalEquations::default();
    for (region, (contour, before)) in contours.iter().zip(split(&readings.all, &readings.counts)).enumerate() {
        let odds = mixture.odds(region);
        let weight = |reading: &Reading| match mixture.sigma > FINE {
            // At coarse scales outliers have no weight; at the finest the gradient is that of the whole density.
            true => odds.clean_probability(reading),
            false => odds.weight(reading),
        };
        contour.add_normal_equations(pose, step, before, weight, &mut equations, budget)?;
    }
    Some(equations)
}

/// The Gauss-Newton step of the weighted least squares; `None` where the normal equations are singular.
fn gauss_newton(equations: &NormalEquations) -> Option<Tangent> {
    let ridge = Matrix6::from_diagonal(&(equations.information.diagonal() * RIDGE));
    let increment: Vector6<f64> = -(equations.information + ridge).cholesky()?.solve(&equations.gradient);
    increment.iter().all(|value| value.is_finite()).then_some(increment)
}

/// The pose moved by an increment, shortened until every region is in view.
fn advanced(contours: &[Contour], pose: &Pose, increment: &Tangent) -> Option<Pose> {
    let in_view = |moved: &Pose| contours.iter().all(|contour| contour.is_in_view(moved));
    backtracked(pose, &clamped(increment, pose), in_view)
}
