//! Checks of an estimate, and the warnings of those that fail.

use super::confidence::Evidence;
use super::outliers::{Outlier, outliers};
use super::solution::{POOR_OVERLAP, Solution, TRUSTED};
use super::warning::{RelativePose, Warning};
use super::weakness::weak_geometry;
use crate::contour::members::contradicted;
use crate::equations::least_squares::Termination;
use crate::noise::boundary::DRAWN;
use crate::options::Options;
use crate::prior::{InitialDeviation, PlaceDeviation, Prior, UpDeviation};
use crate::problem::Problem;
use crate::samples::margin::SampledRegion;

/// Overlap error of a region of which a pose shows nothing: no trust bears more.
const NOT_SHOWN: f64 = 1.0;

pub(super) fn warnings(
    problem: &Problem,
    best: &Solution,
    alternatives: &[Solution],
    evidence: &Evidence,
    options: &Options,
    ended: Option<&Termination>,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    warnings.extend(ended.map(|termination| Warning::NotConverged { termination: termination.clone() }));
    let mut others: Vec<RelativePose> =
        alternatives.iter().map(|other| RelativePose::between(&best.pose, &other.pose)).collect();
    others.sort_by(|a, b| a.degrees.total_cmp(&b.degrees));
    if !others.is_empty() {
        warnings.push(Warning::Ambiguous { others });
    }
    // Samples that leave a contour blurred do not agree on a place.
    let blurred = best.posterior.as_ref().is_some_and(|posterior| posterior.noise.label >= DRAWN);
    let trusted = evidence.probability() > TRUSTED && !blurred;
    let sampled: Vec<usize> = problem.sampled().iter().map(SampledRegion::index).collect();
    warnings.extend(region_warnings(best, alternatives, &sampled, trusted));
    warnings.extend(weak_geometry(problem, &best.pose, &best.covariance, &options.limits));
    warnings.extend(contradictions(problem, best, &options.prior));
    // Answers that are too unlikely to be named have their shares all the same.
    if warnings.is_empty() && !(trusted && best.confidence > TRUSTED) {
        warnings.push(Warning::LowConfidence { percent: 100.0 * best.confidence });
    }
    warnings
}

/// The warnings of regions that do not belong to the best pose, of those that fit no better than nothing and, unless the pose is
/// trusted, of those of which a part lies elsewhere; and of those that do not belong to a pose that fits alike.
fn region_warnings(best: &Solution, alternatives: &[Solution], sampled: &[usize], trusted: bool) -> Vec<Warning> {
    let contradicted = contradicted(&best.fit);
    let mut warnings: Vec<Warning> = outliers(best, sampled)
        .into_iter()
        .map(|Outlier { region, percent, others }| Warning::OutlierRegion { region, percent, others })
        .collect();
    let mut named: Vec<usize> = warnings.iter().filter_map(Warning::region).collect();
    for (region, &error) in best.region_overlap_errors.iter().enumerate() {
        let borne = trusted && error < NOT_SHOWN && !contradicted[region];
        if error >= POOR_OVERLAP && !borne && !sampled.contains(&region) && !named.contains(&region) {
            warnings.push(Warning::PoorOverlap { region, percent: 100.0 * error });
            named.push(region);
        }
    }
    for other in alternatives {
        let degrees = RelativePose::between(&best.pose, &other.pose).degrees;
        for Outlier { region, percent, others } in outliers(other, sampled) {
            if !named.contains(&region) {
                warnings.push(Warning::AmbiguousRegion { region, degrees, percent, others });
                named.push(region);
            }
        }
    }
    warnings
}

/// Parts of the prior that the pose contradicts.
fn contradictions(problem: &Problem, best: &Solution, prior: &Prior) -> Vec<Warning> {
    let (pose, covariance) = (&best.pose, &best.covariance);
    let initial = prior.initial_deviation(pose, covariance).filter(InitialDeviation::is_contradiction);
    let initial = initial.map(|from| Warning::InitialContradicted {
        degrees: from.rotation.to_degrees(),
        shift: from.place,
        sigmas: from.sigmas,
    });
    let up = prior.up_deviation(pose, covariance).filter(UpDeviation::is_contradiction);
    let up = up.map(|from| Warning::UpContradicted { degrees: from.angle.to_degrees(), sigmas: from.sigmas });
    let near = prior.place_deviation(pose, covariance).filter(PlaceDeviation::is_contradiction);
    let near = near.map(|from| Warning::PlaceContradicted { shift: from.place, sigmas: from.sigmas });
    let sides = problem.seen_from_behind(pose).into_iter().map(|region| Warning::SideContradicted { region });
    initial.into_iter().chain(up).chain(near).chain(sides).collect()
}
