//! The result: the best pose, the others that fit, its covariance and overlap, and what to be warned of.

use nalgebra::{Matrix6, Vector3};

use crate::contour::covariance::covariance;
use crate::contour::distance::{Contour, ContourFit, contour_fit};
use crate::equations::least_squares::Minimum;
use crate::equations::system::Weighting;
use crate::geometry::overlap::OverlapAreas;
use crate::geometry::pose::Pose;
use crate::prior::{FromInitial, FromUp, Prior};
use crate::search::candidates::{AMBIGUITY_COST, Problem, Search, Start};
use crate::search::fit::region_overlap;
use crate::search::places::{CHECKED, Place};
use crate::verdict::confidence::Evidence;
use crate::verdict::warning::{Warning, Way};

/// Overlap error above which a solution does not count as solved (paper section 3).
const POOR_OVERLAP: f64 = 0.05;

/// Share of the other regions' contours on their projections from which a region may be named an outlier: of one other region,
/// and of each of several.
const FIRM_SHARES: [f64; 2] = [0.3, 0.2];

/// Probability of a pose above which a region that is seen elsewhere is not warned of; every pose of less has a warning.
const TRUSTED: f64 = 0.9;

/// Share of a region's contour on its projection below which it counts as an outlier where others are found: a wrong contour
/// crosses the projection here and there.
const OUTLIER_SHARE: f64 = 0.12;

/// How often the region that fits is the right one, of two that disagree: 85 % of 304 problems of the study `trust`.
const DISPUTED: f64 = 0.85;

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
    /// Probability that the true pose is within 5 degrees (`docs/math.md`, section 15).
    pub confidence: f64,
}

/// The pose of a camera, and what is known of it.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// The best pose.
    pub best: Solution,
    /// Noise of the boundary that the fit shows, in pixels along the normal.
    pub boundary_noise: f64,
    /// The other minima that fit as well and that the prior leaves, best first.
    pub alternatives: Vec<Solution>,
    /// What to be warned of.
    pub warnings: Vec<Warning>,
    /// What the fit shows of the best pose, whatever else fits alike.
    pub evidence: Evidence,
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
        let places = led.unwrap_or_else(|| self.by_moments(minima, prior));
        let places = self.likely(places, prior, noise);
        let evidence = self.evidence(places.first()?, noise)?;
        let all: f64 = places.iter().map(Place::weight).sum();
        let probability = |place: &Place| evidence.probability() * place.weight() / all;
        let mut solutions = places.into_iter().map(|place| self.solution(probability(&place), place, noise));
        let mut best = solutions.next()?;
        let mut alternatives: Vec<Solution> = solutions.collect();
        let noise = best.contour.as_ref().map_or(noise, |fit| fit.mixture.sigma);
        let trusted = evidence.probability() > TRUSTED;
        let mut warnings = self.warnings(&best, &alternatives, trusted);
        warnings.extend(self.weak_geometry(&best.minimum.pose, &best.covariance));
        warnings.extend(self.contradictions(&best.minimum.pose, &best.covariance, prior));
        if self.regions().len() == 2 && warnings.iter().any(|w| matches!(w, Warning::OutlierRegion { .. })) {
            std::iter::once(&mut best).chain(&mut alternatives).for_each(|solution| solution.confidence *= DISPUTED);
        }
        if warnings.is_empty() && !trusted {
            warnings.push(Warning::LowConfidence { percent: 100.0 * best.confidence });
        }
        Some(Estimate { best, boundary_noise: noise, alternatives, warnings, evidence, evaluations })
    }

    /// What the fit at a place shows of it.
    fn evidence(&self, place: &Place, noise: f64) -> Option<Evidence> {
        let covariance = self.covariance(place, noise);
        let seen = |fit: &ContourFit| Evidence::new(fit, &covariance);
        if let Some(fit) = &place.contour {
            return Some(seen(fit));
        }
        let (contours, pose) = (self.contours(), self.centred(&place.pose));
        let few: Vec<Contour> = contours.iter().map(|contour| contour.thinned(CHECKED)).collect();
        let fit = contour_fit(&few, &pose)?;
        if fit.is_clean {
            // Pieces of a clean contour vary independently: those left out would count as these do.
            return Some(seen(&ContourFit { independent: CHECKED as f64 * fit.independent, ..fit }));
        }
        contour_fit(&contours, &pose).as_ref().map(seen)
    }

    /// The places that fit about as well as the best once the prior is weighed in, best first, and what counts against each
    /// (`docs/math.md`, eq. 10.7).
    ///
    /// An initial pose without an uncertainty chooses the first among them.
    fn likely(&self, places: Vec<Place>, prior: &Prior, noise: f64) -> Vec<Place> {
        let scored = places.into_iter().map(|place| (self.score(&place, prior, noise), place));
        let mut scored: Vec<(f64, Place)> = scored.collect();
        let least = scored.iter().map(|(score, _)| *score).fold(f64::INFINITY, f64::min);
        scored.retain(|(score, _)| *score <= least + AMBIGUITY_COST);
        // Both sorts are stable: what the prior does not decide, the fit does.
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let (Some(initial), None) = (prior.initial, prior.initial_sigma) {
            scored.sort_by(|(_, a), (_, b)| a.pose.angle_to(&initial).total_cmp(&b.pose.angle_to(&initial)));
        }
        scored.into_iter().map(|(score, place)| Place { misfit: score - least, ..place }).collect()
    }

    /// What counts against a place, in variances: how it fits, and the prior.
    fn score(&self, place: &Place, prior: &Prior, noise: f64) -> f64 {
        let covariance = match prior.weighs() {
            true => self.covariance(place, noise),
            false => Matrix6::zeros(),
        };
        place.misfit + self.penalty(&place.pose, &covariance, prior)
    }

    /// Of a pose on the contours theirs, else `noise^2 (J^T J)^-1` of the whitened equations; infinite where they leave a
    /// direction free.
    fn covariance(&self, place: &Place, noise: f64) -> Matrix6<f64> {
        if let Some(fit) = &place.contour {
            return covariance(&self.contours(), fit);
        }
        let free = Matrix6::from_element(f64::INFINITY);
        let Some(evaluation) = self.evaluate(&place.pose, Weighting::Whitened) else { return free };
        let information = evaluation.jacobian.transpose() * &evaluation.jacobian;
        let information = Matrix6::from_iterator(information.iter().copied());
        information.cholesky().map_or(free, |cholesky| cholesky.inverse() * (noise * noise))
    }

    fn solution(&self, confidence: f64, place: Place, noise: f64) -> Solution {
        let covariance = self.covariance(&place, noise);
        let Place { pose, minimum, contour, .. } = place;
        let pairs = self.regions().iter().zip(self.worlds());
        let areas: Vec<Option<OverlapAreas>> =
            pairs.map(|(region, world)| region_overlap(region, world, &pose)).collect();
        let ratio = |areas: Option<OverlapAreas>| areas.map_or(f64::NAN, |areas| areas.error());
        let total =
            areas.iter().copied().try_fold(OverlapAreas::default(), |sum, areas| areas.map(|areas| sum + areas));
        let region_overlap_errors = areas.into_iter().map(ratio).collect();
        let minimum = Minimum { pose, ..minimum };
        Solution { minimum, contour, overlap_error: ratio(total), region_overlap_errors, covariance, confidence }
    }

    fn warnings(&self, best: &Solution, alternatives: &[Solution], trusted: bool) -> Vec<Warning> {
        let mut warnings = Vec::new();
        // On the contours it does not matter how the moments' iteration ended.
        if best.contour.is_none() && !best.minimum.converged {
            warnings.push(Warning::NotConverged { termination: best.minimum.termination.clone() });
        }
        let mut others: Vec<Way> =
            alternatives.iter().map(|other| way(&best.minimum.pose, &other.minimum.pose)).collect();
        others.sort_by(|a, b| a.degrees.total_cmp(&b.degrees));
        if !others.is_empty() {
            warnings.push(Warning::Ambiguous { others });
        }
        for (region, &error) in best.region_overlap_errors.iter().enumerate() {
            warnings.extend(poor_region(region, error, best.contour.as_ref(), trusted));
        }
        warnings
    }

    /// What was known beforehand and is not so at the pose.
    fn contradictions(&self, pose: &Pose, covariance: &Matrix6<f64>, prior: &Prior) -> Vec<Warning> {
        let initial = prior.from_initial(pose, covariance).filter(FromInitial::is_contradiction);
        let initial = initial.map(|from| Warning::InitialContradicted {
            degrees: from.rotation.to_degrees(),
            shift: from.place,
            sigmas: from.sigmas,
        });
        let up = prior.from_up(pose, covariance).filter(FromUp::is_contradiction);
        let up = up.map(|from| Warning::UpContradicted { degrees: from.angle.to_degrees(), sigmas: from.sigmas });
        let sides = self.seen_from_behind(pose).into_iter().map(|region| Warning::SideContradicted { region });
        initial.into_iter().chain(up).chain(sides).collect()
    }
}

/// From a pose to another: the turn in the camera's axes, and how far the camera goes.
fn way(from: &Pose, to: &Pose) -> Way {
    let increment = from.increment_to(to);
    let (turn, shift) = (increment.fixed_rows::<3>(0).into_owned(), increment.fixed_rows::<3>(3).norm());
    Way { degrees: turn.norm().to_degrees(), axis: turn.try_normalize(0.0).unwrap_or_else(Vector3::zeros), shift }
}

/// The warning of a region that the pose projects elsewhere, if any.
///
/// Where the evidence is for the pose, the rest is what disturbs the contour, unless hardly any of it lies on the projection.
fn poor_region(region: usize, error: f64, contour: Option<&ContourFit>, trusted: bool) -> Option<Warning> {
    if error.partial_cmp(&POOR_OVERLAP) == Some(std::cmp::Ordering::Less) {
        return None;
    }
    if let Some(fit) = contour {
        let (share, others) = fit.clean_shares_of(region);
        let firm = FIRM_SHARES[usize::from(fit.clean_shares.len() > 2)];
        if others > firm && share < OUTLIER_SHARE {
            return Some(Warning::OutlierRegion { region, percent: 100.0 * share, others: 100.0 * others });
        }
    }
    (!trusted).then_some(Warning::PoorOverlap { region, percent: 100.0 * error })
}
