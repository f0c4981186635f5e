//! How the projected regions cover the observed ones.

use nalgebra::{Vector2, Vector3};

use crate::equations::residual::RegionEquations;
use crate::geometry::overlap::{OverlapAreas, overlap_areas};
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::region::WorldRegion;
use crate::view::border::{Border, projected_before};
use crate::view::chart::Chart;

/// Solid angles shared and not shared by an observed region and the projected one; `None` where it cannot be projected.
///
/// What is projected beyond a region that has hidden edges may be what they hide, and does not count.
pub fn region_overlap(observed: &RegionEquations, world: &WorldRegion, pose: &Pose) -> Option<OverlapAreas> {
    let areas = whole_overlap(observed, world, pose)?;
    Some(if observed.hides_edges() { OverlapAreas { only_predicted: 0.0, ..areas } } else { areas })
}

fn whole_overlap(observed: &RegionEquations, world: &WorldRegion, pose: &Pose) -> Option<OverlapAreas> {
    if let Some(border) = observed.border() {
        return Some(cut_overlap(observed, border, world, pose));
    }
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

/// The same of a region that the image's border cuts: the prediction is cut there too (`docs/math.md`, section 14).
fn cut_overlap(observed: &RegionEquations, border: &Border, world: &WorldRegion, pose: &Pose) -> OverlapAreas {
    let chart = observed.chart();
    let seen = |ring: &Vec<Vector3<f64>>| {
        let turned: Vec<_> = ring.iter().map(|x| chart.rotation * pose.transform(x)).collect();
        projected_before(&turned, chart)
    };
    let (predicted, _) = border.clipped(world.rings().iter().map(seen).collect());
    let unscaled = |ring: &Vec<Vector2<f64>>| ring.iter().map(|p| p / chart.scale).collect();
    let of = |rings: &[Vec<Vector2<f64>>]| PlaneRings::of_simple(rings.iter().map(unscaled).collect());
    overlap_areas(&of(observed.outline().rings()), &of(&predicted.rings))
}
