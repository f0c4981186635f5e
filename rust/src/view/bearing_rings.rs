//! Closed rings on the unit sphere, valid by construction.

use nalgebra::{Matrix3, Rotation3, Vector2, Vector3};

use crate::error::{Error, Result};
use crate::geometry::rings::PlaneRings;
use crate::region::check_finite;

/// Unit vector along the ray of a pixel, in camera axes.
pub type Bearing = Vector3<f64>;

/// Smallest cosine to the view's axis: 89.9 degrees, so that any region inside an open half space has a view, while the
/// projection keeps twelve digits.
const MIN_COSINE: f64 = 1e-3;

/// Below this cosine at some vertex, the mean direction gives way to the axis of the smallest enclosing cone.
const MEAN_AXIS_MIN_COSINE: f64 = 0.3;

/// Steps of the enclosing cone's iteration; its axis is then good to a fraction of a degree.
const CONE_STEPS: usize = 2000;

/// The rings of a region of the unit sphere that fits a half space: joined by great-circle arcs, never crossing, the region
/// to their left seen from outside the sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct BearingRings {
    view: Rotation3<f64>,
    flat: PlaneRings,
}

impl BearingRings {
    /// The region bounded by rings of bearings, in any order and turning either way: nesting decides which ones are holes.
    ///
    /// # Errors
    /// Bearings that are zero or not finite, a region that does not fit a half space, and what [`PlaneRings::new`] refuses.
    pub fn new(rings: &[Vec<Bearing>]) -> Result<Self> {
        if rings.is_empty() {
            return Err(Error::NoRings);
        }
        let directions = directions(rings)?;
        let view = turn_onto_z(&first_axis(&directions));
        let project = |r: &Bearing| {
            let turned = view * r;
            (turned.z > MIN_COSINE).then(|| Vector2::new(turned.x, turned.y) / turned.z)
        };
        let mut flat = Vec::with_capacity(directions.len());
        for ring in &directions {
            let mut projected = Vec::with_capacity(ring.len());
            for bearing in ring {
                projected.push(project(bearing).ok_or_else(too_wide)?);
            }
            flat.push(projected);
        }
        Ok(Self { view, flat: PlaneRings::new(flat)? })
    }

    /// The rings, oriented, as unit vectors.
    pub fn rings(&self) -> Vec<Vec<Bearing>> {
        let back = self.view.inverse();
        let lift = |p: &Vector2<f64>| (back * Vector3::new(p.x, p.y, 1.0)).normalize();
        self.flat.rings().iter().map(|ring| ring.iter().map(lift).collect()).collect()
    }

    /// A rotation of the axes that brings the region around z, and its rings projected onto `z = 1` there.
    pub fn view(&self) -> (Rotation3<f64>, &PlaneRings) {
        (self.view, &self.flat)
    }
}

fn too_wide() -> Error {
    Error::TooWide { limit: MIN_COSINE.acos().to_degrees() }
}

/// The bearings at unit length.
fn directions(rings: &[Vec<Bearing>]) -> Result<Vec<Vec<Bearing>>> {
    let mut directions = Vec::with_capacity(rings.len());
    for (ring, bearings) in rings.iter().enumerate() {
        if bearings.len() < 3 {
            return Err(Error::TooFewVertices { ring, found: bearings.len() });
        }
        let item = format!("ring {ring} bearing");
        check_finite(&item, bearings)?;
        let mut units = Vec::with_capacity(bearings.len());
        for (index, bearing) in bearings.iter().enumerate() {
            let unit = bearing.try_normalize(0.0);
            units.push(unit.ok_or_else(|| Error::ZeroBearing { item: item.clone(), index })?);
        }
        directions.push(units);
    }
    Ok(directions)
}

/// Mean direction of the boundary, or for a wide region the axis of its enclosing cone.
fn first_axis(rings: &[Vec<Bearing>]) -> Bearing {
    let mean = mean_direction(rings);
    let near = smallest_cosine(rings, &mean) > MEAN_AXIS_MIN_COSINE;
    if near { mean } else { enclosing_cone_axis(rings, mean) }
}

/// Mean of the boundary's bearings, each edge weighted by its chord; the first bearing where they cancel or are all the same.
fn mean_direction(rings: &[Vec<Bearing>]) -> Bearing {
    let mut sum = Vector3::zeros();
    for ring in rings {
        for (a, b) in ring.iter().zip(ring.iter().skip(1).chain(ring.first())) {
            sum += (a + b) * (a - b).norm();
        }
    }
    sum.try_normalize(0.0).unwrap_or(rings[0][0])
}

/// Axis of the narrowest cone around the bearings, by Badoiu and Clarkson's iteration towards the farthest one.
fn enclosing_cone_axis(rings: &[Vec<Bearing>], start: Bearing) -> Bearing {
    let mut center = start;
    for step in 1..=CONE_STEPS {
        let cosine = |bearing: &Bearing| center.dot(bearing);
        let Some(farthest) = rings.iter().flatten().min_by(|a, b| cosine(a).total_cmp(&cosine(b))) else {
            return start;
        };
        center += (farthest - center) / (step + 1) as f64;
    }
    center.try_normalize(0.0).unwrap_or(start)
}

fn smallest_cosine(rings: &[Vec<Bearing>], axis: &Bearing) -> f64 {
    rings.iter().flatten().map(|bearing| axis.dot(bearing)).fold(1.0, f64::min)
}

/// The shortest rotation that brings a unit vector onto the z axis; half a turn about x where it points to -z.
///
/// Rodrigues' formula with the sine and cosine as they come, since an angle from its cosine holds 1e-8 near zero.
pub(crate) fn turn_onto_z(axis: &Bearing) -> Rotation3<f64> {
    let sine = axis.x.hypot(axis.y);
    let about = if sine > 0.0 { Vector3::new(axis.y / sine, -axis.x / sine, 0.0) } else { Vector3::x() };
    let cross = about.cross_matrix();
    Rotation3::from_matrix_unchecked(Matrix3::identity() + cross * sine + cross * cross * (1.0 - axis.z))
}
