//! The result: the best pose, the others that fit, its covariance and overlap, and what to be warned of.

use nalgebra::{Matrix3, Matrix6, Vector3};
use thiserror::Error as Message;

use crate::contour::{ContourFit, contour_fit, refined};
use crate::equations::Weighting;
use crate::fit::region_overlap;
use crate::least_squares::Minimum;
use crate::overlap::OverlapAreas;
use crate::pose::Pose;
use crate::solve::{Prior, Problem, Search, Start};

/// Costs nearer than this many variances of the noise are equal: symmetries of a shape differ by round-off alone.
const TIE_COST: f64 = 1e-3;

/// Step, in radians, in which poses of equal cost are put in order.
const TIE_STEP: f64 = 1e-3;

/// Overlap error above which a solution does not count as solved (paper section 3).
const POOR_OVERLAP: f64 = 0.05;

/// Standard deviation of the rotation about its weakest axis above which the geometry is called weak, rad (1 degree, the
/// paper's bound for solved).
const WEAK_ROTATION: f64 = std::f64::consts::PI / 180.0;

/// Standard deviation of the translation along its weakest axis above which the geometry is called weak, as a share of the
/// distance to the regions.
const WEAK_TRANSLATION: f64 = 0.02;

/// Difference of log likelihood over independent parts of the contour below which poses fit alike: five standard deviations.
const AMBIGUITY_LIKELIHOOD: f64 = 12.5;

/// Gain of log likelihood over independent parts of the contour below which a refined pose isn't preferred to the moments':
/// six parameters gain 3 by chance, and 7 more stand for odds of a thousand to one.
const DECISIVE_LIKELIHOOD: f64 = 10.0;

/// Minima that are led onto the contours at most, those of the least cost.
const MOST_REFINED: usize = 12;

/// Poses nearer than this, rad and share of the distance, are one place on the contours: both were led there.
const SAME_PLACE: f64 = 1e-3;

/// What follows the solution of the moment equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Refinement {
    /// The projected boundary is drawn onto the observed contour where a part of that is disturbed.
    #[default]
    Contour,
    /// Nothing.
    Off,
}

/// What a user has to know before trusting a pose.
#[derive(Debug, Clone, PartialEq, Message)]
#[non_exhaustive]
pub enum Warning {
    /// Other poses fit as well.
    #[error(
        "{count} other pose(s) fit as well, the nearest {degrees:.1} deg away: the regions are symmetric or too few"
    )]
    Ambiguous {
        /// How many.
        count: usize,
        /// Rotation to the nearest of them.
        degrees: f64,
    },
    /// The least squares did not end at a minimum.
    #[error("the least squares did not converge: {termination}")]
    NotConverged {
        /// Why it ended.
        termination: String,
    },
    /// A projected region does not cover the observed one.
    #[error("region {region} projected with this pose misses the observed one by {percent:.1} % of its area")]
    PoorOverlap {
        /// The region.
        region: usize,
        /// Overlap error in percent.
        percent: f64,
    },
    /// The regions hold the pose only weakly.
    #[error(
        "weak geometry: {degrees:.2} deg about camera axis [{}] and {share:.1} % of the distance along [{}] (1 sigma)", shown(.axis), shown(.along)
    )]
    WeakGeometry {
        /// Largest standard deviation of the rotation, degrees.
        degrees: f64,
        /// The camera axis it is about.
        axis: Vector3<f64>,
        /// Largest standard deviation of the translation, percent of the distance.
        share: f64,
        /// The camera direction it is along.
        along: Vector3<f64>,
    },
}

impl Warning {
    /// A short name that stays the same from version to version.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Ambiguous { .. } => "ambiguous",
            Self::NotConverged { .. } => "not-converged",
            Self::PoorOverlap { .. } => "poor-overlap",
            Self::WeakGeometry { .. } => "weak-geometry",
        }
    }
}

/// A minimum of the moment equations and the pose that it led to.
struct Place {
    pose: Pose,
    minimum: Minimum,
    contour: Option<ContourFit>,
}

/// A pose and how well its projected regions cover the observed ones.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The pose, and cost and termination of the moment equations' minimum that it was found from.
    pub minimum: Minimum,
    /// What the contours show at the pose, where it was refined.
    pub contour: Option<ContourFit>,
    /// Area of the symmetric difference over the observed area, all regions together (the paper's delta); NaN where a region
    /// cannot be projected.
    pub overlap_error: f64,
    /// The same, region by region.
    pub region_overlap_errors: Vec<f64>,
}

/// The pose of a camera, and what is known of it.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// The best pose.
    pub best: Solution,
    /// Covariance of the left increment `[omega (rad), tau (metres)]`.
    pub covariance: Matrix6<f64>,
    /// Noise of the boundary that the fit shows, in pixels along the normal.
    pub boundary_noise: f64,
    /// The other minima that fit as well, best first.
    pub alternatives: Vec<Solution>,
    /// What to be warned of.
    pub warnings: Vec<Warning>,
    /// Evaluations of the equations over all minima.
    pub evaluations: usize,
}

impl Problem {
    /// The pose from nothing but the regions and the prior, by the native solver.
    ///
    /// `None` where no pose shows every region in its chart.
    pub fn estimate(self, start: Start, prior: &Prior, refinement: Refinement) -> Option<Estimate> {
        let Search { problem, candidates } = self.search(start, prior);
        problem.judged(problem.minima(&candidates), prior, refinement)
    }

    /// The verdict on minima found by any driver, after they are refined.
    pub fn judged(&self, minima: Vec<Minimum>, prior: &Prior, refinement: Refinement) -> Option<Estimate> {
        let evaluations = minima.iter().map(|minimum| minimum.evaluations).sum();
        let minima = self.distinct(minima);
        let noise = self.boundary_noise(minima.first()?.cost);
        let mut fitting = match refinement {
            Refinement::Contour => self.on_contours(&minima),
            Refinement::Off => None,
        }
        .unwrap_or_else(|| self.by_moments(minima, noise));
        // A stable sort: what the prior does not decide, the fit does.
        fitting.sort_by(|a, b| disagreement(&a.pose, prior).total_cmp(&disagreement(&b.pose, prior)));
        let mut solutions = fitting.into_iter().map(|place| self.solution(place));
        let best = solutions.next()?;
        let alternatives: Vec<Solution> = solutions.collect();
        let (noise, covariance) = match &best.contour {
            Some(fit) => (fit.mixture.sigma, fit.covariance()),
            None => (noise, self.covariance(&best.minimum.pose, noise)),
        };
        let warnings = self.warnings(&best, &alternatives, &covariance);
        Some(Estimate { best, covariance, boundary_noise: noise, alternatives, warnings, evaluations })
    }

    /// The minima whose moments fit as well as the best one's, best first, those of equal cost by their rotations.
    fn by_moments(&self, minima: Vec<Minimum>, noise: f64) -> Vec<Place> {
        let least = minima.first().map_or(0.0, |minimum| minimum.cost);
        let limit = self.ambiguity_limit(least);
        let mut fitting: Vec<Minimum> = minima.into_iter().take_while(|minimum| minimum.cost <= limit).collect();
        let tie = least + TIE_COST * noise * noise;
        fitting.sort_by_key(|minimum| if minimum.cost <= tie { order(&minimum.pose) } else { [i64::MAX; 3] });
        fitting.into_iter().map(|minimum| Place { pose: minimum.pose, minimum, contour: None }).collect()
    }

    /// The minima led onto the observed contours, those that fit as well as the best; `None` where the contours are clean or
    /// disturbed all over: the moments, which average over the whole region, are then the better measure.
    fn on_contours(&self, minima: &[Minimum]) -> Option<Vec<Place>> {
        let contours = self.contours();
        let start = contour_fit(&contours, &self.centred(&minima.first()?.pose))?;
        if start.is_clean {
            return None;
        }
        let refine = |minimum: &Minimum| {
            let fit = refined(&contours, &self.centred(&minimum.pose))?;
            Some(Place { pose: self.uncentred(&fit.pose), minimum: minimum.clone(), contour: Some(fit) })
        };
        let mut places: Vec<(f64, Place)> = minima
            .iter()
            .take(MOST_REFINED)
            .filter_map(refine)
            .map(|place| (place.contour.as_ref().map_or(f64::NEG_INFINITY, |fit| fit.mixture.likelihood), place))
            .collect();
        places.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (greatest, independent) = places
            .first()
            .map(|(likelihood, place)| (*likelihood, place.contour.as_ref().map_or(1.0, |fit| fit.independent)))?;
        if independent * (greatest - start.mixture.likelihood) < DECISIVE_LIKELIHOOD {
            return None;
        }
        let least = greatest - AMBIGUITY_LIKELIHOOD / independent;
        let mut kept: Vec<Place> = Vec::new();
        for (likelihood, place) in places {
            if likelihood >= least && kept.iter().all(|other| self.apart(&other.pose, &place.pose, SAME_PLACE)) {
                kept.push(place);
            }
        }
        Some(kept)
    }

    /// `noise^2 (J^T J)^-1` of the whitened equations; infinite where they leave a direction free.
    fn covariance(&self, pose: &Pose, noise: f64) -> Matrix6<f64> {
        let free = Matrix6::from_element(f64::INFINITY);
        let Some(evaluation) = self.evaluate(pose, Weighting::Whitened) else { return free };
        let information = evaluation.jacobian.transpose() * &evaluation.jacobian;
        let information = Matrix6::from_iterator(information.iter().copied());
        information.cholesky().map_or(free, |cholesky| cholesky.inverse() * (noise * noise))
    }

    fn solution(&self, Place { pose, minimum, contour }: Place) -> Solution {
        let pairs = self.regions().iter().zip(self.worlds());
        let areas: Vec<Option<OverlapAreas>> =
            pairs.map(|(region, world)| region_overlap(region, world, &pose)).collect();
        let ratio = |areas: Option<OverlapAreas>| areas.map_or(f64::NAN, |areas| areas.error());
        let total =
            areas.iter().copied().try_fold(OverlapAreas::default(), |sum, areas| areas.map(|areas| sum + areas));
        let region_overlap_errors = areas.into_iter().map(ratio).collect();
        Solution { minimum: Minimum { pose, ..minimum }, contour, overlap_error: ratio(total), region_overlap_errors }
    }

    fn warnings(&self, best: &Solution, alternatives: &[Solution], covariance: &Matrix6<f64>) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if !best.minimum.converged {
            warnings.push(Warning::NotConverged { termination: best.minimum.termination.clone() });
        }
        let angles = alternatives.iter().map(|other| best.minimum.pose.angle_to(&other.minimum.pose).to_degrees());
        if let Some(degrees) = angles.reduce(f64::min) {
            warnings.push(Warning::Ambiguous { count: alternatives.len(), degrees });
        }
        for (region, &error) in best.region_overlap_errors.iter().enumerate() {
            if error.partial_cmp(&POOR_OVERLAP) != Some(std::cmp::Ordering::Less) {
                warnings.push(Warning::PoorOverlap { region, percent: 100.0 * error });
            }
        }
        warnings.extend(weak_geometry(covariance, self.distance(&best.minimum.pose)));
        warnings
    }
}

/// Where a pose comes among those of equal cost: by its rotation vector, in steps that round-off does not cross but by chance.
fn order(pose: &Pose) -> [i64; 3] {
    let turn = pose.rotation.scaled_axis();
    [turn.x, turn.y, turn.z].map(|component| (component / TIE_STEP).round() as i64)
}

/// How far a pose is from what was known beforehand, in radians; 0 without a prior.
fn disagreement(pose: &Pose, prior: &Prior) -> f64 {
    let from_initial = prior.initial.map_or(0.0, |initial| initial.angle_to(pose));
    let from_up = prior.up.map_or(0.0, |up| (pose.rotation * up).angle(&-Vector3::y()));
    from_initial + from_up
}

fn weak_geometry(covariance: &Matrix6<f64>, distance: f64) -> Option<Warning> {
    let (rotation, axis) = weakest(&covariance.fixed_view::<3, 3>(0, 0).into_owned());
    let (translation, along) = weakest(&covariance.fixed_view::<3, 3>(3, 3).into_owned());
    let weak = !(rotation < WEAK_ROTATION && translation < WEAK_TRANSLATION * distance);
    weak.then(|| Warning::WeakGeometry {
        degrees: rotation.to_degrees(),
        axis,
        share: 100.0 * translation / distance,
        along,
    })
}

/// Largest standard deviation and its direction.
fn weakest(covariance: &Matrix3<f64>) -> (f64, Vector3<f64>) {
    let Some(eigen) = covariance.try_symmetric_eigen(f64::EPSILON, 1000) else {
        return (f64::INFINITY, Vector3::zeros());
    };
    let largest = eigen.eigenvalues.imax();
    (eigen.eigenvalues[largest].max(0.0).sqrt(), eigen.eigenvectors.column(largest).into_owned())
}

fn shown(direction: &Vector3<f64>) -> String {
    format!("{:.2}, {:.2}, {:.2}", direction.x, direction.y, direction.z)
}
