//! One photo and one cloud: how well the cloud's edges lie on the photo's at a pose (`docs/math.md`, section 19).

use nalgebra::{Matrix6, SVector, Vector2, Vector3, Vector6};

use super::cloud_edges::{CloudEdges, GroupedEdges};
use super::pictures::{LogRatios, direction_of};
use super::projection::Projection;
use crate::effort;
use crate::geometry::pose::Pose;

/// Edges that are looked at by each spread, from wide to narrow, of a cloud all around: those of wide ones overlap, and say the same.
pub const MOST_EDGES: [usize; SPREADS] = [3_000, 6_000, 12_000, 24_000];

/// Spreads of edges in a photo, from what a draw of the pose may be off to what edges of a scan are, pixels: standard deviations of
/// Gaussians.
pub const SPREADS_PX: [f64; SPREADS] = [16.0, 8.0, 4.0, 2.0];

/// Number of spreads.
pub const SPREADS: usize = 4;

/// The finest spread.
pub const FINEST: usize = SPREADS - 1;

/// A photo as a camera sees it, and the edges of a cloud.
#[derive(Debug, Clone)]
pub struct Frame {
    view: PhotoView,
    edges: [GroupedEdges; SPREADS],
    origin: Vector3<f64>,
}

/// A photo: its camera's projection, and what it shows by spread.
#[derive(Debug, Clone)]
pub struct PhotoView {
    /// Bearings to pixels.
    pub projection: Projection,
    /// By spread, as [`SPREADS_PX`].
    pub pictures: [LogRatios; SPREADS],
    /// The largest angle between the camera's axis and what the photo shows, rad.
    pub half_field: f64,
}

impl Frame {
    /// That of a photo and a cloud's edges; sums are taken about an `origin` of the world, near the scanner.
    pub fn new(view: PhotoView, edges: &CloudEdges, origin: Vector3<f64>) -> Self {
        let grouped = MOST_EDGES.map(|most| GroupedEdges::new(&edges.thinned(most), &origin));
        Self { view, edges: grouped, origin }
    }

    /// The same photo with other edges.
    pub fn with_edges(&self, edges: &CloudEdges) -> Self {
        Self::new(self.view.clone(), edges, self.origin)
    }

    /// The same photo and edges as another camera has them; `half_field` as of [`PhotoView`].
    pub fn with_projection(&self, projection: &Projection, half_field: f64) -> Self {
        let view = PhotoView { projection: projection.clone(), half_field, ..self.view.clone() };
        Self { view, ..self.clone() }
    }

    /// The sum of log likelihood ratios under the edges that a camera at a pose sees, by the number of the spread, as if edges were
    /// independent; and how many the photo shows.
    pub fn log_ratio(&self, pose: &Pose, spread: usize) -> (f64, usize) {
        if effort::is_stopped() {
            return (0.0, 0);
        }
        let (local, edges) = (Local::new(pose, &self.origin), &self.edges[spread]);
        let (picture, projection) = (&self.view.pictures[spread], &self.view.projection);
        let (mut sum, mut count, mut looked_at) = (0.0_f64, 0, 0);
        for range in edges.within(&local.pose, self.cone()) {
            looked_at += range.len();
            for edge in range {
                let (_, bearing, way) = local.of(edges, edge);
                if let Some(value) = projection.pixel(bearing, way).and_then(|(pixel, way)| picture.at(pixel, way)) {
                    sum += f64::from(value);
                    count += 1;
                }
            }
        }
        effort::spend(looked_at);
        (sum, count)
    }

    /// The edges that a camera at a pose sees, for sums at poses near it.
    pub fn seen_from(&self, pose: &Pose, spread: usize) -> SeenEdges<'_> {
        let mut seen = SeenEdges { frame: self, spread, points: Vec::new(), directions: Vec::new() };
        if effort::is_stopped() {
            return seen;
        }
        let edges = &self.edges[spread];
        let local = Local::new(pose, &self.origin);
        let mut looked_at = 0;
        for range in edges.within(&local.pose, self.cone()) {
            looked_at += range.len();
            for edge in range {
                let (point, bearing, way) = local.of(edges, edge);
                let Some((pixel, across)) = self.view.projection.pixel(bearing, way) else { continue };
                if pixel.iter().chain(&across).all(|value| value.is_finite()) {
                    seen.points.push(point);
                    seen.directions.push(direction_of(across));
                }
            }
        }
        effort::spend(looked_at);
        seen
    }

    /// Cosine and sine of the largest angle from the camera's axis that the photo shows.
    fn cone(&self) -> [f64; 2] {
        let (sine, cosine) = self.view.half_field.sin_cos();
        [cosine, sine]
    }
}

/// A pose about an origin of the world, in single precision.
struct Local {
    pose: Pose,
    rows: [[f32; 3]; 3],
    shift: [f32; 3],
}

impl Local {
    fn new(pose: &Pose, origin: &Vector3<f64>) -> Self {
        let pose = Pose::new(pose.rotation, pose.transform(origin));
        let rotation = pose.rotation.matrix();
        let rows = [0, 1, 2].map(|row| [0, 1, 2].map(|column| rotation[(row, column)] as f32));
        Self { pose, rows, shift: [0, 1, 2].map(|axis| pose.translation[axis] as f32) }
    }

    /// A point in the camera's axes.
    #[inline(always)]
    fn transform(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|axis| {
            let row = self.rows[axis];
            row[0] * x + row[1] * y + row[2] * z + self.shift[axis]
        })
    }

    /// An edge's middle, and this and the way across in the camera's axes.
    #[inline(always)]
    fn of(&self, edges: &GroupedEdges, edge: usize) -> ([f32; 3], [f32; 3], [f32; 3]) {
        let point = [0, 1, 2].map(|axis| edges.middles[axis][edge]);
        let [x, y, z] = [0, 1, 2].map(|axis| edges.across[axis][edge]);
        (point, self.transform(point), self.rows.map(|row| row[0] * x + row[1] * y + row[2] * z))
    }
}

/// Edges as a camera sees them, each across a direction of the photo that stays as it is.
#[derive(Debug, Clone)]
pub struct SeenEdges<'a> {
    frame: &'a Frame,
    spread: usize,
    /// About the frame's origin.
    points: Vec<[f32; 3]>,
    directions: Vec<usize>,
}

impl SeenEdges<'_> {
    /// The sum of log likelihood ratios at a pose, less an `offset` for each edge that the photo shows, and its derivative by a left
    /// increment.
    pub fn log_ratio(&self, pose: &Pose, offset: f64) -> (f64, SVector<f64, 6>) {
        effort::spend(2 * self.points.len());
        let local = Local::new(pose, &self.frame.origin);
        let (view, mut sum, mut slope) = (&self.frame.view, 0.0_f64, [0.0_f64; 6]);
        let picture = &view.pictures[self.spread];
        for (point, direction) in self.points.iter().zip(&self.directions) {
            let bearing = local.transform(*point);
            let Some((pixel, place)) = view.projection.pixel_and_place(bearing) else { continue };
            let Some((value, by_pixel)) = picture.with_slope(pixel, *direction) else { continue };
            sum += f64::from(value) - offset;
            let [i, j, k] = view.projection.by_bearing(&place, bearing, by_pixel);
            let [x, y, z] = bearing;
            for (total, term) in slope.iter_mut().zip([y * k - z * j, z * i - x * k, x * j - y * i, i, j, k]) {
                *total += f64::from(term);
            }
        }
        (sum, SVector::from(slope))
    }

    /// The mean square by which left increments of a pose move the edges in the photo, pixels, as a matrix; and how many it sees.
    pub fn square_moves(&self, pose: &Pose) -> (Matrix6<f64>, usize) {
        let (mut squares, mut count) = (Matrix6::zeros(), 0);
        let (local, view) = (Local::new(pose, &self.frame.origin), &self.frame.view);
        for point in &self.points {
            let bearing = local.transform(*point);
            let Some((pixel, place)) = view.projection.pixel_and_place(bearing) else { continue };
            if view.pictures[self.spread].with_slope(pixel, 0).is_none() {
                continue;
            }
            for axis in 0..2 {
                let along = [[1.0, 0.0], [0.0, 1.0]][axis];
                let by_bearing = Vector3::from(view.projection.by_bearing(&place, bearing, along)).cast::<f64>();
                let by_turn = Vector3::from(bearing).cast::<f64>().cross(&by_bearing);
                let moves = Vector6::new(by_turn.x, by_turn.y, by_turn.z, by_bearing.x, by_bearing.y, by_bearing.z);
                squares.ger(1.0, &moves, &moves, 1.0);
            }
            count += 1;
        }
        (squares / count.max(1) as f64, count)
    }

    /// The pixels at which the edges are seen at a pose, and the numbers of the directions across them.
    pub fn pixels(&self, pose: &Pose) -> (Vec<Vector2<f64>>, Vec<usize>) {
        let local = Local::new(pose, &self.frame.origin);
        let seen = self.points.iter().zip(&self.directions).filter_map(|(point, direction)| {
            let (pixel, _) = self.frame.view.projection.pixel_and_place(local.transform(*point))?;
            Some((Vector2::from(pixel).cast::<f64>(), *direction))
        });
        seen.unzip()
    }
}
