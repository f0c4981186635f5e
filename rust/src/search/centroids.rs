//! Poses that see the centroids of three regions in the directions of their images' (`docs/math.md`, section 17).
//!
//! However wrong outlines are all along their boundaries, as those of sparse samples, their middles are off by a small share of
//! their size only, which is little against the distance between regions.

use nalgebra::Vector3;

use super::directions::seen_direction;
use super::p3p::three_point_poses;
use super::poses::sorted;
use crate::budget::Budget;
use crate::geometry::pose::Pose;
use crate::moments::plane::planar_moments;
use crate::problem::Problem;
use crate::region::WorldRegion;

/// Triples of regions that are taken at most, those that span the largest triangles: all of five regions.
const MOST_TRIPLES: usize = 10;

/// Regions whose triples are compared at most, those that lie farthest apart: a convention, some two thousand triples.
const MOST_REGIONS: usize = 24;

/// Cost of a triple, in edge evaluations: its area.
const EDGES_OF_TRIPLE: usize = 1;

/// The poses of three regions' centroids, about the problem's origin; none of fewer regions, or of ones on a line.
pub fn centroid_poses(problem: &Problem, budget: &Budget) -> Vec<Pose> {
    let pairs = problem.regions().iter().zip(problem.worlds());
    let sights = pairs.filter_map(|(region, world)| Some((middle(world) - problem.origin(), seen_direction(region)?)));
    let sights = far_apart(sights.collect(), MOST_REGIONS, budget);
    let count = sights.len();
    let triples = (0..count).flat_map(|c| (0..c).flat_map(move |b| (0..b).map(move |a| [a, b, c])));
    budget.charge(EDGES_OF_TRIPLE * count.pow(3) / 6);
    let area = |[a, b, c]: [usize; 3]| (sights[b].0 - sights[a].0).cross(&(sights[c].0 - sights[a].0)).norm();
    let largest = sorted(triples.map(|triple| (-area(triple), triple)).collect());
    let poses = |(_, triple): (f64, [usize; 3])| {
        three_point_poses(&triple.map(|index| sights[index].0), &triple.map(|index| sights[index].1))
    };
    largest.into_iter().take(MOST_TRIPLES).flat_map(poses).collect()
}

/// A place of the world and the direction in which it is seen.
type Sight = (Vector3<f64>, Vector3<f64>);

/// At most so many of the sights, in their order: from the one that lies farthest from the middle on, each that lies farthest from
/// those taken before (Gonzalez 1985).
fn far_apart(sights: Vec<Sight>, most: usize, budget: &Budget) -> Vec<Sight> {
    if sights.len() <= most {
        return sights;
    }
    let middle = sights.iter().map(|(place, _)| place).sum::<Vector3<f64>>() / sights.len() as f64;
    let mut squares: Vec<f64> = sights.iter().map(|(place, _)| (place - middle).norm_squared()).collect();
    let mut taken = Vec::with_capacity(most);
    while taken.len() < most {
        let Some(farthest) = (0..squares.len()).max_by(|&a, &b| squares[a].total_cmp(&squares[b])) else { break };
        let is_first = taken.is_empty();
        taken.push(farthest);
        for (square, (place, _)) in squares.iter_mut().zip(&sights) {
            let other = (place - sights[farthest].0).norm_squared();
            *square = if is_first { other } else { square.min(other) };
        }
        budget.charge(sights.len());
    }
    taken.sort_unstable();
    taken.dedup();
    taken.into_iter().map(|index| sights[index]).collect()
}

/// The centroid of a region's outline in the world.
fn middle(world: &WorldRegion) -> Vector3<f64> {
    let moments = planar_moments(world.outline().rings().iter().map(Vec::as_slice), 1);
    let area = moments.get(0, 0);
    world.frame().to_world(&[moments.get(1, 0) / area, moments.get(0, 1) / area].into())
}
