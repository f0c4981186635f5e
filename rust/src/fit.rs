//! How the projected regions cover the observed ones.

use nalgebra::{Vector2, Vector3};

use crate::chart::Chart;
use crate::overlap::{OverlapAreas, overlap_areas};
use crate::pose::Pose;
use crate::region::WorldRegion;
use crate::residual::RegionEquations;
use crate::rings::PlaneRings;

/// Standard deviation of a normal distribution over its mean absolute deviation, the square root of pi / 2.
const SIGMA_OVER_MEAN: f64 = 1.253_314_137_315_500_3;

/// Solid angles shared and not shared by an observed region and the projected one; `None` where it cannot be projected.
pub fn region_overlap(observed: &RegionEquations, world: &WorldRegion, pose: &Pose) -> Option<OverlapAreas> {
    let chart = Chart { scale: 1.0, ..*observed.chart() };
    let project = |x: &Vector3<f64>| chart.project(&pose.transform(x));
    let predicted = match world.surface() {
        // A projective map keeps a plane's rings simple, and turns them all round where it shows them from behind.
        None => world.outline().mapped(|p| project(&world.frame().lifted(p)))?.facing(),
        Some(surface) => {
            let rings = surface.rings.iter().map(|ring| ring.iter().map(project).collect());
            PlaneRings::new(rings.collect::<Option<_>>()?).ok()?
        }
    };
    let observed = observed.outline().mapped(|p: &Vector2<f64>| Some(p / observed.chart().scale))?;
    Some(overlap_areas(&observed, &predicted))
}

/// How well all regions fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Area of the symmetric differences over the observed area, all regions together.
    pub overlap_error: f64,
    /// Standard deviation, in pixels, of the distance between observed and projected boundaries: the area between them over
    /// the boundary's length is the mean distance.
    pub boundary_noise: f64,
}

impl Fit {
    /// The fit of a pose; `None` where a region cannot be projected.
    pub fn of(observed: &[RegionEquations], worlds: &[WorldRegion], pose: &Pose) -> Option<Self> {
        let (mut areas, mut pixels, mut length) = (OverlapAreas::default(), 0.0, 0.0);
        for (region, world) in observed.iter().zip(worlds) {
            let overlap = region_overlap(region, world, pose)?;
            areas = areas + overlap;
            pixels += overlap.error() * region.pixel_area();
            let perimeter: f64 = region.outline().edges().map(|(a, b)| (b - a).norm()).sum();
            length += perimeter * region.pixel_area().sqrt();
        }
        Some(Self { overlap_error: areas.error(), boundary_noise: SIGMA_OVER_MEAN * pixels / length })
    }
}
