//! World regions with samples, as a scan knows them.

use nalgebra::{Vector2, Vector3};

use super::random::Random;
use super::scene::Layout;
use regionpose::WorldRegion;
use regionpose::geometry::rings::PlaneRings;

/// Regions before the camera.
pub fn layout(regions: usize) -> Layout {
    Layout { regions, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() }
}

/// The world regions with samples in rows and columns `gap` units apart over the extent of each, as a scan knows them;
/// with an outline that is `shrunk`.
pub fn sampled(random: &mut Random, worlds: &[WorldRegion], gap: f64, shrunk: f64) -> Vec<WorldRegion> {
    worlds.iter().map(|world| sampled_region(random, world, gap, shrunk)).collect()
}

fn sampled_region(random: &mut Random, world: &WorldRegion, gap: f64, shrunk: f64) -> WorldRegion {
    let (frame, outline) = (world.frame().clone(), world.outline());
    let (low, high) = outline.bounds();
    let shift = Vector2::new(random.uniform(0.0, gap), random.uniform(0.0, gap));
    let first = low - Vector2::repeat(3.0 * gap) + shift;
    let count = |axis: usize| ((high[axis] - low[axis]) / gap).ceil() as usize + 6;
    let places = (0..count(0)).flat_map(|i| (0..count(1)).map(move |j| Vector2::new(i as f64, j as f64) * gap));
    let (inside, outside): (Vec<_>, Vec<_>) = places.map(|p| first + p).partition(|p| outline.contains(*p));
    let lifted = |flat: Vec<Vector2<f64>>| flat.iter().map(|p| frame.lifted(p)).collect::<Vec<_>>();
    let rings = outline.rings().iter().map(|ring| ring.iter().map(|p| p * shrunk).collect()).collect();
    let start = WorldRegion::from_outline(frame.clone(), PlaneRings::new(rings).unwrap());
    start.with_samples(&lifted(inside), &lifted(outside)).unwrap()
}
