//! The result: the best pose, the others that fit, its covariance and overlap, and what to be warned of.

use nalgebra::{Matrix3, Matrix6, Vector3};

use crate::contour::ContourFit;
use crate::equations::Weighting;
use crate::fit::region_overlap;
use crate::least_squares::Minimum;
use crate::overlap::OverlapAreas;
use crate::places::Place;
use crate::pose::Pose;
use crate::solve::{Prior, Problem, Search, Start};
use crate::warning::Warning;

/// Overlap error above which a solution does not count as solved (paper section 3).
const POOR_OVERLAP: f64 = 0.05;

/// Share of a region's contour on its projection from which the region counts as found.
const FIRM_SHARE: f64 = 0.3;

/// The same for a region without others: nothing but its own contour speaks for its pose.
const FIRM_ALONE: f64 = 0.5;

/// Share of a region's contour on its projection below which it counts as an outlier where others are found: a wrong contour
/// crosses the projection here and there.
const OUTLIER_SHARE: f64 = 0.2;

/// Standard deviation of the rotation about its weakest axis above which the geometry is called weak, rad (1 degree, the
/// paper's bound for solved).
const WEAK_ROTATION: f64 = std::f64::consts::PI / 180.0;

/// Standard deviation of the translation along its weakest axis above which the geometry is called weak, as a share of the
/// distance to the regions.
const WEAK_TRANSLATION: f64 = 0.02;

/// What follows the solution of the moment equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Refinement {
    /// The projected boundary is drawn onto the observed contour where a part of that is disturbed.
    #[default]
    Contour,
    /// Nothing.
    Off,
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
    /// Covariance of the left increment `[omega (rad), tau (metres)]`.
    pub covariance: Matrix6<f64>,
}

/// The pose of a camera, and what is known of it.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// The best pose.
    pub best: Solution,
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
        let led = match refinement {
            Refinement::Contour => self.on_contours(&minima, prior),
            Refinement::Off => None,
        };
        let mut fitting = led.unwrap_or_else(|| self.by_moments(minima));
        // A stable sort: what the prior does not decide, the fit does.
        fitting.sort_by(|a, b| disagreement(&a.pose, prior).total_cmp(&disagreement(&b.pose, prior)));
        let mut solutions = fitting.into_iter().map(|place| self.solution(place));
        let best = solutions.next()?;
        let alternatives: Vec<Solution> = solutions.collect();
        let noise = best.contour.as_ref().map_or(noise, |fit| fit.mixture.sigma);
        let warnings = self.warnings(&best, &alternatives);
        Some(Estimate { best, boundary_noise: noise, alternatives, warnings, evaluations })
    }

    /// `noise^2 (J^T J)^-1` of the whitened equations; infinite where they leave a direction free.
    pub(crate) fn covariance(&self, pose: &Pose, noise: f64) -> Matrix6<f64> {
        let free = Matrix6::from_element(f64::INFINITY);
        let Some(evaluation) = self.evaluate(pose, Weighting::Whitened) else { return free };
        let information = evaluation.jacobian.transpose() * &evaluation.jacobian;
        let information = Matrix6::from_iterator(information.iter().copied());
        information.cholesky().map_or(free, |cholesky| cholesky.inverse() * (noise * noise))
    }

    fn solution(&self, Place { pose, minimum, contour, covariance }: Place) -> Solution {
        let pairs = self.regions().iter().zip(self.worlds());
        let areas: Vec<Option<OverlapAreas>> =
            pairs.map(|(region, world)| region_overlap(region, world, &pose)).collect();
        let ratio = |areas: Option<OverlapAreas>| areas.map_or(f64::NAN, |areas| areas.error());
        let total =
            areas.iter().copied().try_fold(OverlapAreas::default(), |sum, areas| areas.map(|areas| sum + areas));
        let region_overlap_errors = areas.into_iter().map(ratio).collect();
        let minimum = Minimum { pose, ..minimum };
        Solution { minimum, contour, overlap_error: ratio(total), region_overlap_errors, covariance }
    }

    fn warnings(&self, best: &Solution, alternatives: &[Solution]) -> Vec<Warning> {
        let mut warnings = Vec::new();
        // On the contours it does not matter how the moments' iteration ended.
        if best.contour.is_none() && !best.minimum.converged {
            warnings.push(Warning::NotConverged { termination: best.minimum.termination.clone() });
        }
        let angles = alternatives.iter().map(|other| best.minimum.pose.angle_to(&other.minimum.pose).to_degrees());
        if let Some(degrees) = angles.reduce(f64::min) {
            warnings.push(Warning::Ambiguous { count: alternatives.len(), degrees });
        }
        for (region, &error) in best.region_overlap_errors.iter().enumerate() {
            warnings.extend(poor_region(region, error, best.contour.as_ref()));
        }
        warnings.extend(weak_geometry(&best.covariance, self.distance(&best.minimum.pose)));
        warnings
    }
}

/// How far a pose is from what was known beforehand, in radians; 0 without a prior.
fn disagreement(pose: &Pose, prior: &Prior) -> f64 {
    let from_initial = prior.initial.map_or(0.0, |initial| initial.angle_to(pose));
    let from_up = prior.up.map_or(0.0, |up| (pose.rotation * up).angle(&-Vector3::y()));
    from_initial + from_up
}

/// The warning of a region that the pose projects elsewhere, if any.
///
/// Where a good part of its contour lies on the projection, the rest is what disturbs the contour, not the pose.
fn poor_region(region: usize, error: f64, contour: Option<&ContourFit>) -> Option<Warning> {
    if error.partial_cmp(&POOR_OVERLAP) == Some(std::cmp::Ordering::Less) {
        return None;
    }
    let poor = Warning::PoorOverlap { region, percent: 100.0 * error };
    let Some(fit) = contour else { return Some(poor) };
    let (share, others) = fit.clean_shares_of(region);
    if share > if fit.clean_shares.len() > 1 { FIRM_SHARE } else { FIRM_ALONE } {
        return None;
    }
    let outlier = others > FIRM_SHARE && share < OUTLIER_SHARE;
    Some(if outlier { Warning::OutlierRegion { region, percent: 100.0 * share, others: 100.0 * others } } else { poor })
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
