//! World regions with samples, as of a scan; and single samples.

use nalgebra::{Vector2, Vector3, Vector6};

use super::random::Random;
use super::scene::Layout;
use regionpose::WorldRegion;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::math::gaussian::Gaussian;
use regionpose::internals::samples::label_model::LabelModel;
use regionpose::internals::samples::margin::{EdgeKind, Margin};
use regionpose::internals::samples::probit_site::LabelSite;

/// Regions before the camera.
pub fn layout(regions: usize) -> Layout {
    Layout { regions, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() }
}

/// The world regions with samples in rows and columns `gap` units apart over the extent of each, as of a scan;
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
    let start = WorldRegion::from_outline(frame.clone(), PlaneRings::new(rings).unwrap());
    start.with_samples(&lifted(inside), &lifted(outside)).unwrap()
}

/// Labels with a sigma of one pixel, some of which are mislabeled or beside a disturbed contour.
pub const MODEL: LabelModel = LabelModel { sigma: 1.0, outlier_sigma: 8.0, contamination: 0.1, mislabeling: 0.02 };

/// A sample at the start of its segment with this margin, its gradient and its derivative by an outward offset.
pub fn site(gradient: Vector6<f64>, outward: f64, value: f64, model: LabelModel) -> LabelSite {
    LabelSite::new(&Margin { value, gradient, outward, along: 0.0, edge: EdgeKind::Own, segment: 0 }, model)
}

/// A normal prior of this deviation in all directions.
pub fn prior(deviation: f64) -> Gaussian {
    Gaussian::from_sigmas(&Tangent::zeros(), &Vector6::repeat(deviation))
}
