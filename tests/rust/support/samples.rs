//! World regions with samples, as a scan knows them; and single samples.

use nalgebra::{Vector2, Vector3, Vector6};

use super::random::Random;
use super::scene::Layout;
use regionpose::WorldRegion;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::math::gaussian::Gaussian;
use regionpose::internals::samples::propagation::Site;
use regionpose::internals::samples::readings::{Edge, Sight};
use regionpose::internals::samples::trust::Trust;

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
    let lifted = |flat: Vec<Vector2<f64>>| flat.iter().map(|p| frame.to_world(p)).collect::<Vec<_>>();
    let rings = outline.rings().iter().map(|ring| ring.iter().map(|p| p * shrunk).collect()).collect();
    let start = WorldRegion::from_outline(frame.clone(), PlaneRings::new(rings).unwrap()).unwrap();
    start.with_samples(&lifted(inside), &lifted(outside)).unwrap()
}

/// Labels that are blurred by a pixel, of which some are beside a disturbed stretch or wrong.
pub const CLEAN: Trust = Trust { blur: 1.0, wide: 8.0, disturbed: 0.1, mislabeled: 0.02 };

/// A sample whose margin grows by `outwards` for each pixel that its contour or the start of its stretch is off.
pub fn site(slope: Vector6<f64>, outwards: f64, margin: f64, trust: Trust) -> Site {
    Site::new(&Sight { margin, slope, outwards, along: 0.0, edge: Edge::Own, stretch: 0 }, trust)
}

/// A normal prior of this deviation in all directions.
pub fn prior(deviation: f64) -> Gaussian {
    Gaussian::from_sigmas(&Tangent::zeros(), &Vector6::repeat(deviation))
}
