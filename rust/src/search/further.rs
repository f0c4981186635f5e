//! Fallback starts, from corners and single regions, where no candidate explains the contours.

use super::corners::corner_poses;
use super::moments::hidden_region_poses;
use super::ranking::{MOST_REFINED, likeliest, nearest};
use crate::budget::Budget;
use crate::geometry::pose::Pose;
use crate::problem::Problem;

/// Poses from corners that are compared on more than a few pieces: a convention.
const FIRST_LOOK: usize = 250;

/// Pairs of triples of corners at most, over all regions: a convention.
const MOST_PAIRS: usize = 4000;

/// Poses from corners, of regions with hidden edges, and `single`, from each by itself: those that lie nearest to the contours of
/// all.
pub(super) fn further_poses(problem: &Problem, single: &[Vec<Pose>], budget: &Budget) -> Vec<Pose> {
    let (contours, few) = (problem.contours(), problem.coarse_stride());
    let corners = likeliest(contours, poses_of_corners(problem, budget), 2 * few, FIRST_LOOK, budget);
    let hidden = likeliest(contours, hidden_region_poses(problem, budget), 2 * few, FIRST_LOOK, budget);
    let of_all = [corners, single.concat(), hidden];
    of_all.into_iter().flat_map(|poses| nearest(contours, poses, few, MOST_REFINED, budget)).collect()
}

/// The poses of every region's corners, about the problem's origin.
fn poses_of_corners(problem: &Problem, budget: &Budget) -> Vec<Pose> {
    let most = MOST_PAIRS / problem.regions().len();
    let pairs = problem.regions().iter().zip(problem.worlds());
    let poses = pairs.flat_map(|(region, world)| {
        let pixel = region.pixel_area().sqrt().recip();
        corner_poses(region.chart(), region.outline(), world, problem.origin(), pixel, most, budget)
    });
    poses.collect()
}
