//! How far the pieces of observed contours lie from the projected boundaries, and how a pose moves these (`docs/math.md`,
//! section 11).

use std::sync::{Arc, OnceLock};

use nalgebra::{Rotation3, Vector2, Vector3, Vector6};

use super::pieces::{self, Piece, edges, pieces};
use crate::effort;
use crate::equations::residual::{NormalEquations, RegionEquations};
use crate::geometry::edge_field::EdgeField;
use crate::geometry::pose::Pose;
use crate::geometry::rings::{PlaneRings, bounding_box};
use crate::region::{PlaneFrame, WorldRegion};
use crate::view::border::{edge_before, near_plane};

/// Squared tangent of the angle to the boundary (30 degrees) beyond which a piece runs across it, as the side of a bite does
/// where that crosses the outline; and what its spread across counts beside its squared distance.
const ALIGNED: f64 = 3.0;
const CROSSING: f64 = 4.0;

/// Sine of the angle between a plane and the ray to it (9 degrees) below which the nearest edge on the plane need not be the
/// nearest in the image: lengths differ by more than six times there.
const OBLIQUE: f64 = 0.15;

/// Where on the plane z = 1 of the chart's axes an edge behind the camera is put.
const FAR: f64 = 1e9;

/// Consecutive edges of a projected boundary that a box is put around, and groups that a piece looks at beside all boxes.
const GROUP: usize = 16;
const GROUPS_LOOKED_AT: usize = 3;

/// Room around a box, as a share of its coordinates: more than distances are rounded by, less than tells edges apart.
const ROUNDING: f64 = 1e-9;

/// Pieces of all contours that a first look takes, and of each at least.
const SKETCHED: usize = 120;
const FEWEST_SKETCHED: usize = 40;

/// The observed contour of one region and the boundary of its world region.
#[derive(Debug, Clone)]
pub struct Contour {
    /// `chart_from_camera`.
    rotation: Rotation3<f64>,
    /// The observed outline in the chart, and which of its edges are not the region's own.
    outline: PlaneRings,
    foreign: Vec<Vec<bool>>,
    /// Chart units to the unit of the plane z = 1 of the chart's axes.
    scale: f64,
    /// All pieces of the outline, on that plane, once they are asked for.
    pieces: OnceLock<Vec<Piece>>,
    /// One piece in `few` of them.
    sketch: Vec<Piece>,
    few: usize,
    /// Pixels per unit of that plane.
    pixels: f64,
    /// Side, in pixels, of a square of the region's area.
    size: f64,
    /// Boundary rings of the world region about the problem's origin.
    rings: Vec<Vec<Vector3<f64>>>,
    /// The plane that holds the rings, about the problem's origin, and their edges there; `None` for a surface.
    plane: Option<(PlaneFrame, Arc<OnceLock<EdgeField>>)>,
    /// Whether the image's border cuts the region, so that a part of its boundary may be behind the camera.
    cut: bool,
}

/// What a piece of a contour shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Signed distance of its mean from the projected boundary, pixels.
    pub distance: f64,
    /// Mean square of its points about their mean across the boundary, squared pixels.
    pub spread: f64,
    /// How far off it counts: as far as its mean, farther where it runs across the boundary, pixels.
    pub misfit: f64,
    /// The edge of the boundary that it is nearest to, counted over all rings.
    pub edge: u32,
}

impl Contour {
    /// The contours of observed regions, without what is not their own, and the boundaries of their world regions about
    /// `origin`.
    pub fn all(regions: &[RegionEquations], worlds: &[WorldRegion], origin: &Vector3<f64>) -> Vec<Self> {
        let wanted = (SKETCHED / regions.len()).max(FEWEST_SKETCHED);
        let count = |region: &RegionEquations| pieces::count(region.outline(), region.pixel_area().sqrt());
        let few = regions.iter().map(|region| count(region).div_ceil(wanted)).max().unwrap_or(1).max(1);
        regions.iter().zip(worlds).map(|(region, world)| Self::new(region, world, origin, few)).collect()
    }

    fn new(region: &RegionEquations, world: &WorldRegion, origin: &Vector3<f64>, few: usize) -> Self {
        let scale = region.chart().scale;
        let pixels = region.pixel_area().sqrt();
        let frame = world.frame();
        let plane = PlaneFrame { origin: frame.origin - origin, axes: frame.axes };
        Self {
            rotation: region.chart().rotation,
            sketch: scaled(pieces(region.outline(), region.foreign_edges(), pixels, few), scale),
            few,
            pieces: OnceLock::new(),
            outline: region.outline().clone(),
            foreign: region.foreign_edges().to_vec(),
            scale,
            pixels: pixels * scale,
            size: pixels,
            rings: world.rings().into_iter().map(|ring| ring.into_iter().map(|x| x - origin).collect()).collect(),
            plane: world.surface().is_none().then(|| (plane, world.edge_field())),
            cut: region.border().is_some(),
        }
    }

    /// One piece in so many of all contours of a problem is what a first look takes.
    pub fn few(&self) -> usize {
        self.few
    }

    /// Side, in pixels, of a square of the region's area.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// Number of pieces of which every `step`-th is read.
    pub fn count(&self, step: usize) -> usize {
        self.pieces(step).len()
    }

    /// The straight run of the contour that each piece wholly lies on, by number.
    pub fn runs(&self) -> impl Iterator<Item = Option<usize>> + '_ {
        self.pieces(1).map(|piece| piece.run)
    }

    /// Every `step`-th piece.
    fn pieces(&self, step: usize) -> impl ExactSizeIterator<Item = &Piece> {
        if step == self.few {
            return self.sketch.iter().step_by(1);
        }
        let all = self.pieces.get_or_init(|| scaled(pieces(&self.outline, &self.foreign, self.size, 1), self.scale));
        all.iter().step_by(step)
    }

    /// Adds the readings of every `step`-th piece at a pose about the problem's origin; `None` where the region is out of view.
    pub fn read(&self, pose: &Pose, step: usize, into: &mut Vec<Reading>) -> Option<()> {
        let view = self.view(pose)?;
        self.count_work(&view, step);
        into.extend(self.pieces(step).map(|piece| self.reading(&view, piece).0));
        Some(())
    }

    /// The same with the derivatives of each distance by the left increment.
    pub fn read_rows(&self, pose: &Pose, into: &mut Vec<(Reading, Vector6<f64>)>) -> Option<()> {
        let view = self.view(pose)?;
        self.count_work(&view, 1);
        let back = self.rotation.inverse();
        into.extend(self.pieces(1).map(|piece| {
            let (reading, foot) = self.reading(&view, piece);
            let row = self.derivative(&view, reading.edge, &foot);
            let [turning, moving] = [0, 3].map(|first| back * row.fixed_rows::<3>(first));
            (reading, Vector6::new(turning.x, turning.y, turning.z, moving.x, moving.y, moving.z))
        }));
        Some(())
    }

    /// Adds the normal equations of every `step`-th piece, each with the weight of its reading against the edge that it was
    /// nearest to in `before`, the readings of the same pieces at a pose close by.
    pub fn add_normal_equations(
        &self,
        pose: &Pose,
        step: usize,
        before: &[Reading],
        weight: impl Fn(&Reading) -> f64,
        into: &mut NormalEquations,
    ) -> Option<()> {
        let view = self.view(pose)?;
        effort::spend(view.edges.len() + self.count(step));
        let mut sums = NormalEquations::default();
        for (piece, before) in self.pieces(step).zip(before) {
            let (reading, foot) = self.reading_from(&view, piece, before.edge);
            let weight = weight(&reading);
            let row = self.derivative(&view, reading.edge, &foot);
            let weighted = row * weight;
            for column in 0..6 {
                for entry in 0..6 {
                    sums.information[(entry, column)] += weighted[entry] * row[column];
                }
            }
            sums.gradient += weighted * reading.distance;
            sums.cost += weight * reading.distance * reading.distance;
        }
        *into += sums.turned(&self.rotation);
        Some(())
    }

    /// Counts the edges that readings look at: where the plane doesn't tell the nearest, boxes and some groups for each piece.
    fn count_work(&self, view: &View, step: usize) {
        let each =
            if view.sight.is_some() { 1 } else { view.edges.len().min(view.boxes.len() + GROUPS_LOOKED_AT * GROUP) };
        effort::spend(view.edges.len() + self.count(step) * each);
    }

    /// Whether the projected boundary is in view at a pose.
    pub fn is_in_view(&self, pose: &Pose) -> bool {
        let depths = self.rotation.matrix().row(2) * pose.rotation.matrix();
        let offset = (self.rotation.matrix().row(2) * pose.translation).x;
        let before = |ring: &Vec<Vector3<f64>>| {
            let is_before = |x: &Vector3<f64>| (depths * x).x + offset > 0.0;
            if self.cut { ring.iter().any(is_before) } else { ring.iter().all(is_before) }
        };
        self.rings.iter().all(before)
    }

    /// The projected boundary at a pose; `None` where it isn't wholly before the chart's plane, or for a region that the image's
    /// border cuts not at all.
    fn view(&self, pose: &Pose) -> Option<View> {
        let chart_from_world = Pose::new(self.rotation * pose.rotation, self.rotation * pose.translation);
        let mut projected = Vec::with_capacity(self.rings.iter().map(Vec::len).sum());
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
        }
        let sight = self.plane.as_ref().map(|(plane, _)| Sight::new(plane, &chart_from_world));
        let sight = sight.filter(|sight| sight.slant > OBLIQUE);
        Some(View { boxes: projected.chunks(GROUP).map(EdgeBox::of).collect(), edges: projected, sight })
    }

    /// The edge of the boundary nearest to a point of the chart's plane z = 1: where the point's ray meets the region's plane,
    /// the edge that is nearest there.
    fn nearest(&self, view: &View, point: &Vector2<f64>) -> usize {
        let place = view.sight.as_ref().and_then(|sight| sight.place(point));
        let field = self.plane.as_ref().and_then(|(_, field)| field.get());
        if let (Some(field), Some(place)) = (field, place) {
            return field.nearest_edge(&place);
        }
        view.nearest(point)
    }

    fn reading(&self, view: &View, piece: &Piece) -> (Reading, Foot) {
        self.reading_from(view, piece, self.nearest(view, &piece.mean) as u32)
    }

    fn reading_from(&self, view: &View, piece: &Piece, index: u32) -> (Reading, Foot) {
        let (foot, value) = view.edges[index as usize].foot(&piece.mean);
        let (distance, spread) = (self.pixels * value, foot.normal.dot(&(piece.spread * foot.normal)));
        let crossing = CROSSING * (spread - (piece.spread.trace() - spread) / ALIGNED).max(0.0);
        let squared = self.pixels * self.pixels;
        let misfit = (distance * distance + squared * crossing).sqrt();
        (Reading { distance, spread: squared * spread, misfit, edge: index }, foot)
    }

    /// Derivatives of a distance along the chart's axes (`docs/math.md`, eq. 11.3).
    fn derivative(&self, view: &View, edge: u32, foot: &Foot) -> Vector6<f64> {
        let edge = &view.edges[edge as usize];
        // The point of the edge in space that is seen at the foot.
        let weight = foot.share * edge.from.z / (foot.share * edge.from.z + (1.0 - foot.share) * edge.to.z);
        let seen = edge.from.lerp(&edge.to, weight);
        let n = foot.normal * (self.pixels / seen.z);
        let moving = Vector3::new(-n.x, -n.y, (n.x * seen.x + n.y * seen.y) / seen.z);
        let turning = seen.cross(&moving);
        Vector6::new(turning.x, turning.y, turning.z, moving.x, moving.y, moving.z)
    }
}

/// Pieces of a chart on the plane z = 1 of its axes.
fn scaled(pieces: Vec<Piece>, scale: f64) -> Vec<Piece> {
    pieces.into_iter().map(|piece| piece.scaled(scale)).collect()
}

/// A projected boundary.
struct View {
    edges: Vec<Edge>,
    /// Around every [`GROUP`] of them.
    boxes: Vec<EdgeBox>,
    sight: Option<Sight>,
}

impl View {
    /// The first of the edges nearest to a point; a box farther than one that was found holds none.
    fn nearest(&self, point: &Vector2<f64>) -> usize {
        let mut best = (f64::INFINITY, 0);
        for (group, (edges, around)) in self.edges.chunks(GROUP).zip(&self.boxes).enumerate() {
            if around.square(point) > best.0 {
                continue;
            }
            for (place, edge) in edges.iter().enumerate() {
                let square = edge.offset(point).1.norm_squared();
                best = if square < best.0 { (square, group * GROUP + place) } else { best };
            }
        }
        best.1
    }
}

/// A box around some edges, with room for what distances are rounded by.
struct EdgeBox {
    low: Vector2<f64>,
    high: Vector2<f64>,
}

impl EdgeBox {
    fn of(edges: &[Edge]) -> Self {
        let (low, high) = bounding_box(edges.iter().flat_map(|edge| [edge.start, edge.start + edge.step]));
        let room = Vector2::repeat(ROUNDING * low.amax().max(high.amax()));
        Self { low: low - room, high: high + room }
    }

    /// Squared distance of a point: no edge within is nearer.
    fn square(&self, point: &Vector2<f64>) -> f64 {
        let outside = |axis: usize| (self.low[axis] - point[axis]).max(point[axis] - self.high[axis]).max(0.0);
        outside(0).powi(2) + outside(1).powi(2)
    }
}

/// A plane as the chart sees it: `place = (numerators . (x, y, 1)) / (normal . (x, y, 1))`.
struct Sight {
    normal: Vector3<f64>,
    numerators: [Vector3<f64>; 2],
    /// Sine of the angle between the plane and the ray to its origin.
    slant: f64,
}

impl Sight {
    fn new(plane: &PlaneFrame, chart_from_world: &Pose) -> Self {
        let [u, v, normal] = plane.axes.map(|axis| chart_from_world.rotation * axis);
        let origin = chart_from_world.transform(&plane.origin);
        let offset = normal.dot(&origin);
        // The ray meets the plane at the depth offset / (normal . ray); only before the camera that has the offset's sign.
        let side = offset.signum();
        let numerators = [u, v].map(|axis| (axis * offset - normal * axis.dot(&origin)) * side);
        Self { normal: normal * side, numerators, slant: offset.abs() / origin.norm() }
    }

    /// Coordinates in the plane of the point that is seen at a point of the chart's plane z = 1; `None` beyond its horizon.
    fn place(&self, point: &Vector2<f64>) -> Option<Vector2<f64>> {
        let ray = Vector3::new(point.x, point.y, 1.0);
        let depth = self.normal.dot(&ray);
        let [x, y] = &self.numerators;
        (depth > 0.0).then(|| Vector2::new(x.dot(&ray), y.dot(&ray)) / depth)
    }
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

/// The place on an edge nearest to a point.
struct Foot {
    /// Where on the edge, 0 to 1.
    share: f64,
    /// Unit direction in which the distance grows.
    normal: Vector2<f64>,
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

    /// Where on the edge, 0 to 1, it is nearest to a point, and the way from there to the point.
    fn offset(&self, point: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let offset = point - self.start;
        let share = (offset.dot(&self.step) * self.inverse).clamp(0.0, 1.0);
        (share, offset - self.step * share)
    }

    /// The place nearest to a point, and the point's signed distance.
    fn foot(&self, point: &Vector2<f64>) -> (Foot, f64) {
        let (share, offset) = self.offset(point);
        // Beyond an end the distance is that from the vertex, and its direction the offset's own.
        let length = if share > 0.0 && share < 1.0 { 0.0 } else { offset.norm() };
        if length > 0.0 {
            return (Foot { share, normal: offset / length }, length);
        }
        let normal = Vector2::new(self.step.y, -self.step.x) * self.inverse.sqrt();
        (Foot { share, normal }, offset.dot(&normal))
    }
}
