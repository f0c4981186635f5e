//! Outline of a point set: the alpha shape (Edelsbrunner, Kirkpatrick and Seidel 1983).

use nalgebra::Vector2;
use spade::Triangulation;

use super::delaunay::{self, Cdt};
use super::distinct::distinct_scaled;
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::geometry::rings::predicates::by_x_then_y;
use crate::geometry::rings::{PlaneRings, is_flat, signed_area};

/// Boundary of the union of all Delaunay triangles whose circumradius is at most `radius`, in the points' unit.
///
/// Several parts and holes are possible; where parts meet at one point the rings touch there. An infinite radius gives
/// the convex hull. Rings come by decreasing size, each from its leftmost vertex on. Repeated points count once.
///
/// # Errors
/// A coordinate that is not finite or out of range; fewer than 3 distinct points; all points on one line; a radius
/// that is not positive; a radius that keeps no triangle (the message has the smallest that keeps one).
pub fn alpha_shape(points: &[Vector2<f64>], radius: f64) -> Result<PlaneRings> {
    alpha_shape_within(points, radius, &Budget::unlimited())
}

/// The same within a budget; an error, too, where that is canceled.
#[doc(hidden)]
pub fn alpha_shape_within(points: &[Vector2<f64>], radius: f64, budget: &Budget) -> Result<PlaneRings> {
    delaunay::interruptible(|| shape_of(points, radius, budget))
}

fn shape_of(points: &[Vector2<f64>], radius: f64, budget: &Budget) -> Result<PlaneRings> {
    if radius.is_nan() || radius <= 0.0 {
        let needed = "positive, or infinite for the convex hull".to_owned();
        return Err(Error::InvalidOption { item: "radius", found: radius.to_string(), needed });
    }
    let (points, scale) = distinct_scaled(points)?;
    if points.len() < 3 {
        return Err(Error::TooFewPoints { found: points.len() });
    }
    let cdt = delaunay::constrained(&points, &[], budget)?;
    if cdt.num_inner_faces() == 0 {
        return Err(Error::CollinearPoints { found: points.len() });
    }
    let kept = kept_faces(&cdt, radius, scale)?;
    let mut rings: Vec<Vec<Vector2<f64>>> = Vec::new();
    for ring in BoundaryWalk::new(&cdt, &kept).rings() {
        let ring: Vec<_> = ring.into_iter().map(|vertex| points[vertex] / scale).collect();
        if !is_flat(&ring) {
            rings.push(from_leftmost(ring));
        }
    }
    if rings.is_empty() {
        return Err(Error::CollinearPoints { found: points.len() });
    }
    let size = |ring: &[Vector2<f64>]| signed_area(ring).abs();
    rings.sort_by(|a, b| size(b).total_cmp(&size(a)).then_with(|| by_x_then_y(&a[0], &b[0])));
    PlaneRings::new(rings)
}

/// For each face, by index, whether its circumradius is at most `radius`.
fn kept_faces(cdt: &Cdt<'_>, radius: f64, scale: f64) -> Result<Vec<bool>> {
    let mut kept = vec![false; cdt.num_all_faces()];
    let mut smallest = f64::INFINITY;
    for face in cdt.inner_faces() {
        let circumradius = circumradius(face.positions().map(|p| Vector2::new(p.x, p.y))) / scale;
        smallest = smallest.min(circumradius);
        kept[face.fix().index()] = circumradius <= radius;
    }
    if kept.contains(&true) { Ok(kept) } else { Err(Error::EmptyShape { radius, smallest }) }
}

/// Radius of the circle through three points: the product of the sides over four times the area.
fn circumradius([a, b, c]: [Vector2<f64>; 3]) -> f64 {
    let (ab, bc, ca) = (b - a, c - b, a - c);
    ab.norm() * bc.norm() * ca.norm() / (2.0 * ab.perp(&bc).abs())
}

fn from_leftmost(mut ring: Vec<Vector2<f64>>) -> Vec<Vector2<f64>> {
    let first = (0..ring.len()).min_by(|&a, &b| by_x_then_y(&ring[a], &ring[b])).unwrap_or(0);
    ring.rotate_left(first);
    ring
}

/// Walks along the edges that have a kept face on their left and none on their right.
struct BoundaryWalk<'a> {
    cdt: &'a Cdt<'a>,
    kept: &'a [bool],
    walked: Vec<bool>,
    /// Place of each vertex on the current path, if it is on it.
    place: Vec<Option<usize>>,
    rings: Vec<Vec<usize>>,
}

impl<'a> BoundaryWalk<'a> {
    fn new(cdt: &'a Cdt<'a>, kept: &'a [bool]) -> Self {
        let walked = vec![false; cdt.num_directed_edges()];
        Self { cdt, kept, walked, place: vec![None; cdt.num_vertices()], rings: Vec::new() }
    }

    /// All boundary rings as vertex indices, none passing through a vertex twice.
    fn rings(mut self) -> Vec<Vec<usize>> {
        let cdt = self.cdt;
        for edge in cdt.directed_edges() {
            if self.is_boundary(&edge) && !self.walked[edge.fix().index()] {
                self.walk(edge);
            }
        }
        self.rings
    }

    fn is_boundary(&self, edge: &DirectedEdge<'a>) -> bool {
        self.kept[edge.face().fix().index()] && !self.kept[edge.rev().face().fix().index()]
    }

    /// Follows one closed walk; each time it returns to a vertex of its path it cuts off the loop as a ring.
    fn walk(&mut self, start: DirectedEdge<'a>) {
        let mut path: Vec<usize> = Vec::new();
        let mut edge = start;
        loop {
            self.walked[edge.fix().index()] = true;
            self.step_onto(edge.from().index(), &mut path);
            edge = self.next_on_boundary(edge);
            if edge == start {
                break;
            }
        }
        self.step_onto(start.from().index(), &mut path);
        self.place[start.from().index()] = None;
    }

    fn step_onto(&mut self, vertex: usize, path: &mut Vec<usize>) {
        if let Some(place) = self.place[vertex] {
            let ring = path.split_off(place);
            ring.iter().for_each(|&passed| self.place[passed] = None);
            self.rings.push(ring);
        }
        self.place[vertex] = Some(path.len());
        path.push(vertex);
    }

    /// The boundary edge that leaves the end of `edge`, staying beside the same kept faces.
    fn next_on_boundary(&self, edge: DirectedEdge<'a>) -> DirectedEdge<'a> {
        let mut next = edge.next();
        while self.kept[next.rev().face().fix().index()] {
            next = next.rev().next();
        }
        next
    }
}

type DirectedEdge<'a> = spade::handles::DirectedEdgeHandle<'a, delaunay::Vertex<'a>, (), spade::CdtEdge<()>, ()>;
