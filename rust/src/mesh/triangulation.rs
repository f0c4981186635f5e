//! Triangulation of a region with holes, optionally refined.

use std::collections::HashMap;

use nalgebra::Vector2;
use spade::{AngleLimit, RefinementParameters, RefinementResult, Triangulation};

use super::delaunay::{self, Cdt};
use super::{EDGES_OF_TRIANGLE, MOST_TRIANGLES, PlaneMesh};
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::geometry::rings::PlaneRings;
use crate::geometry::rings::predicates::{by_x_then_y, lies_on};

/// Largest angle that may be asked for, in degrees: Delaunay refinement often does not end above it.
pub const LARGEST_MIN_ANGLE: f64 = 30.0;

/// Smallest angle that may be asked for, in degrees: less asks for nothing.
const SMALLEST_MIN_ANGLE: f64 = 1e-3;

/// New vertices allowed for each ring vertex, mostly for small angles of the rings.
const VERTICES_PER_RING_VERTEX: usize = 200;

/// New vertices allowed for each triangle of the largest area; an even mesh needs half a vertex, graded ones up to 3.
const VERTICES_PER_TRIANGLE: f64 = 8.0;

/// Rounds of refinement, all but the first for the rare face that spade skips.
const MOST_ROUNDS: usize = 16;

/// Triangles below this fraction of the extent squared are not split: their circumcenter is lost in rounding.
const SMALLEST_SPLIT_FRACTION: f64 = 1e-12;

/// The same in units of the spacing of numbers at the largest coordinate, squared.
const SMALLEST_SPLIT_SPACINGS: f64 = 256.0;

/// Options of refinement; the default does not refine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[must_use]
#[non_exhaustive]
pub struct MeshOptions {
    /// Largest area of a triangle, in the rings' unit squared.
    pub max_area: Option<f64>,
    /// Smallest angle of a triangle in degrees, up to [`LARGEST_MIN_ANGLE`]; sharper corners of the rings remain.
    pub min_angle: Option<f64>,
}

impl MeshOptions {
    /// The same with another largest area of a triangle, in the rings' unit squared; `None` is no limit.
    pub fn with_max_area(self, max_area: impl Into<Option<f64>>) -> Self {
        Self { max_area: max_area.into(), ..self }
    }

    /// The same with another smallest angle of a triangle in degrees; `None` is no limit.
    pub fn with_min_angle(self, min_angle: impl Into<Option<f64>>) -> Self {
        Self { min_angle: min_angle.into(), ..self }
    }

    fn check(&self, area: f64) -> Result<()> {
        let smallest = area / MOST_TRIANGLES as f64;
        if let Some(max_area) = self.max_area.filter(|&max_area| !(max_area >= smallest && max_area > 0.0)) {
            let needed = format!("at least {smallest:.3e}, 1 / {MOST_TRIANGLES} of the region's area");
            return Err(Error::InvalidOption { item: "max_area", found: max_area.to_string(), needed });
        }
        let angles = SMALLEST_MIN_ANGLE..=LARGEST_MIN_ANGLE;
        if let Some(min_angle) = self.min_angle.filter(|min_angle| !angles.contains(min_angle)) {
            let needed = format!("from {SMALLEST_MIN_ANGLE} to {LARGEST_MIN_ANGLE} degrees");
            return Err(Error::InvalidOption { item: "min_angle", found: min_angle.to_string(), needed });
        }
        Ok(())
    }

    fn most_vertices(&self, ring_vertices: usize, area: f64) -> usize {
        let triangles = self.max_area.map_or(0.0, |max_area| area / max_area);
        let most = 1000 + VERTICES_PER_RING_VERTEX * ring_vertices + (VERTICES_PER_TRIANGLE * triangles) as usize;
        most.min(MOST_TRIANGLES)
    }
}

/// Constrained Delaunay mesh of a region, covering exactly its area.
///
/// Without refinement the vertices are those of the rings, in order (a point where rings touch once); refinement
/// appends vertices, also on the edges. Equal input gives an equal mesh.
///
/// # Errors
/// An option out of range; a refinement that does not end within its budget of vertices ([`Error::MeshIncomplete`]); a
/// mesh that does not cover the region's area ([`Error::MeshArea`]).
pub fn triangulate(region: &PlaneRings, options: MeshOptions) -> Result<PlaneMesh> {
    triangulate_within(region, options, &Budget::unlimited())
}

/// The same within a budget; an error, too, where that is canceled.
#[doc(hidden)]
pub fn triangulate_within(region: &PlaneRings, options: MeshOptions, budget: &Budget) -> Result<PlaneMesh> {
    delaunay::interruptible(|| mesh_of(region, options, budget))
}

fn mesh_of(region: &PlaneRings, options: MeshOptions, budget: &Budget) -> Result<PlaneMesh> {
    options.check(region.area())?;
    let graph = RingGraph::new(region);
    let mut cdt = graph.triangulated(budget)?;
    if options != MeshOptions::default() && !refine(&mut cdt, &graph, region, options, true, budget)? {
        cdt = graph.triangulated(budget)?;
        refine(&mut cdt, &graph, region, options, false, budget)?;
    }
    delaunay::inside_mesh(&cdt, graph.scale, graph.points.len()).covering(region)
}

/// Refines the faces inside the rings; returns whether spade agreed on which ones those are.
///
/// Spade leaves a face alone whose circumcenter rounding puts just outside the rings: such a face gets a vertex in its
/// middle, then refinement goes on.
fn refine(
    cdt: &mut Cdt<'_>,
    graph: &RingGraph,
    region: &PlaneRings,
    options: MeshOptions,
    only_inside: bool,
    budget: &Budget,
) -> Result<bool> {
    let square = graph.scale * graph.scale;
    let most = options.most_vertices(graph.points.len(), region.area());
    let largest = options.max_area.map_or(f64::INFINITY, |max_area| max_area * square);
    let parameters = RefinementParameters::new()
        .exclude_outer_faces(only_inside)
        .with_angle_limit(AngleLimit::from_deg(options.min_angle.unwrap_or(0.0)))
        .with_min_required_area(smallest_split(region) * square)
        .with_max_additional_vertices(most)
        .with_max_allowed_area(largest);
    for _ in 0..MOST_ROUNDS {
        let before = cdt.num_vertices();
        let result = cdt.refine(parameters.clone());
        budget.charge(EDGES_OF_TRIANGLE * (cdt.num_vertices() - before));
        if budget.is_canceled() {
            return Err(Error::Canceled);
        }
        let inside = delaunay::inside_faces(cdt);
        if only_inside && !is_outside_of(&result, &inside) {
            return Ok(false);
        }
        if !result.refinement_complete {
            break;
        }
        let middles = delaunay::middles_above(cdt, &inside, largest);
        if middles.is_empty() {
            return Ok(true);
        }
        delaunay::insert(cdt, middles)?;
    }
    Err(Error::MeshIncomplete { vertices: cdt.num_vertices(), budget: most })
}

/// Whether spade left out just the faces that are not inside.
fn is_outside_of(result: &RefinementResult, inside: &[bool]) -> bool {
    let mut excluded: Vec<usize> = result.excluded_faces.iter().map(|face| face.index()).collect();
    excluded.sort_unstable();
    (1..inside.len()).filter(|&face| !inside[face]).eq(excluded)
}

fn smallest_split(region: &PlaneRings) -> f64 {
    let (lower, upper) = region.bounds();
    let spacings = SMALLEST_SPLIT_SPACINGS * f64::EPSILON * lower.amax().max(upper.amax());
    (SMALLEST_SPLIT_FRACTION * (upper - lower).amax().powi(2)).max(spacings * spacings)
}

/// The rings as distinct points, scaled, and edges between them.
pub(super) struct RingGraph {
    pub(super) points: Vec<Vector2<f64>>,
    pub(super) edges: Vec<[usize; 2]>,
    pub(super) scale: f64,
}

impl RingGraph {
    pub(super) fn new(region: &PlaneRings) -> Self {
        let (lower, upper) = region.bounds();
        let scale = delaunay::scale_for(lower.amax().max(upper.amax()));
        let mut graph = Self { points: Vec::new(), edges: Vec::new(), scale };
        let mut indices_by_point: HashMap<[u64; 2], usize> = HashMap::new();
        for ring in region.rings() {
            let indices: Vec<usize> =
                ring.iter().map(|&vertex| graph.index(vertex * scale, &mut indices_by_point)).collect();
            let next = indices.iter().cycle().skip(1);
            graph.edges.extend(indices.iter().zip(next).map(|(&a, &b)| [a, b]));
        }
        if region.rings().len() > 1 {
            graph.split_at_touching_vertices();
        }
        graph
    }

    /// Ends each edge at the vertices of other rings that lie on it.
    fn split_at_touching_vertices(&mut self) {
        let mut by_x: Vec<usize> = (0..self.points.len()).collect();
        by_x.sort_by(|&a, &b| by_x_then_y(&self.points[a], &self.points[b]));
        let mut edges = Vec::with_capacity(self.edges.len());
        for &[start, end] in &self.edges {
            let (a, b) = (self.points[start], self.points[end]);
            let first = by_x.partition_point(|&k| self.points[k].x < a.x.min(b.x));
            let within = by_x[first..].iter().copied().take_while(|&k| self.points[k].x <= a.x.max(b.x));
            let mut on_edge: Vec<usize> = within.filter(|&k| lies_on(self.points[k], [a, b])).collect();
            if by_x_then_y(&a, &b).is_gt() {
                on_edge.reverse();
            }
            edges.extend(on_edge.windows(2).map(|pair| [pair[0], pair[1]]));
        }
        self.edges = edges;
    }

    fn index(&mut self, point: Vector2<f64>, indices_by_point: &mut HashMap<[u64; 2], usize>) -> usize {
        *indices_by_point.entry([point.x.to_bits(), point.y.to_bits()]).or_insert_with(|| {
            self.points.push(point);
            self.points.len() - 1
        })
    }

    fn triangulated<'a>(&self, budget: &'a Budget) -> Result<Cdt<'a>> {
        delaunay::constrained(&self.points, &self.edges, budget)
    }
}
