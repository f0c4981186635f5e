//! A gnomonic projection of a region about its own direction, scaled to unit size.

use nalgebra::{Rotation3, Vector2, Vector3};

use crate::error::{Error, Result};
use crate::geometry::rings::PlaneRings;
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};
use crate::moments::plane::planar_moments;
use crate::view::bearing_rings::{Bearing, BearingRings, turn_onto_z};

/// Smallest cosine between a chart's axis and a point in it: 87 degrees, where the gnomonic projection stretches 400 times.
pub const MIN_COSINE: f64 = 0.05;

/// Below this cosine at some vertex, the chart keeps the axis of the region's narrowest cone instead of its centroid's.
const CENTROID_AXIS_MIN_COSINE: f64 = 0.3;

/// Turns that bring the axis onto the centroid; each leaves the square of the region's angular size.
const CENTROID_STEPS: usize = 3;

/// A turn by less than this (rad) is the last: round-off.
const CENTERED: f64 = 1e-12;

/// A rotation of the camera's axes followed by the gnomonic projection and a scale (`docs/math.md`, eq. 6.1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chart {
    /// `chart_from_camera`.
    pub rotation: Rotation3<f64>,
    /// Chart units per unit of the plane `z = 1`, so that the observed area is one.
    pub scale: f64,
}

impl Chart {
    /// The chart of an observed region and its rings in the chart, oriented, with unit area: to 1e-12 times the squared diameter
    /// there, which is large of needles.
    ///
    /// # Errors
    /// Bearings that are zero or not finite, crossing rings, or a region that does not fit 87 degrees around any axis.
    pub fn of(rings: &[Vec<Bearing>]) -> Result<(Self, PlaneRings)> {
        let rings = BearingRings::new(rings)?;
        let (rotation, flat) = rings.view();
        let start = Self { rotation, scale: 1.0 };
        let limit = |p: &Vector2<f64>| (1.0 > MIN_COSINE * MIN_COSINE * (1.0 + p.norm_squared())).then_some(*p);
        let rings = flat.mapped(limit).ok_or_else(too_wide)?;
        let (chart, rings) = start.centered(rings);
        let scale = 1.0 / rings.area().sqrt();
        let scaled = rings.mapped(|p| Some(p * scale)).ok_or_else(too_wide)?;
        Ok((Self { scale, ..chart }, scaled))
    }

    /// The unscaled chart about the region's centroid, unless the region reaches too far from it.
    fn centered(self, rings: PlaneRings) -> (Self, PlaneRings) {
        let mut best = (self, rings);
        for _ in 0..CENTROID_STEPS {
            let (chart, rings) = &best;
            let moments = planar_moments(rings.rings().iter().map(Vec::as_slice), 1);
            let centroid = Vector3::new(moments.get(1, 0), moments.get(0, 1), moments.get(0, 0));
            let centroid = centroid.normalize();
            let turn = turn_onto_z(&centroid);
            let moved = rings.rings().iter().map(|ring| vectorized(Turned { ring, turn: &turn }));
            let moved: Option<Vec<_>> = moved.collect();
            let moved = moved.map(PlaneRings::of_simple);
            let Some(moved) = moved else { break };
            best = (Self { rotation: turn * chart.rotation, scale: 1.0 }, moved);
            if centroid.xy().norm() < CENTERED {
                break;
            }
        }
        best
    }

    /// Chart coordinates of a point in camera coordinates; `None` where it lies 87 degrees or more off the chart's axis.
    pub fn project(&self, point: &Vector3<f64>) -> Option<Vector2<f64>> {
        self.project_turned(&(self.rotation * point))
    }

    /// Chart coordinates of a point whose coordinates are along the chart's axes already.
    pub fn project_turned(&self, p: &Vector3<f64>) -> Option<Vector2<f64>> {
        project_turned(p).map(|flat| flat * self.scale)
    }
}

/// A ring of a chart at scale 1 in the chart of turned axes; `None` where it reaches too far from these.
struct Turned<'a> {
    ring: &'a [Vector2<f64>],
    turn: &'a Rotation3<f64>,
}

impl NullaryFnOnce for Turned<'_> {
    type Output = Option<Vec<Vector2<f64>>>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let turn = self.turn.matrix();
        let row = |k: usize| (Lanes::splat(turn[(k, 0)]), Lanes::splat(turn[(k, 1)]), Lanes::splat(turn[(k, 2)]));
        let rows = (row(0), row(1), row(2));
        let least = Lanes::splat(CENTROID_AXIS_MIN_COSINE * CENTROID_AXIS_MIN_COSINE);
        let mut moved = vec![Vector2::zeros(); self.ring.len().next_multiple_of(LANES)];
        for (moved, group) in moved.as_chunks_mut().0.iter_mut().zip(self.ring.chunks(LANES)) {
            let vertex = |k: usize| if k < group.len() { group[k] } else { group[0] };
            let [a, b, c, d] = [vertex(0), vertex(1), vertex(2), vertex(3)];
            let (u, v) = (Lanes([a.x, b.x, c.x, d.x]), Lanes([a.y, b.y, c.y, d.y]));
            let along = |(p, q, r): (Lanes, Lanes, Lanes)| p * u + q * v + r;
            let (x, y, z) = (along(rows.0), along(rows.1), along(rows.2));
            let (square, limit) = (z * z, least * (x * x + y * y + z * z));
            if !(0..LANES).all(|k| z.0[k] > 0.0 && square.0[k] > limit.0[k]) {
                return None;
            }
            let (u, v) = (x / z, y / z);
            let vertex = |k: usize| Vector2::new(u.0[k], v.0[k]);
            *moved = [vertex(0), vertex(1), vertex(2), vertex(3)];
        }
        moved.truncate(self.ring.len());
        Some(moved)
    }
}

/// Chart coordinates, at scale 1, of a point along the chart's axes; `None` where it lies 87 degrees or more off them.
pub fn project_turned(p: &Vector3<f64>) -> Option<Vector2<f64>> {
    let inside = p.z > 0.0 && p.z * p.z > MIN_COSINE * MIN_COSINE * p.norm_squared();
    inside.then(|| Vector2::new(p.x, p.y) / p.z)
}

fn too_wide() -> Error {
    Error::TooWide { limit: MIN_COSINE.acos().to_degrees() }
}
