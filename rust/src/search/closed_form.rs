//! Poses to start from: the closed form that needs no prior, and the paper's own start.

use std::sync::LazyLock;

use nalgebra::{Complex, Matrix2, Matrix3, Rotation3, Vector2, Vector3};

use super::turns::{ANGLES, TURN, least};
use crate::geometry::pose::Pose;
use crate::geometry::rings::PlaneRings;
use crate::moments::plane::planar_moments;
use crate::moments::shape::{NormalizedShape, SHAPE_ORDERS, centroid};
use crate::region::{PlaneFrame, WorldRegion};
use crate::view::chart::Chart;

/// Poses at which a planar region's affine view matches its chart (`docs/math.md`, section 7).
///
/// The second moments fix the affine map from the region's plane to the chart but for a turn and a mirror; moments of order
/// 3 to 8 choose the turns; each affine map is the first-order view of two poses. `origin` is the world point relative to
/// which the poses take world coordinates. Symmetric shapes give candidates for each symmetry.
pub fn closed_form(chart: &Chart, outline: &PlaneRings, world: &WorldRegion, origin: &Vector3<f64>) -> Vec<Pose> {
    let (Some(observed), Some(model)) = (NormalizedShape::of(outline.rings()), world.shape()) else {
        return Vec::new();
    };
    let Some(back) = observed.transform.try_inverse() else { return Vec::new() };
    let target = observed.mean / chart.scale;
    let mut poses = Vec::new();
    for turn in turns(&observed, model) {
        let affine = back * turn.matrix() * model.transform / chart.scale;
        for (rotation, depth) in two_fold(&affine) {
            let chart_from_plane = Pose::new(rotation, Vector3::new(target.x, target.y, 1.0) * depth);
            poses.push(posed(chart, &chart_from_plane, world.frame(), &model.mean, origin));
        }
    }
    poses
}

/// The paper's start (section 2.1.1 and 2.2.1): the region faces the camera along the ray of its centroid, at the
/// distance at which both areas agree (`docs/math.md`, eq. 7.10); `up` (world) is turned to the camera's -y as far as
/// that leaves the ray alone.
///
/// Without `up` the plane's own axes are taken as they come.
pub fn facing(
    chart: &Chart,
    outline: &PlaneRings,
    world: &WorldRegion,
    origin: &Vector3<f64>,
    up: Option<&Vector3<f64>>,
) -> Vec<Pose> {
    let frame = world.frame();
    let depth = (world.outline().area() / outline.area()).sqrt() * chart.scale;
    let mean = centroid(&planar_moments(slices(world.outline()), 1));
    let camera_up = chart.rotation * -Vector3::y();
    [1.0, -1.0]
        .into_iter()
        .map(|side| {
            let normal = frame.axes[2] * side;
            let first = up.map_or(frame.axes[1], |up| *up);
            let world_axes = axes_from(&normal, &first, &frame.axes[0]);
            let chart_axes = axes_from(&-Vector3::z(), &up.map_or(-Vector3::y(), |_| camera_up), &Vector3::x());
            let rotation = Rotation3::from_matrix_unchecked(chart_axes * world_axes.transpose());
            let center = frame.to_world(&mean) - origin;
            let translation = Vector3::z() * depth - rotation * center;
            let back = chart.rotation.inverse();
            Pose::new(back * rotation, back * translation)
        })
        .collect()
}

/// The other pose whose first-order view of a region is the same: its normal mirrored at the ray of its centroid
/// (`docs/math.md`, eq. 7.11).
///
/// Facing poses lie midway between the two, where first derivatives hardly distinguish them: least squares from there end
/// at either.
pub fn conjugate(pose: &Pose, world: &WorldRegion, origin: &Vector3<f64>) -> Pose {
    let frame = world.frame();
    let center = frame.to_world(&centroid(&planar_moments(slices(world.outline()), 1))) - origin;
    let place = pose.transform(&center);
    let half_turn = |axis: &Vector3<f64>| Rotation3::from_scaled_axis(axis * std::f64::consts::PI);
    let rotation = half_turn(&place.normalize()) * pose.rotation * half_turn(&frame.axes[2]);
    Pose::new(rotation, place - rotation * center)
}

/// Right-handed axes: the third along `normal`, the second as near to `up` as that allows, or to `spare` where `up` is normal.
fn axes_from(normal: &Vector3<f64>, up: &Vector3<f64>, spare: &Vector3<f64>) -> Matrix3<f64> {
    let across = |v: &Vector3<f64>| (v - normal * normal.dot(v)).try_normalize(1e-6 * v.norm());
    let second = across(up).or_else(|| across(spare)).unwrap_or_else(Vector3::y);
    Matrix3::from_columns(&[second.cross(normal), second, *normal])
}

/// `camera_from_world` of a chart pose whose plane coordinates are taken relative to `mean`.
fn posed(
    chart: &Chart,
    chart_from_plane: &Pose,
    frame: &PlaneFrame,
    mean: &Vector2<f64>,
    origin: &Vector3<f64>,
) -> Pose {
    let plane_from_world = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&frame.axes).transpose());
    let rotation = chart_from_plane.rotation * plane_from_world;
    let translation = chart_from_plane.translation - rotation * (frame.to_world(mean) - origin);
    let back = chart.rotation.inverse();
    Pose::new(back * rotation, back * translation)
}

/// The two rotations whose first-order view at the optical axis is `affine`, and the depth of both (after the planar
/// decomposition of Collins and Bartoli 2014).
///
/// `affine * depth` is the upper left block of a rotation, so `depth = 1 / (largest singular value)`
/// (`docs/math.md`, eq. 7.7 to 7.9).
fn two_fold(affine: &Matrix2<f64>) -> Vec<(Rotation3<f64>, f64)> {
    let gram = affine.transpose() * affine;
    let half = gram.trace() / 2.0;
    let largest = half + (half * half - gram.determinant()).max(0.0).sqrt();
    if largest <= 0.0 || !largest.is_finite() {
        return Vec::new();
    }
    let depth = largest.sqrt().recip();
    let block = affine * depth;
    let rest = Matrix2::identity() - block.transpose() * block;
    let third = if rest[(0, 0)] >= rest[(1, 1)] {
        let first = rest[(0, 0)].max(0.0).sqrt();
        Vector2::new(first, if first > 0.0 { rest[(0, 1)] / first } else { 0.0 })
    } else {
        let second = rest[(1, 1)].max(0.0).sqrt();
        Vector2::new(rest[(0, 1)] / second, second)
    };
    let signs: &[f64] = if third.norm() > f64::EPSILON { &[1.0, -1.0] } else { &[1.0] };
    signs.iter().map(|sign| (completed(&block, &(third * *sign)), depth)).collect()
}

/// The rotation whose first two columns are the block over the third row's entries.
fn completed(block: &Matrix2<f64>, third: &Vector2<f64>) -> Rotation3<f64> {
    let a = Vector3::new(block[(0, 0)], block[(1, 0)], third.x).normalize();
    let b = Vector3::new(block[(0, 1)], block[(1, 1)], third.y);
    let b = (b - a * a.dot(&b)).normalize();
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[a, b, a.cross(&b)]))
}

/// An in-plane turn, after a mirror at the first axis where the region is seen from behind.
#[derive(Debug, Clone, Copy)]
struct Turn {
    angle: f64,
    mirrored: bool,
}

impl Turn {
    fn matrix(&self) -> Matrix2<f64> {
        let (sine, cosine) = self.angle.sin_cos();
        let side = if self.mirrored { -1.0 } else { 1.0 };
        Matrix2::new(cosine, -sine * side, sine, cosine * side)
    }
}

/// The turns that bring the model's moments near the observed ones: local minima of the difference, with and without a mirror. Perspective
/// and noise disturb right and wrong ones alike.
fn turns(observed: &NormalizedShape, model: &NormalizedShape) -> Vec<Turn> {
    [false, true].into_iter().flat_map(|mirrored| Difference::new(observed, model, mirrored).local_minima()).collect()
}

/// Highest winding of the moments that are compared.
const WINDINGS: usize = *SHAPE_ORDERS.end();

/// Squared difference between the observed moments and the model's after a mirror and a turn: a trigonometric polynomial
/// (`docs/math.md`, eq. 7.5 and 7.6).
struct Difference {
    mirrored: bool,
    constant: f64,
    /// Those of the windings from 1 on.
    coefficients: [Complex<f64>; WINDINGS],
}

impl Difference {
    fn new(observed: &NormalizedShape, model: &NormalizedShape, mirrored: bool) -> Self {
        let mut constant = observed.power() + model.power();
        let mut coefficients = [Complex::new(0.0, 0.0); WINDINGS];
        for (s, m) in observed.moments.iter().zip(&model.moments) {
            let value = if mirrored { m.value.conj() } else { m.value };
            let product = s.value.conj() * value * (2.0 * s.share());
            match s.winding {
                0 => constant -= product.re,
                winding => coefficients[winding - 1] += product,
            }
        }
        Self { mirrored, constant, coefficients }
    }

    /// The value at an angle whose `e^(i winding angle)` is given for each winding from 1 on.
    fn at(&self, turned: impl IntoIterator<Item = Complex<f64>>) -> f64 {
        let term = |(c, turn): (&Complex<f64>, Complex<f64>)| c.re * turn.re - c.im * turn.im;
        self.constant - self.coefficients.iter().zip(turned).map(term).sum::<f64>()
    }

    fn local_minima(&self) -> Vec<Turn> {
        let table = &*UNIT_CIRCLE;
        let samples: [f64; ANGLES] =
            std::array::from_fn(|k| self.at((1..=WINDINGS).map(|winding| table[k * winding % ANGLES])));
        let at = |k: usize| samples[k % ANGLES];
        let refined = |k: usize| {
            let (before, here, after) = (at(k + ANGLES - 1), at(k), at(k + 1));
            let curvature = before - 2.0 * here + after;
            let shift = if curvature > 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
            Turn { angle: (k as f64 + shift) * TURN, mirrored: self.mirrored }
        };
        least(&samples).into_iter().map(refined).collect()
    }
}

/// `e^(i angle)` of the angles at which shapes are compared.
static UNIT_CIRCLE: LazyLock<[Complex<f64>; ANGLES]> =
    LazyLock::new(|| std::array::from_fn(|k| Complex::cis(k as f64 * TURN)));

fn slices(outline: &PlaneRings) -> impl Iterator<Item = &[Vector2<f64>]> {
    outline.rings().iter().map(Vec::as_slice)
}
