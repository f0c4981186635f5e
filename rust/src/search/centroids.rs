//! Poses that see the centroids of three regions in the directions of their images' (`docs/math.md`, section 17).
//!
//! However wrong outlines are all along their boundaries, as those of sparse samples, their middles are off by a small share of
//! their size only, which is little against the distance between regions.

use nalgebra::Vector3;

use super::directions::seen_direction;
use super::p3p::three_point_poses;
use super::poses::sorted;
use crate::geometry::pose::Pose;
use crate::moments::plane::planar_moments;
use crate::problem::Problem;
use crate::region::WorldRegion;

/// Triples of regions that are taken at most, those that span the largest triangles: all of five regions.
const MOST_TRIPLES: usize = 10;

/// The poses of three regions' centroids, about the problem's origin; none of fewer regions, or of ones on a line.
pub fn centroid_poses(problem: &Problem) -> Vec<Pose> {
    let pairs = problem.regions().iter().zip(problem.worlds());
    let sights = pairs.filter_map(|(region, world)| Some((middle(world) - problem.origin(), seen_direction(region)?)));
    let sights: Vec<(Vector3<f64>, Vector3<f64>)> = sights.collect();
    let triples = (0..sights.len()).flat_map(|c| (0..c).flat_map(move |b| (0..b).map(move |a| [a, b, c])));
    let area = |[a, b, c]: [usize; 3]| (sights[b].0 - sights[a].0).cross(&(sights[c].0 - sights[a].0)).norm();
    let largest = sorted(triples.map(|triple| (-area(triple), triple)).collect());
    let poses = |(_, triple): (f64, [usize; 3])| {
        three_point_poses(&triple.map(|index| sights[index].0), &triple.map(|index| sights[index].1))
    };
    largest.into_iter().take(MOST_TRIPLES).flat_map(poses).collect()
}

/// The centroid of a region's outline in the world.
fn middle(world: &WorldRegion) -> Vector3<f64> {
    let moments = planar_moments(world.outline().rings().iter().map(Vec::as_slice), 1);
    let area = moments.get(0, 0);
    world.frame().lifted(&[moments.get(1, 0) / area, moments.get(0, 1) / area].into())
}
