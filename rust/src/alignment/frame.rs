//! One photo and one cloud: the log likelihood ratio of the cloud's edges in the photo at a pose (`docs/math.md`, section 19).

use std::sync::Arc;

use nalgebra::{Matrix6, SVector, Vector2, Vector3, Vector6};

use super::cloud_edges::{CloudEdges, EdgeGroup, GroupedEdges, Thinning};
use super::groups::{Floats, GROUP, Numbers, ZEROS, total};
use super::pictures::{LogRatios, directions_of};
use super::projection::{Pixels, Places, Projection};
use crate::budget::Budget;
use crate::geometry::pose::Pose;
use crate::math::lanes::{NullaryFnOnce, vectorized};

/// Edges evaluated at each spread, from wide to narrow, of a cloud all around: at wide ones neighbors overlap, and are redundant.
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
    edges: [Arc<GroupedEdges>; SPREADS],
    /// Of edges as dense as those of the whole cloud.
    thinnings: [Thinning; SPREADS],
    origin: Vector3<f64>,
}

/// A photo: its camera's projection, and what it shows by spread.
#[derive(Debug, Clone)]
pub struct PhotoView {
    /// Bearings to pixels.
    pub projection: Projection,
    /// By spread, as [`SPREADS_PX`].
    pub pictures: [Arc<LogRatios>; SPREADS],
    /// The largest angle between the camera's axis and what the photo shows, rad.
    pub half_field: f64,
}

impl Frame {
    /// The frame of a photo and the edges of a cloud all around; sums are taken about an `origin` of the world, near the scanner.
    pub fn new(view: PhotoView, edges: &CloudEdges, origin: Vector3<f64>) -> Self {
        let thinnings = MOST_EDGES.map(|most| Thinning::to(most, edges.len()));
        Self { view, edges: grouped(edges, &thinnings, &origin), thinnings, origin }
    }

    /// The same photo with other edges of the cloud, of parts of it as many as before.
    pub fn with_edges(&self, edges: &CloudEdges) -> Self {
        Self { edges: grouped(edges, &self.thinnings, &self.origin), ..self.clone() }
    }

    /// The same photo and edges as another camera has them; `half_field` as of [`PhotoView`].
    pub fn with_projection(&self, projection: &Projection, half_field: f64) -> Self {
        let view = PhotoView { projection: projection.clone(), half_field, ..self.view.clone() };
        Self { view, ..self.clone() }
    }

    /// The same, which finer spreads than one, by its number, do not make finer.
    pub fn at_spread(&self, coarsest: usize) -> Self {
        let number = |spread: usize| spread.min(coarsest);
        let pictures = std::array::from_fn(|spread| self.view.pictures[number(spread)].clone());
        let edges = std::array::from_fn(|spread| self.edges[number(spread)].clone());
        Self { view: PhotoView { pictures, ..self.view.clone() }, edges, ..*self }
    }

    /// The sum of log likelihood ratios under the edges that a camera at a pose sees, by the number of the spread, as if edges were
    /// independent; and how many the photo shows.
    pub fn log_ratio(&self, pose: &Pose, spread: usize, budget: &Budget) -> (f64, usize) {
        if budget.is_canceled() {
            return (0.0, 0);
        }
        let (sum, count, evaluated) = vectorized(Sum { frame: self, pose, spread });
        budget.charge(evaluated);
        (sum, count)
    }

    /// The edges that a camera at a pose sees, for sums at poses near it.
    pub fn visible_edges<'a>(&'a self, pose: &Pose, spread: usize, budget: &'a Budget) -> VisibleEdges<'a> {
        let mut visible = VisibleEdges { frame: self, spread, groups: Vec::new(), count: 0, budget };
        if budget.is_canceled() {
            return visible;
        }
        let evaluated = vectorized(Find { pose, visible: &mut visible });
        budget.charge(evaluated);
        visible
    }

    /// Cosine and sine of the largest angle from the camera's axis that the photo shows.
    fn cone(&self) -> [f64; 2] {
        let (sine, cosine) = self.view.half_field.sin_cos();
        [cosine, sine]
    }
}

/// Edges in groups by spread, thinned.
fn grouped(edges: &CloudEdges, thinnings: &[Thinning; SPREADS], origin: &Vector3<f64>) -> [Arc<GroupedEdges>; SPREADS] {
    thinnings.each_ref().map(|thinning| Arc::new(GroupedEdges::new(&edges.thinned(thinning), origin)))
}

/// The sum of log likelihood ratios at a pose, how many edges the photo shows, and how many were evaluated.
struct Sum<'a> {
    frame: &'a Frame,
    pose: &'a Pose,
    spread: usize,
}

impl NullaryFnOnce for Sum<'_> {
    type Output = (f64, usize, usize);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { frame, pose, spread } = self;
        let local = Local::new(pose, &frame.origin);
        let (mut sum, mut count, mut evaluated) = (0.0, 0, 0);
        for group in frame.edges[spread].within(&local.pose, frame.cone()) {
            let (pixels, ways) = frame.view.project(&local, group);
            let around = frame.view.pictures[spread].around(&pixels, &directions_of(&ways));
            sum += total(&around.values(), &around.shown);
            count += around.count();
            evaluated += group.count;
        }
        (sum, count, evaluated)
    }
}

/// Fills in the edges that are visible from a pose, and counts those evaluated.
struct Find<'a, 'b> {
    pose: &'a Pose,
    visible: &'a mut VisibleEdges<'b>,
}

impl NullaryFnOnce for Find<'_, '_> {
    type Output = usize;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { pose, visible } = self;
        let frame = visible.frame;
        let local = Local::new(pose, &frame.origin);
        let mut evaluated = 0;
        for group in frame.edges[visible.spread].within(&local.pose, frame.cone()) {
            let (pixels, ways) = frame.view.project(&local, group);
            let directions = directions_of(&ways);
            for edge in 0..GROUP {
                if pixels.iter().chain(&ways).all(|values| values[edge].is_finite()) {
                    visible.push([0, 1, 2].map(|axis| group.middles[axis][edge]), directions[edge]);
                }
            }
            evaluated += group.count;
        }
        evaluated
    }
}

impl PhotoView {
    /// The pixels of edges and the ways across them there, from a pose; NaN where they are not seen.
    #[inline(always)]
    fn project(&self, local: &Local, edges: &EdgeGroup) -> ([Floats; 2], [Floats; 2]) {
        let places = self.projection.places(&local.transform(&edges.middles));
        let projected = self.projection.pixels(&places);
        let ways = projected.moved(&places, &local.turn(&edges.across));
        (projected.pixels, ways)
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

    /// Points in the camera's axes.
    #[inline(always)]
    fn transform(&self, points: &[Floats; 3]) -> [Floats; 3] {
        let mut transformed = self.turn(points);
        for (values, shift) in transformed.iter_mut().zip(self.shift) {
            for value in values {
                *value += shift;
            }
        }
        transformed
    }

    /// Vectors in the camera's axes.
    #[inline(always)]
    fn turn(&self, [x, y, z]: &[Floats; 3]) -> [Floats; 3] {
        let mut turned = [ZEROS; 3];
        for (values, row) in turned.iter_mut().zip(self.rows) {
            for edge in 0..GROUP {
                values[edge] = row[0] * x[edge] + row[1] * y[edge] + row[2] * z[edge];
            }
        }
        turned
    }
}

/// Edges as a camera sees them, each across a direction of the photo that stays as it is.
#[derive(Debug, Clone)]
pub struct VisibleEdges<'a> {
    frame: &'a Frame,
    spread: usize,
    groups: Vec<VisibleGroup>,
    count: usize,
    budget: &'a Budget,
}

/// A group of them; NaN where they are fewer than it holds.
#[derive(Debug, Clone)]
struct VisibleGroup {
    /// About the frame's origin.
    points: [Floats; 3],
    directions: Numbers,
}

impl VisibleEdges<'_> {
    fn push(&mut self, point: [f32; 3], direction: i32) {
        let place = self.count % GROUP;
        if place == 0 {
            self.groups.push(VisibleGroup { points: [[f32::NAN; GROUP]; 3], directions: [0; GROUP] });
        }
        if let Some(group) = self.groups.last_mut() {
            for (held, value) in group.points.iter_mut().zip(point) {
                held[place] = value;
            }
            group.directions[place] = direction;
        }
        self.count += 1;
    }

    /// The sum of log likelihood ratios at a pose, less an `offset` for each edge that the photo shows, and its derivative by a left
    /// increment.
    pub fn log_ratio(&self, pose: &Pose, offset: f64) -> (f64, SVector<f64, 6>) {
        self.budget.charge(2 * self.count);
        let (sum, count, slope) = vectorized(SumAndSlope { edges: self, pose });
        (sum - offset * count as f64, slope)
    }

    /// The mean square by which left increments of a pose move the edges in the photo, pixels, as a matrix; and how many it sees.
    pub fn square_moves(&self, pose: &Pose) -> (Matrix6<f64>, usize) {
        let (squares, count) = vectorized(SquareMoves { edges: self, pose });
        (squares / count.max(1) as f64, count)
    }

    /// The pixels at which the edges are seen at a pose, and the numbers of the directions across them.
    pub fn pixels(&self, pose: &Pose) -> (Vec<Vector2<f64>>, Vec<usize>) {
        let local = Local::new(pose, &self.frame.origin);
        let visible = self.groups.iter().flat_map(|group| {
            let [x, y] = self.project(&local, group).2.pixels;
            let of_edge = move |edge: usize| (Vector2::new(x[edge], y[edge]).cast(), group.directions[edge] as usize);
            (0..GROUP).map(of_edge).filter(|(pixel, _)| pixel.iter().all(|value: &f64| value.is_finite()))
        });
        visible.unzip()
    }

    /// The bearings of a group of edges, where these meet the cube, and where the camera sees them.
    #[inline(always)]
    fn project(&self, local: &Local, group: &VisibleGroup) -> ([Floats; 3], Places, Pixels) {
        let bearings = local.transform(&group.points);
        let places = self.frame.view.projection.places(&bearings);
        let pixels = self.frame.view.projection.pixels(&places);
        (bearings, places, pixels)
    }
}

/// The sum of log likelihood ratios at a pose, how many edges the photo shows, and the derivative of the sum by a left increment.
struct SumAndSlope<'a> {
    edges: &'a VisibleEdges<'a>,
    pose: &'a Pose,
}

impl NullaryFnOnce for SumAndSlope<'_> {
    type Output = (f64, usize, Vector6<f64>);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { edges, pose } = self;
        let local = Local::new(pose, &edges.frame.origin);
        let picture = &edges.frame.view.pictures[edges.spread];
        let (mut sum, mut count, mut slope) = (0.0, 0, [0.0; 6]);
        for group in &edges.groups {
            let (bearings, places, projected) = edges.project(&local, group);
            let around = picture.around(&projected.pixels, &group.directions);
            sum += total(&around.values(), &around.shown);
            count += around.count();
            let by_bearings = projected.by_bearings(&places, &around.slopes());
            for (sum, terms) in slope.iter_mut().zip(by_increments(&bearings, &by_bearings)) {
                *sum += total(&terms, &around.shown);
            }
        }
        (sum, count, Vector6::from(slope))
    }
}

/// The sum of the squares by which left increments of a pose move edges that the photo shows, pixels, and how many these are.
struct SquareMoves<'a> {
    edges: &'a VisibleEdges<'a>,
    pose: &'a Pose,
}

impl NullaryFnOnce for SquareMoves<'_> {
    type Output = (Matrix6<f64>, usize);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { edges, pose } = self;
        let local = Local::new(pose, &edges.frame.origin);
        let picture = &edges.frame.view.pictures[edges.spread];
        let (mut squares, mut count) = (Matrix6::zeros(), 0);
        for group in &edges.groups {
            let (bearings, places, projected) = edges.project(&local, group);
            let around = picture.around(&projected.pixels, &group.directions);
            count += around.count();
            for axis in 0..2 {
                let mut along = [ZEROS; 2];
                along[axis] = [1.0; GROUP];
                let moves = by_increments(&bearings, &projected.by_bearings(&places, &along));
                for row in 0..6 {
                    for column in 0..=row {
                        let mut products = ZEROS;
                        for edge in 0..GROUP {
                            products[edge] = moves[row][edge] * moves[column][edge];
                        }
                        squares[(row, column)] += total(&products, &around.shown);
                    }
                }
            }
        }
        squares.fill_upper_triangle_with_lower_triangle();
        (squares, count)
    }
}

/// Derivatives by the left increment of a pose, by those by the bearings.
#[inline(always)]
fn by_increments([x, y, z]: &[Floats; 3], by_bearings: &[Floats; 3]) -> [Floats; 6] {
    let ([i, j, k], mut by_turn) = (by_bearings, [ZEROS; 3]);
    for edge in 0..GROUP {
        by_turn[0][edge] = y[edge] * k[edge] - z[edge] * j[edge];
        by_turn[1][edge] = z[edge] * i[edge] - x[edge] * k[edge];
        by_turn[2][edge] = x[edge] * j[edge] - y[edge] * i[edge];
    }
    let [a, b, c] = by_turn;
    [a, b, c, *i, *j, *k]
}
