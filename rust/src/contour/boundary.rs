//! The boundary of a world region, projected into a chart by a pose: transformed a few vertices at a time.

use std::ops::{Index, Range};

use nalgebra::{Rotation3, Vector2, Vector3};

use super::pieces::edges;
use crate::budget::Budget;
use crate::geometry::edge_field::{GROUP, ROUNDING};
use crate::geometry::pose::Pose;
use crate::geometry::rings::bounding_box;
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};
use crate::view::border::{edge_before, near_plane};

/// Where on the plane z = 1 of the chart's axes an edge behind the camera is put: beyond every piece. A convention.
const FAR: f64 = 1e9;

/// Rings of the world about a problem's origin.
#[derive(Debug, Clone)]
pub(super) struct Boundary {
    /// The vertices of all rings, a few at a time; past the last one it comes again.
    groups: Vec<[Lanes; 3]>,
    /// The vertices of each ring, by number.
    pub(super) rings: Vec<Range<usize>>,
    /// The vertex after each, and that before.
    next: Vec<u32>,
    previous: Vec<u32>,
}

impl Boundary {
    pub(super) fn new(rings: &[Vec<Vector3<f64>>], origin: &Vector3<f64>) -> Self {
        let vertices: Vec<Vector3<f64>> = rings.iter().flatten().map(|x| x - origin).collect();
        let group = |group: &[Vector3<f64>]| {
            let at = |axis: usize| std::array::from_fn(|k| group[k.min(group.len() - 1)][axis]);
            [0, 1, 2].map(|axis| Lanes(at(axis)))
        };
        let ends = rings.iter().scan(0, |end, ring| {
            *end += ring.len();
            Some(*end - ring.len()..*end)
        });
        let rings: Vec<Range<usize>> = ends.collect();
        let following = |ring: &Range<usize>| (ring.start + 1..ring.end).chain([ring.start]).map(|k| k as u32);
        let preceding =
            |ring: &Range<usize>| [ring.end - 1].into_iter().chain(ring.start..ring.end - 1).map(|k| k as u32);
        let (next, previous) = (rings.iter().flat_map(following).collect(), rings.iter().flat_map(preceding).collect());
        Self { groups: vertices.chunks(LANES).map(group).collect(), next, previous, rings }
    }

    /// The number of vertices, and of edges.
    pub(super) fn count(&self) -> usize {
        self.next.len()
    }

    /// The edge that begins where one ends.
    pub(super) fn after(&self, edge: usize) -> usize {
        self.next[edge] as usize
    }

    /// The edge that ends where one begins.
    pub(super) fn before(&self, edge: usize) -> usize {
        self.previous[edge] as usize
    }

    /// Depth of each vertex along a chart's axis at a pose, `rotation` being `chart_from_camera`.
    pub(super) fn depths(&self, rotation: &Rotation3<f64>, pose: &Pose) -> Vec<f64> {
        let row = rotation.matrix().row(2);
        let (turned, offset) = (row * pose.rotation.matrix(), (row * pose.translation).x);
        let mut depths = vectorized(Depths(&self.groups, [turned[0], turned[1], turned[2], offset]));
        depths.truncate(self.next.len());
        depths
    }

    /// The vertices along a chart's axes and on its plane z = 1.
    pub(super) fn projected(&self, chart_from_world: &Pose) -> ProjectedBoundary<'_> {
        let mut vertices = vectorized(Projected(&self.groups, chart_from_world));
        vertices.truncate(self.next.len());
        ProjectedBoundary { boundary: self, vertices }
    }
}

/// Products of points and a row.
struct Depths<'a>(&'a [[Lanes; 3]], [f64; 4]);

impl NullaryFnOnce for Depths<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        let [a, b, c, d] = self.1.map(Lanes::splat);
        let mut depths = vec![0.0; LANES * self.0.len()];
        for (depths, &[x, y, z]) in depths.as_chunks_mut().0.iter_mut().zip(self.0) {
            *depths = (a * x + b * y + c * z + d).0;
        }
        depths
    }
}

/// Points along a chart's axes, and where they are seen on its plane z = 1.
struct Projected<'a>(&'a [[Lanes; 3]], &'a Pose);

impl NullaryFnOnce for Projected<'_> {
    type Output = Vec<Vertex>;

    #[inline(always)]
    fn call(self) -> Vec<Vertex> {
        let (rotation, translation) = (self.1.rotation.matrix(), &self.1.translation);
        let row = |k: usize| {
            let entry = |column: usize| Lanes::splat(rotation[(k, column)]);
            (entry(0), entry(1), entry(2), Lanes::splat(translation[k]))
        };
        let rows = (row(0), row(1), row(2));
        let mut vertices = vec![Vertex::default(); LANES * self.0.len()];
        for (chart_vertex, &[x, y, z]) in vertices.as_chunks_mut().0.iter_mut().zip(self.0) {
            let along = |(a, b, c, d): (Lanes, Lanes, Lanes, Lanes)| a * x + b * y + c * z + d;
            let (px, py, pz) = (along(rows.0), along(rows.1), along(rows.2));
            let (u, v) = (px / pz, py / pz);
            let vertex = |k: usize| Vertex { at: [px.0[k], py.0[k], pz.0[k]], flat: [u.0[k], v.0[k]] };
            *chart_vertex = [vertex(0), vertex(1), vertex(2), vertex(3)];
        }
        vertices
    }
}

/// A vertex along a chart's axes, and on the plane z = 1.
#[derive(Clone, Copy, Default)]
struct Vertex {
    at: [f64; 3],
    flat: [f64; 2],
}

/// A boundary's vertices as a chart sees them.
pub(super) struct ProjectedBoundary<'a> {
    boundary: &'a Boundary,
    vertices: Vec<Vertex>,
}

impl ProjectedBoundary<'_> {
    /// The number of vertices, and of edges.
    pub(super) fn count(&self) -> usize {
        self.boundary.count()
    }

    /// Whether all vertices lie before the camera.
    pub(super) fn is_before_camera(&self) -> bool {
        self.vertices.iter().all(|vertex| vertex.at[2] > 0.0)
    }

    /// The edge from a vertex to the next.
    pub(super) fn edge(&self, vertex: usize) -> Edge {
        let (from, to) = (&self.vertices[vertex], &self.vertices[self.boundary.next[vertex] as usize]);
        Edge::new([from.at.into(), to.at.into()], [from.flat.into(), to.flat.into()])
    }

    /// All edges.
    pub(super) fn edges(&self) -> impl Iterator<Item = Edge> + '_ {
        (0..self.boundary.next.len()).map(|vertex| self.edge(vertex))
    }

    /// The part of each edge before the camera; `None` where nothing of a ring is.
    pub(super) fn edges_before(&self) -> Option<Vec<Edge>> {
        let mut all = Vec::with_capacity(self.boundary.next.len());
        for ring in &self.boundary.rings {
            let moved: Vec<Vector3<f64>> = self.vertices[ring.clone()].iter().map(|vertex| vertex.at.into()).collect();
            if moved.iter().all(|x| x.z > 0.0) {
                all.extend(edges(&moved).map(|(from, to)| Edge::before([from, to])));
            } else if moved.iter().any(|x| x.z > 0.0) {
                let near = near_plane(&moved);
                let ends = edges(&moved).map(|(from, to)| edge_before(near, &from, &to));
                all.extend(ends.map(|ends| ends.map_or_else(Edge::hidden, Edge::before)));
            } else {
                return None;
            }
        }
        Some(all)
    }
}

/// An edge of the projected boundary: its ends along the chart's axes, and on the plane z = 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    pub(super) from: Vector3<f64>,
    pub(super) to: Vector3<f64>,
    start: Vector2<f64>,
    step: Vector2<f64>,
    inverse: f64,
}

/// Edges, and a box around every [`GROUP`] of them.
pub(super) struct Edges {
    all: Vec<Edge>,
    boxes: Vec<EdgeBox>,
}

impl Edges {
    pub(super) fn new(all: Vec<Edge>) -> Self {
        Self { boxes: all.chunks(GROUP).map(EdgeBox::of).collect(), all }
    }

    /// The first of the edges nearest to a point; a box farther than one that was found holds none. Charges the edges it evaluates.
    pub(super) fn nearest(&self, point: &Vector2<f64>, budget: &Budget) -> usize {
        let (mut best, mut evaluated) = ((f64::INFINITY, 0), self.boxes.len());
        for (group, (edges, around)) in self.all.chunks(GROUP).zip(&self.boxes).enumerate() {
            if around.square(point) > best.0 {
                continue;
            }
            evaluated += edges.len();
            for (place, edge) in edges.iter().enumerate() {
                let square = edge.offset(point).1.norm_squared();
                best = if square < best.0 { (square, group * GROUP + place) } else { best };
            }
        }
        budget.charge(evaluated);
        best.1
    }
}

impl Index<usize> for Edges {
    type Output = Edge;

    fn index(&self, edge: usize) -> &Edge {
        &self.all[edge]
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

/// The place on an edge nearest to a point.
pub(super) struct Foot {
    /// Where on the edge, 0 to 1.
    pub(super) share: f64,
    /// Unit direction in which the distance grows.
    pub(super) normal: Vector2<f64>,
}

impl Edge {
    /// An edge behind the camera: far from every piece.
    fn hidden() -> Self {
        Self::before([Vector3::new(FAR, FAR, 1.0); 2])
    }

    /// The edge between two points before the camera.
    fn before(ends: [Vector3<f64>; 2]) -> Self {
        Self::new(ends, ends.map(|end| end.xy() / end.z))
    }

    /// The edge by its ends along the chart's axes and on the plane z = 1.
    fn new([from, to]: [Vector3<f64>; 2], [start, end]: [Vector2<f64>; 2]) -> Self {
        let step = end - start;
        Self { from, to, start, step, inverse: 1.0 / step.norm_squared().max(f64::MIN_POSITIVE) }
    }

    /// Where on the edge, 0 to 1, it is nearest to a point, and the way from there to the point.
    pub(super) fn offset(&self, point: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let offset = point - self.start;
        let share = (offset.dot(&self.step) * self.inverse).clamp(0.0, 1.0);
        (share, offset - self.step * share)
    }

    /// The place nearest to a point, and the point's signed distance.
    pub(super) fn foot(&self, point: &Vector2<f64>) -> (Foot, f64) {
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
