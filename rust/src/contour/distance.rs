//! The pose at which the projected boundary falls on the observed contour, whatever part of that is disturbed
//! (`docs/math.md`, section 11).
//!
//! A bite out of a region moves all its moments, but only a part of its contour. The contour is cut into short pieces; each
//! has a signed distance from the projected boundary, with exact derivatives by the pose. Their squares are weighted
//! down where they are large against a scale that falls step by step, and the scale at which the distances are most
//! likely wins: a fine one where most of the contour is clean, a wide one, which is plain least squares, where none is.

use nalgebra::{DVector, Dyn, Matrix6, OMatrix, Rotation3, U6, Vector2, Vector3, Vector6};

use crate::contour::correlation::correlation;
use crate::contour::loss::weight;
use crate::contour::mixture::{Distances, Mixture};
use crate::contour::pieces::{Piece, edges, pieces};
use crate::equations::residual::{Evaluation, RegionEquations};
use crate::geometry::pose::{Pose, Tangent};
use crate::region::WorldRegion;
use crate::search::corners::simplified;
use crate::view::border::{edge_before, near_plane};

/// The finest scale, in pixels: pieces of a binary mask's contour scatter by 0.15 to 0.25.
pub const FINEST_SCALE: f64 = 0.25;

/// The first scale over the standard deviation of the distances at the start: nothing is given up yet.
const FIRST_SCALE: f64 = 1.5;

/// From scale to scale.
const SCALE_STEP: f64 = 1.5;

/// Gauss-Newton steps at one scale at most.
const STEPS: usize = 4;

/// Gauss-Newton steps at the finest scale at most.
const LAST_STEPS: usize = 12;

/// A step below this, rad and share of the distance, ends the iteration at a scale: a thousandth of a pixel.
const SETTLED: f64 = 1e-7;

/// Halvings of a step that takes a region out of view.
const HALVINGS: usize = 6;

/// Longest step, rad and share of the distance.
const LONGEST_STEP: f64 = 0.1;

/// Added to the diagonal of the normal equations, as a share of it, so that a free direction stays where it is.
const RIDGE: f64 = 1e-9;

/// Squared tangent of the angle to the boundary (30 degrees) beyond which a piece runs across it, as the side of a bite does
/// where that crosses the outline; and what its spread across counts beside its squared distance.
const ALIGNED: f64 = 3.0;
const CROSSING: f64 = 4.0;

/// A piece is astray at this many standard deviations of the others; a clean contour has such pieces at corners alone.
const ASTRAY: f64 = 4.0;
const FEW_ASTRAY: f64 = 0.02;

/// Standard deviation of the pieces' distances, pixels, above which a contour isn't clean, however even they are.
const CLEAN_SIGMA: f64 = 1.0;

/// Edges along the ring on either side of a piece's last nearest one that are looked at within a scale.
const NEIGHBOURS: usize = 2;

/// Where on the plane z = 1 of the chart's axes an edge behind the camera is put.
const FAR: f64 = 1e9;

/// The contour of one region in the image and the boundary of its world region.
#[derive(Debug, Clone)]
pub struct Contour {
    /// `chart_from_camera`.
    rotation: Rotation3<f64>,
    /// On the plane z = 1 of the chart's axes.
    pieces: Vec<Piece>,
    /// Pixels per unit of that plane.
    pixels: f64,
    /// Boundary rings of the world region about the problem's origin.
    rings: Vec<Vec<Vector3<f64>>>,
    /// Whether the image's border cuts the region, so that a part of its boundary may be behind the camera.
    cut: bool,
}

/// A pose on the contour and what the contour shows there.
#[derive(Debug, Clone)]
pub struct ContourFit {
    /// The pose about the problem's origin.
    pub pose: Pose,
    /// The distances' distribution.
    pub mixture: Mixture,
    /// How far off each piece counts, pixels (`docs/math.md`, eq. 11.4).
    pub misfits: Vec<f64>,
    /// Whether the pieces scatter by less than a pixel, and hardly one lies far off.
    pub is_clean: bool,
    /// Share of the clean pieces of each region.
    pub clean_shares: Vec<f64>,
    /// Parts of the contours that were disturbed, or not, independently of each other.
    pub independent: f64,
}

impl ContourFit {
    /// By how many standard deviations of chance this fit's likelihood exceeds that of another fit to the same pieces (Vuong's
    /// test; `docs/math.md`, eq. 11.7): the standard deviation is that of the pieces' own differences.
    pub fn sigmas_above(&self, other: &Self) -> f64 {
        let differences: Vec<f64> = self.log_densities().zip(other.log_densities()).map(|(a, b)| a - b).collect();
        let mean = mean(&differences);
        let scatter = centred(&differences);
        let square = scatter.iter().map(|value| value * value).sum::<f64>() * correlation(&scatter);
        mean * differences.len() as f64 / square.sqrt().max(f64::MIN_POSITIVE)
    }

    fn log_densities(&self) -> impl Iterator<Item = f64> + '_ {
        self.misfits.iter().map(|&misfit| self.mixture.log_density(misfit))
    }

    /// Share of all pieces that are clean at another fit's pose but for the scatter of this one's.
    pub fn share_at(&self, other: &Self) -> f64 {
        let clean: Vec<f64> = other.misfits.iter().map(|&misfit| self.mixture.clean_probability(misfit)).collect();
        mean(&clean)
    }

    /// Share of the clean pieces of one region, and the least of the others'; 0 without others.
    pub fn clean_shares_of(&self, region: usize) -> (f64, f64) {
        let others = self.clean_shares.iter().enumerate().filter(|(index, _)| *index != region);
        (self.clean_shares[region], others.map(|(_, share)| *share).reduce(f64::min).unwrap_or(0.0))
    }
}

impl Contour {
    /// The contour of an observed region, without what lies on the image's border, and the boundary of its world region about
    /// `origin`.
    pub fn new(region: &RegionEquations, world: &WorldRegion, origin: &Vector3<f64>) -> Self {
        let scale = region.chart().scale;
        let pixels = region.pixel_area().sqrt();
        let on_border = region.border().map_or(&[][..], |border| border.on_border());
        let pieces = pieces(region.outline(), on_border, pixels).into_iter().map(|piece| piece.scaled(scale)).collect();
        let rings = world.rings().into_iter().map(|ring| ring.into_iter().map(|x| x - origin).collect()).collect();
        Self {
            rotation: region.chart().rotation,
            pieces,
            pixels: pixels * scale,
            rings,
            cut: region.border().is_some(),
        }
    }

    /// The straight run of the contour that each piece wholly lies on, by number.
    pub(crate) fn runs(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        self.pieces.iter().map(|piece| piece.run)
    }

    /// The same with one piece in `step`.
    pub fn thinned(&self, step: usize) -> Self {
        Self { pieces: self.pieces.iter().copied().step_by(step).collect(), ..self.clone() }
    }
}

impl Contour {
    /// The same with so many pieces at most, and without boundary vertices that stand out by less than `tolerance` (world).
    pub fn sketched(&self, most: usize, tolerance: f64) -> Self {
        let rings = self.rings.iter().map(|ring| simplified(ring, tolerance)).collect();
        Self { rings, ..self.thinned(self.pieces.len().div_ceil(most)) }
    }
}

/// Mean of `ln(1 + (d / scale)^2)` over the pieces' distances at a pose about the problem's origin, `scale` in pixels; `None`
/// where a region is out of view.
///
/// What lies anywhere near counts for the pose, what lies far off hardly against it (the logarithm of Cauchy's distribution).
pub fn misfit(contours: &[Contour], pose: &Pose, scale: f64) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for contour in contours {
        let (edges, _) = contour.projected(pose)?;
        let unit = (contour.pixels / scale).powi(2);
        for piece in &contour.pieces {
            let square = edges.iter().map(|edge| edge.foot(&piece.mean).1.norm_squared()).fold(f64::INFINITY, f64::min);
            sum += (unit * square).ln_1p();
        }
        count += contour.pieces.len();
    }
    Some(sum / count as f64)
}

/// An edge of the projected boundary: its ends along the chart's axes, and on the plane z = 1.
#[derive(Debug, Clone, Copy)]
struct Edge {
    from: Vector3<f64>,
    to: Vector3<f64>,
    start: Vector2<f64>,
    step: Vector2<f64>,
    inverse: f64,
}

impl Edge {
    /// An edge behind the camera: far from every piece.
    fn hidden() -> Self {
        let far = Vector3::new(FAR, FAR, 1.0);
        Self::new(far, far)
    }

    fn new(from: Vector3<f64>, to: Vector3<f64>) -> Self {
        let (start, end) = (from.xy() / from.z, to.xy() / to.z);
        let step = end - start;
        Self { from, to, start, step, inverse: 1.0 / step.norm_squared().max(f64::MIN_POSITIVE) }
    }

    /// Where on the edge a point's foot lies, 0 to 1, and the offset of the point from it.
    fn foot(&self, point: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let offset = point - self.start;
        let share = (offset.dot(&self.step) * self.inverse).clamp(0.0, 1.0);
        (share, offset - self.step * share)
    }
}

/// A piece against the boundary.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    /// Signed distance of its mean, pixels.
    pub distance: f64,
    /// Derivatives of that by the left increment.
    pub derivative: Vector6<f64>,
    /// Mean square of its points about their mean across the boundary, squared pixels.
    pub spread: f64,
    /// How far off it counts: as far as its mean, farther where it runs across the boundary, pixels.
    pub misfit: f64,
}

impl Contour {
    /// The projected boundary at a pose about the problem's origin; `None` where it isn't wholly before the chart's plane, or
    /// for a region that the image's border cuts not at all.
    fn projected(&self, pose: &Pose) -> Option<(Vec<Edge>, Vec<usize>)> {
        let chart_from_world = Pose::new(self.rotation * pose.rotation, self.rotation * pose.translation);
        let (mut projected, mut ends) = (Vec::new(), Vec::new());
        for ring in &self.rings {
            let moved: Vec<_> = ring.iter().map(|x| chart_from_world.transform(x)).collect();
            if moved.iter().all(|x| x.z > 0.0) {
                projected.extend(edges(&moved).map(|(from, to)| Edge::new(from, to)));
            } else if self.cut && moved.iter().any(|x| x.z > 0.0) {
                let near = near_plane(&moved);
                let edge = |ends: Option<[Vector3<f64>; 2]>| ends.map_or_else(Edge::hidden, |[a, b]| Edge::new(a, b));
                projected.extend(edges(&moved).map(|(from, to)| edge(edge_before(near, &from, &to))));
            } else {
                return None;
            }
            ends.push(projected.len());
        }
        Some((projected, ends))
    }

    /// Index of the edge nearest to each piece; of all, or of those around the nearest of before.
    fn nearest(&self, edges: &[Edge], ends: &[usize], before: Option<&[usize]>) -> Vec<usize> {
        let among = |point: &Vector2<f64>, indices: &mut dyn Iterator<Item = usize>| {
            let mut best = (f64::INFINITY, 0);
            for index in indices {
                let square = edges[index].foot(point).1.norm_squared();
                if square < best.0 {
                    best = (square, index);
                }
            }
            best.1
        };
        match before {
            None => self.pieces.iter().map(|piece| among(&piece.mean, &mut (0..edges.len()))).collect(),
            Some(before) => self
                .pieces
                .iter()
                .zip(before)
                .map(|(piece, &last)| among(&piece.mean, &mut around(last, ends)))
                .collect(),
        }
    }

    /// Distance and derivatives of one piece from one edge (`docs/math.md`, eq. 11.2 and 11.3).
    fn row(&self, piece: &Piece, edge: &Edge) -> Row {
        let (share, offset) = edge.foot(&piece.mean);
        let normal = Vector2::new(edge.step.y, -edge.step.x) * edge.inverse.sqrt();
        let inside = share > 0.0 && share < 1.0;
        let distance = offset.norm();
        // Beyond an end the distance is that from the vertex, and its direction the offset's own.
        let (value, normal) = match inside || distance == 0.0 {
            true => (offset.dot(&normal), normal),
            false => (distance, offset / distance),
        };
        // The point of the edge in space that is seen at the foot.
        let weight = share * edge.from.z / (share * edge.from.z + (1.0 - share) * edge.to.z);
        let seen = edge.from.lerp(&edge.to, weight);
        let along = Vector3::new(normal.x, normal.y, -(normal.x * seen.x + normal.y * seen.y) / seen.z) / seen.z;
        let by_translation = -(self.rotation.inverse() * along);
        let by_rotation = (self.rotation.inverse() * seen).cross(&by_translation);
        let derivative = Vector6::new(
            by_rotation.x,
            by_rotation.y,
            by_rotation.z,
            by_translation.x,
            by_translation.y,
            by_translation.z,
        );
        let (distance, spread) = (self.pixels * value, normal.dot(&(piece.spread * normal)));
        let crossing = CROSSING * (spread - (piece.spread.trace() - spread) / ALIGNED).max(0.0);
        let squared = self.pixels.powi(2);
        let misfit = (distance.powi(2) + squared * crossing).sqrt();
        Row { distance, derivative: self.pixels * derivative, spread: squared * spread, misfit }
    }
}

/// Indices of the edges along a ring around one of them.
fn around(index: usize, ends: &[usize]) -> impl Iterator<Item = usize> + use<> {
    let ring = ends.partition_point(|&end| end <= index);
    let first = if ring == 0 { 0 } else { ends[ring - 1] };
    let count = ends[ring] - first;
    let reach = NEIGHBOURS.min((count - 1) / 2);
    (0..2 * reach + 1).map(move |k| first + (index - first + count + k - reach) % count)
}

/// Distances and derivatives of all pieces, and the edges that they belong to.
pub(crate) struct Rows {
    pub rows: Vec<Row>,
    pub nearest: Vec<Vec<usize>>,
}

impl Rows {
    /// `None` where a region is out of view.
    pub fn at(contours: &[Contour], pose: &Pose, before: Option<&[Vec<usize>]>) -> Option<Self> {
        let (mut rows, mut all) = (Vec::new(), Vec::new());
        for (index, contour) in contours.iter().enumerate() {
            let (edges, ends) = contour.projected(pose)?;
            let nearest = contour.nearest(&edges, &ends, before.map(|before| before[index].as_slice()));
            rows.extend(contour.pieces.iter().zip(&nearest).map(|(piece, &k)| contour.row(piece, &edges[k])));
            all.push(nearest);
        }
        Some(Self { rows, nearest: all })
    }

    fn distances(&self) -> Distances {
        Distances::new(self.rows.iter().map(|row| row.misfit))
    }

    /// Gauss-Newton step of the distances weighted down beyond a scale; `None` where no direction is held.
    fn step(&self, scale: f64) -> Option<Tangent> {
        let (normal, gradient) = self.normal_equations(scale);
        let ridge = Matrix6::from_diagonal(&(normal.diagonal() * RIDGE));
        Some(-(normal + ridge).cholesky()?.solve(&gradient))
    }

    /// `J^T W J` and `J^T W r` at a scale.
    fn normal_equations(&self, scale: f64) -> (Matrix6<f64>, Vector6<f64>) {
        let (mut normal, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
        for Row { distance, derivative, misfit, .. } in &self.rows {
            let weighted = derivative * weight(*misfit, scale);
            normal += weighted * derivative.transpose();
            gradient += weighted * *distance;
        }
        (normal, gradient)
    }
}

/// Distances (pixels) and derivatives of all pieces at a pose about the problem's origin; `None` where a region is out of
/// view.
pub fn contour_distances(contours: &[Contour], pose: &Pose) -> Option<Evaluation> {
    let rows = Rows::at(contours, pose, None)?.rows;
    Some(Evaluation {
        residual: DVector::from_iterator(rows.len(), rows.iter().map(|row| row.distance)),
        jacobian: OMatrix::<f64, Dyn, U6>::from_fn(rows.len(), |row, column| rows[row].derivative[column]),
    })
}

/// What the contours show at a pose about the problem's origin; `None` where a region is out of view.
pub fn contour_fit(contours: &[Contour], pose: &Pose) -> Option<ContourFit> {
    Some(fit_of(&Rows::at(contours, pose, None)?, pose))
}

/// The most likely pose on the contours that is reached from a start; the start itself where nothing is likelier.
///
/// `None` where a region is out of view at the start.
pub fn refined(contours: &[Contour], start: &Pose) -> Option<ContourFit> {
    let mut rows = Rows::at(contours, start, None)?;
    let mut pose = *start;
    let mut best = (rows.distances().mixture(FINEST_SCALE).likelihood, pose);
    let mut scale = (FIRST_SCALE * rows.distances().robust_sigma()).max(2.0 * FINEST_SCALE);
    loop {
        (pose, rows) = settled(contours, pose, rows, scale);
        let likelihood = rows.distances().mixture(FINEST_SCALE).likelihood;
        if likelihood > best.0 {
            best = (likelihood, pose);
        }
        if scale <= FINEST_SCALE {
            return contour_fit(contours, &best.1);
        }
        scale = (scale / SCALE_STEP).max(FINEST_SCALE);
    }
}

/// The pose after Gauss-Newton steps at one scale, and the distances there.
fn settled(contours: &[Contour], mut pose: Pose, mut rows: Rows, scale: f64) -> (Pose, Rows) {
    let steps = if scale > FINEST_SCALE { STEPS } else { LAST_STEPS };
    for step in 0..steps {
        let Some(increment) = rows.step(scale) else { break };
        let nearest = (step > 0).then_some(&rows.nearest[..]);
        let Some(next) = advanced(contours, &pose, &increment, nearest) else { break };
        (pose, rows) = next;
        if size(&increment, &pose) < SETTLED {
            break;
        }
    }
    (pose, rows)
}

fn fit_of(rows: &Rows, pose: &Pose) -> ContourFit {
    let distances = rows.distances();
    let mixture = distances.mixture(FINEST_SCALE);
    let misfits: Vec<f64> = rows.rows.iter().map(|row| row.misfit).collect();
    let clean: Vec<f64> = misfits.iter().map(|&misfit| mixture.clean_probability(misfit)).collect();
    let shares: Vec<&[f64]> = split(&clean, rows.nearest.iter().map(Vec::len));
    // A region that is disturbed as a whole says nothing of how long the disturbances are.
    let about_mean: Vec<f64> = shares.iter().flat_map(|region| centred(region)).collect();
    let independent = clean.len() as f64 / correlation(&about_mean);
    let clean_shares = shares.iter().map(|region| mean(region)).collect();
    let sigma = distances.robust_sigma().max(FINEST_SCALE);
    let is_clean = sigma < CLEAN_SIGMA && distances.share_beyond(ASTRAY * sigma) < FEW_ASTRAY;
    ContourFit { pose: *pose, mixture, misfits, is_clean, clean_shares, independent }
}

/// Consecutive parts of these lengths.
fn split(values: &[f64], lengths: impl Iterator<Item = usize>) -> Vec<&[f64]> {
    let mut rest = values;
    let mut next = |length: usize| {
        let (part, others) = rest.split_at(length);
        rest = others;
        part
    };
    lengths.map(&mut next).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn centred(values: &[f64]) -> Vec<f64> {
    let mean = mean(values);
    values.iter().map(|value| value - mean).collect()
}

/// The pose moved by an increment, shortened until every region is in view.
fn advanced(
    contours: &[Contour],
    pose: &Pose,
    increment: &Tangent,
    nearest: Option<&[Vec<usize>]>,
) -> Option<(Pose, Rows)> {
    let mut increment = increment * (LONGEST_STEP / size(increment, pose)).min(1.0);
    for _ in 0..=HALVINGS {
        let moved = pose.moved(&increment);
        if let Some(rows) = Rows::at(contours, &moved, nearest) {
            return Some((moved, rows));
        }
        increment *= 0.5;
    }
    None
}

/// Size of an increment: radians, or a share of the distance.
fn size(increment: &Tangent, pose: &Pose) -> f64 {
    let distance = pose.translation.norm().max(f64::MIN_POSITIVE);
    increment.fixed_rows::<3>(0).norm().max(increment.fixed_rows::<3>(3).norm() / distance)
}
