//! Constrained Delaunay triangulation of scaled points: the calls into spade, each behind a guard.
//!
//! Points are scaled by a power of two, hence exactly, so that the largest coordinate lies in [1, 2): spade refuses
//! coordinates below 2^-142 other than zero.

use std::any::Any;
use std::collections::VecDeque;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use nalgebra::Vector2;
use spade::handles::{FixedFaceHandle, InnerTag};
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

use super::{EDGES_OF_TRIANGLE, PlaneMesh};
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::geometry::rings::PlaneRings;

/// Relative difference allowed between the areas of a mesh and of its region; rounding stays far below it, while a
/// triangle lost or gained in a mesh of [`MOST_TRIANGLES`](super::MOST_TRIANGLES) does not.
const AREA_TOLERANCE: f64 = 1e-9;

/// Rounding of a new vertex, in units of the largest coordinate: it moves the boundary, hence the area, by this much.
const VERTEX_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// One vertex in so many polls the budget, for all of them, as spade asks for its position: polls by each would take a tenth of the time
/// (measured, `kernels.alpha_shape` of 50,000 points).
const POLLING: usize = 64;

/// Payload of the unwinding out of spade, its only early end, once the work is canceled.
struct Unwound;

/// Work with triangulations: an error once they are canceled.
pub(super) fn interruptible<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    // What was half done is dropped.
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|held: Box<dyn Any + Send>| match held.is::<Unwound>() {
        true => Err(Error::Canceled),
        false => resume_unwind(held),
    })
}

/// The triangulation with constraint edges.
pub(super) type Cdt<'a> = ConstrainedDelaunayTriangulation<Vertex<'a>>;

impl PlaneMesh {
    /// The mesh itself if it covers just the area of `region`.
    pub(super) fn covering(self, region: &PlaneRings) -> Result<Self> {
        let (found, needed) = (self.area(), region.area());
        let (lower, upper) = region.bounds();
        let perimeter: f64 = region.edges().map(|(a, b)| (b - a).norm()).sum();
        let rounding = VERTEX_ROUNDING * lower.amax().max(upper.amax()) * perimeter;
        if (found - needed).abs() <= AREA_TOLERANCE * needed + rounding {
            Ok(self)
        } else {
            Err(Error::MeshArea { found, needed })
        }
    }
}

/// A vertex that spade accepts: never a coordinate that is tiny but not zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct Vertex<'a> {
    place: Point2<f64>,
    /// Of one in [`POLLING`], and of none that refinement adds: all of these take less than a second (`MOST_TRIANGLES`).
    budget: Option<&'a Budget>,
}

impl HasPosition for Vertex<'_> {
    type Scalar = f64;

    /// Unwinds once the work is canceled, without calling the panic hook.
    fn position(&self) -> Point2<f64> {
        if let Some(budget) = self.budget {
            // Spade asks for some hundred positions of each vertex, in about the time of so many edges.
            budget.poll(POLLING);
            if budget.is_canceled() {
                resume_unwind(Box::new(Unwound));
            }
        }
        self.place
    }
}

impl From<Point2<f64>> for Vertex<'_> {
    fn from(point: Point2<f64>) -> Self {
        let without_tiny = |x: f64| if x.abs() < spade::MIN_ALLOWED_VALUE { 0.0 } else { x };
        Self { place: Point2::new(without_tiny(point.x), without_tiny(point.y)), budget: None }
    }
}

/// A power of two that brings `largest` into [1, 2).
pub(super) fn scale_for(largest: f64) -> f64 {
    if largest > 0.0 { (-largest.log2().floor()).exp2() } else { 1.0 }
}

/// Triangulation of distinct scaled points; vertex k is point k. An error where the work is canceled.
pub(super) fn constrained<'a>(points: &[Vector2<f64>], edges: &[[usize; 2]], budget: &'a Budget) -> Result<Cdt<'a>> {
    if budget.is_canceled() {
        return Err(Error::Canceled);
    }
    budget.charge(EDGES_OF_TRIANGLE * points.len());
    let vertex = |(number, p): (usize, &Vector2<f64>)| {
        let budget = number.is_multiple_of(POLLING).then_some(budget);
        Vertex { budget, ..Vertex::from(Point2::new(p.x, p.y)) }
    };
    let vertices = points.iter().enumerate().map(vertex).collect();
    let mut refused = None;
    let cdt = Cdt::try_bulk_load_cdt(vertices, edges.to_vec(), |edge| refused = Some(edge))
        .map_err(|error| Error::Triangulation { reason: error.to_string() })?;
    if let Some([a, b]) = refused {
        return Err(Error::Triangulation { reason: format!("the edge from vertex {a} to {b} crosses another") });
    }
    if cdt.num_vertices() != points.len() {
        let reason = format!("{} of {} vertices are left", cdt.num_vertices(), points.len());
        return Err(Error::Triangulation { reason });
    }
    Ok(cdt)
}

/// For each face whether it lies inside the rings: reached from outside across an odd number of constraint edges.
///
/// Indexed by the index of the face, 0 being the outer one.
pub(super) fn inside_faces(cdt: &Cdt<'_>) -> Vec<bool> {
    let mut inside: Vec<Option<bool>> = vec![None; cdt.num_all_faces()];
    inside[0] = Some(false);
    let mut queue: VecDeque<(FixedFaceHandle<InnerTag>, bool)> = VecDeque::new();
    for edge in cdt.convex_hull() {
        let within = edge.rev();
        queue.extend(within.face().as_inner().map(|face| (face.fix(), within.is_constraint_edge())));
    }
    while let Some((face, is_inside)) = queue.pop_front() {
        if inside[face.index()].replace(is_inside).is_some() {
            continue;
        }
        for edge in cdt.face(face).adjacent_edges() {
            let beyond = edge.rev().face().as_inner().filter(|next| inside[next.fix().index()].is_none());
            queue.extend(beyond.map(|next| (next.fix(), is_inside ^ edge.is_constraint_edge())));
        }
    }
    inside.into_iter().map(|flag| flag.unwrap_or(false)).collect()
}

/// Centroids of the faces marked in `inside` with an area above `largest`.
pub(super) fn middles_above<'a>(cdt: &Cdt<'a>, inside: &[bool], largest: f64) -> Vec<Vertex<'a>> {
    let large = cdt.inner_faces().filter(|face| inside[face.fix().index()] && face.area() > largest);
    large.map(|face| Vertex::from(face.center())).collect()
}

/// Inserts further vertices.
pub(super) fn insert<'a>(cdt: &mut Cdt<'a>, vertices: Vec<Vertex<'a>>) -> Result<()> {
    for vertex in vertices {
        cdt.insert(vertex).map_err(|error| Error::Triangulation { reason: error.to_string() })?;
    }
    Ok(())
}

/// Vertex indices of the faces marked in `kept`, counter-clockwise, the smallest first; sorted.
pub(super) fn triangles(cdt: &Cdt<'_>, kept: &[bool]) -> Vec<[usize; 3]> {
    let inner = cdt.inner_faces().filter(|face| kept[face.fix().index()]);
    let mut triangles: Vec<_> = inner.map(|face| smallest_first(face.vertices().map(|v| v.index()))).collect();
    triangles.sort_unstable();
    triangles
}

fn smallest_first([a, b, c]: [usize; 3]) -> [usize; 3] {
    if a < b && a < c {
        [a, b, c]
    } else if b < c {
        [b, c, a]
    } else {
        [c, a, b]
    }
}

/// The faces inside the rings, scaled back; the first `fixed` vertices are kept, of the others those in use.
pub(super) fn inside_mesh(cdt: &Cdt<'_>, scale: f64, fixed: usize) -> PlaneMesh {
    let mut triangles = triangles(cdt, &inside_faces(cdt));
    let mut used = vec![false; cdt.num_vertices()];
    used[..fixed].fill(true);
    triangles.iter().flatten().for_each(|&k| used[k] = true);
    let mut place = vec![0; used.len()];
    let mut vertices = Vec::new();
    for (k, vertex) in cdt.vertices().enumerate().filter(|&(k, _)| used[k]) {
        place[k] = vertices.len();
        let position = vertex.position();
        vertices.push(Vector2::new(position.x, position.y) / scale);
    }
    triangles.iter_mut().flatten().for_each(|k| *k = place[*k]);
    PlaneMesh { vertices, triangles }
}
