//! A pose hypothesis, its covariance and overlap computed on demand.

use std::cell::OnceCell;

use nalgebra::Matrix6;

use super::confidence::Evidence;
use super::coverage::{overlap_errors_of, region_overlaps};
use super::frame_error::{RegionFactor, focal_shift, with_frame_error};
use super::solution::Solution;
use crate::budget::Budget;
use crate::contour::covariance::covariance;
use crate::contour::fit::ContourFit;
use crate::contour::region_preference::RegionPreference;
use crate::equations::least_squares::Minimum;
use crate::geometry::overlap::OverlapAreas;
use crate::geometry::pose::Pose;
use crate::math::gaussian::Gaussian;
use crate::options::FrameSigma;
use crate::problem::Problem;
use crate::samples::margin::SampledRegion;
use crate::samples::posterior::Posterior;
use crate::search::poses::apart;

/// A pose hypothesis with its fit.
#[derive(Debug, Clone)]
pub(super) struct Hypothesis {
    pub(super) pose: Pose,
    pub(super) minimum: Option<Minimum>,
    pub(super) fit: ContourFit,
    pub(super) posterior: Option<Posterior>,
    /// Covariance of the left increment, computed on demand.
    pub(super) covariance: OnceCell<Matrix6<f64>>,
    /// Overlap of each projected region with the observed one, computed on demand.
    pub(super) overlaps: OnceCell<Vec<OverlapAreas>>,
    /// Its penalty, in variances: its deviance from the best fit plus that of the prior.
    pub(super) deviance: f64,
}

impl Hypothesis {
    /// The posterior mean of its samples about the problem's origin, its covariance and the sigma of labels and dilations, pixels.
    pub(super) fn answer(&self) -> Option<(Pose, Matrix6<f64>, f64)> {
        let Posterior { pose, covariance, noise, .. } = self.posterior.as_ref()?;
        Some((*pose, *covariance, noise.label.hypot(noise.dilation)))
    }

    /// A hypothesis without a penalty.
    pub(super) fn new(pose: Pose, minimum: Option<Minimum>, fit: ContourFit) -> Self {
        let (covariance, overlaps) = (OnceCell::new(), OnceCell::new());
        Self { pose, minimum, fit, posterior: None, covariance, overlaps, deviance: 0.0 }
    }

    /// Covariance by the samples, or else by the contours.
    pub(super) fn covariance(&self, problem: &Problem, budget: &Budget) -> &Matrix6<f64> {
        self.covariance.get_or_init(|| covariance(problem.contours(), &self.fit, budget))
    }

    /// Overlap of each projected region with the observed one.
    fn overlaps(&self, problem: &Problem, budget: &Budget) -> &[OverlapAreas] {
        self.overlaps.get_or_init(|| region_overlaps(problem, &self.pose, budget))
    }

    /// The factor of each region on the left increment: of its samples, or of its contour where it has none.
    fn region_factors(&self, problem: &Problem, budget: &Budget) -> Vec<RegionFactor> {
        let none = || vec![Gaussian::default(); problem.worlds().len()];
        let mut factors = self.fit.region_gaussians(problem.contours(), budget).unwrap_or_else(none);
        let mut is_scanned = vec![false; factors.len()];
        if let Some(posterior) = &self.posterior {
            for region in problem.sampled() {
                (factors[region.index()], is_scanned[region.index()]) = (Gaussian::default(), true);
            }
            posterior.messages.iter().for_each(|(region, message)| factors[*region] = *message);
        }
        let places = problem.worlds().iter().map(|world| self.pose.transform(&world.frame().origin));
        let regions = factors.into_iter().zip(places).zip(is_scanned);
        regions.map(|((factor, place), is_scanned)| RegionFactor { factor, place, is_scanned }).collect()
    }

    /// Deviance of another hypothesis, in variances: by the contours, and by the moments where they decide.
    pub(super) fn deviance_to(&self, other: &Self, problem: &Problem, numbers: f64) -> f64 {
        if !apart(&self.fit.pose, &other.fit.pose, 0.0) {
            return 0.0;
        }
        if let (Some(own), Some(posterior)) = (&self.posterior, &other.posterior) {
            return own.deviance_to(posterior, problem.sampled()).max(0.0);
        }
        let by_contours = self.fit.deviance_to(&other.fit, numbers);
        match (&self.minimum, &other.minimum) {
            (Some(own), Some(minimum)) => by_contours.max(problem.worse_by_moments(minimum.cost, own.cost, numbers)),
            _ => by_contours,
        }
    }

    /// Which of this hypothesis and another each region prefers, by the contours where these decide.
    pub(super) fn region_preferences(&self, other: &Self) -> Vec<RegionPreference> {
        match (&self.posterior, &other.posterior) {
            (None, None) => self.fit.region_preferences(&other.fit),
            _ => vec![RegionPreference::Neither; self.fit.regions().count()],
        }
    }

    /// What the fit shows for the confidence.
    pub(super) fn evidence(&self, problem: &Problem, budget: &Budget) -> Evidence {
        let (covariance, overlaps) = (self.covariance(problem, budget), self.overlaps(problem, budget));
        match &self.posterior {
            Some(posterior) => {
                let unseen = |region: &SampledRegion| overlaps[region.index()].uncovered();
                let unseen: Vec<f64> = problem.sampled().iter().map(unseen).collect();
                Evidence::from_samples(posterior, problem.sampled(), &self.fit, covariance, &unseen)
            }
            None => {
                let errors: Vec<f64> = overlaps.iter().map(OverlapAreas::error).collect();
                Evidence::from_outlines(&self.fit, covariance, &errors)
            }
        }
    }

    /// Cost by which hypotheses are sorted: that of the moments, or the negative log likelihood of the contours.
    pub(super) fn cost(&self) -> f64 {
        self.minimum.as_ref().map_or(-self.fit.mixture.likelihood, |minimum| minimum.cost)
    }
}

pub(super) fn solution(
    problem: &Problem,
    hypothesis: Hypothesis,
    [mode_probability, confidence]: [f64; 2],
    frame_sigma: &FrameSigma,
    budget: &Budget,
) -> Solution {
    let (noise, factors) = (hypothesis.covariance(problem, budget), hypothesis.region_factors(problem, budget));
    let focal_shift = focal_shift(noise, &factors);
    let covariance = with_frame_error(noise, &factors, &focal_shift, problem.pixel_angle(), frame_sigma);
    let (overlap_error, region_overlap_errors) = overlap_errors_of(hypothesis.overlaps(problem, budget));
    let Hypothesis { pose, minimum, fit, posterior, .. } = hypothesis;
    Solution {
        pose,
        minimum,
        fit,
        posterior,
        overlap_error,
        region_overlap_errors,
        covariance,
        focal_shift,
        confidence,
        mode_probability,
    }
}
