//! Mesh of nearly equal, nearly equilateral triangles: what distmesh is used for in the paper (section 2.2).

use std::collections::HashMap;

use nalgebra::Vector2;
use spade::Triangulation;

use super::delaunay::{self, Cdt};
use super::triangulation::RingGraph;
use super::{MOST_TRIANGLES, PlaneMesh};
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::geometry::rings::PlaneRings;

/// Height of an equilateral triangle over its side: the spacing of lattice rows.
const ROW_SPACING: f64 = 0.866_025_403_784_438_6;

/// Lattice points nearer to the boundary than this fraction of the edge length make flat triangles there.
const BOUNDARY_GAP: f64 = 0.55;

/// Vertices on the boundary of a region that is too thin for two rows of triangles, beside those for which its area has two
/// triangles each, as two rows have. Edges that nearly coincide take the square of their number, 2,000 of them a fifth of a
/// second (`fuzz --target mesh`).
const MOST_ON_NEEDLES: usize = 2000;
const TRIANGLES_EACH: f64 = 2.0;

/// Rounds of smoothing, each ending in a new triangulation; further ones gain less than 0.001 of quality.
const SMOOTHING_ROUNDS: usize = 2;

/// Sweeps over all free vertices in a round: cheap next to the triangulation.
const SWEEPS: usize = 4;

/// A triangle whose vertices lie on one edge is dropped below this fraction of an equilateral one: rounding of the
/// points set on that edge made it.
const SLIVER_FRACTION: f64 = 1e-9;

/// Mesh of a region with edges of about `edge_length`, in the rings' unit, covering exactly its area.
///
/// Ring edges are divided evenly, all ring vertices stay; inside lies a hexagonal lattice, then smoothed. Where ring
/// edges are shorter than `edge_length` the triangles along them are smaller too. Ring vertices come first, in order.
///
/// # Errors
/// An edge length that is not positive and finite, would make more than [`MOST_TRIANGLES`] triangles, or is far longer than
/// the region is wide for its length; a mesh that does not cover the region's area ([`Error::MeshArea`]).
pub fn even_mesh(region: &PlaneRings, edge_length: f64) -> Result<PlaneMesh> {
    even_mesh_within(region, edge_length, &Budget::unlimited())
}

/// The same within a budget; an error, too, where that is canceled.
#[doc(hidden)]
pub fn even_mesh_within(region: &PlaneRings, edge_length: f64, budget: &Budget) -> Result<PlaneMesh> {
    delaunay::interruptible(|| mesh_of(region, edge_length, budget))
}

fn mesh_of(region: &PlaneRings, edge_length: f64, budget: &Budget) -> Result<PlaneMesh> {
    check_edge_length(region, edge_length)?;
    let mut graph = RingGraph::new(region);
    let side = edge_length * graph.scale;
    let corners = graph.points.len();
    let chains = divide_edges(&mut graph, side);
    let fixed = graph.points.len();
    let lattice = lattice_points(&graph, side);
    graph.points.extend(lattice);
    let mut cdt = delaunay::constrained(&graph.points, &graph.edges, budget)?;
    for _ in 0..SMOOTHING_ROUNDS {
        for _ in 0..SWEEPS {
            smooth(&cdt, &mut graph.points, fixed);
        }
        cdt = delaunay::constrained(&graph.points, &graph.edges, budget)?;
    }
    let mut mesh = delaunay::inside_mesh(&cdt, graph.scale, fixed);
    drop_slivers(&mut mesh, &chains, corners, edge_length);
    mesh.covering(region)
}

fn check_edge_length(region: &PlaneRings, edge_length: f64) -> Result<()> {
    let across = region.area() / (0.5 * ROW_SPACING * edge_length * edge_length);
    let along = region.edges().map(|(a, b)| (b - a).norm() / edge_length).sum::<f64>();
    let usable = edge_length.is_finite() && edge_length > 0.0;
    let needed = if !usable {
        "positive and finite".to_owned()
    } else if across + along > MOST_TRIANGLES as f64 {
        format!("longer: it would make more than {MOST_TRIANGLES} triangles")
    } else if along > MOST_ON_NEEDLES as f64 + across / TRIANGLES_EACH {
        format!(
            "longer: the region is too thin for two rows of triangles, and more than {MOST_ON_NEEDLES} vertices would lie on its boundary"
        )
    } else {
        return Ok(());
    };
    Err(Error::InvalidOption { item: "edge_length", found: format!("{edge_length:e}"), needed })
}

/// Divides the edges into pieces of about `side`; returns for each point set on an edge the number of that edge.
fn divide_edges(graph: &mut RingGraph, side: f64) -> Vec<usize> {
    let mut chains = Vec::new();
    for (number, [start, end]) in std::mem::take(&mut graph.edges).into_iter().enumerate() {
        let (a, b) = (graph.points[start], graph.points[end]);
        let pieces = ((b - a).norm() / side).round().max(1.0) as usize;
        let mut previous = start;
        for k in 1..pieces {
            let point = a.lerp(&b, k as f64 / pieces as f64);
            graph.points.push(point);
            chains.push(number);
            graph.edges.push([previous, graph.points.len() - 1]);
            previous = graph.points.len() - 1;
        }
        graph.edges.push([previous, end]);
    }
    chains
}

/// Points of a hexagonal lattice inside the rings, none within [`BOUNDARY_GAP`] of an edge; rows fill the height.
fn lattice_points(graph: &RingGraph, side: f64) -> Vec<Vector2<f64>> {
    let (lower, upper) = crate::geometry::rings::bounding_box(graph.points.iter().copied());
    let fitted = |length: f64, spacing: f64| length / (length / spacing).round().max(1.0);
    let row = fitted(upper.y - lower.y, ROW_SPACING * side);
    let column = fitted(upper.x - lower.x, side);
    let near = NearEdges::new(graph, BOUNDARY_GAP * side);
    let mut points = Vec::new();
    for (number, crossings) in row_crossings(graph, lower.y, row) {
        let y = lower.y + number as f64 * row;
        let offset = lower.x + if number % 2 == 0 { 0.0 } else { 0.5 * column };
        for span in crossings.chunks_exact(2) {
            let first = ((span[0] - offset) / column).ceil() as i64;
            let last = ((span[1] - offset) / column).floor() as i64;
            let along = (first..=last).map(|k| Vector2::new(offset + k as f64 * column, y));
            points.extend(along.filter(|&point| !near.is_near(point)));
        }
    }
    points
}

/// For each lattice row that meets an edge, in order, the x where edges cross it, sorted.
fn row_crossings(graph: &RingGraph, base: f64, row: f64) -> Vec<(i64, Vec<f64>)> {
    let mut rows: HashMap<i64, Vec<f64>> = HashMap::new();
    for &[start, end] in &graph.edges {
        let (a, b) = (graph.points[start], graph.points[end]);
        let numbers = [(a.y.min(b.y) - base) / row, (a.y.max(b.y) - base) / row].map(f64::floor);
        for number in numbers[0] as i64..=numbers[1] as i64 {
            let y = base + number as f64 * row;
            if (a.y > y) != (b.y > y) {
                rows.entry(number).or_default().push(a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x));
            }
        }
    }
    let mut rows: Vec<_> = rows.into_iter().collect();
    rows.sort_unstable_by_key(|&(number, _)| number);
    rows.iter_mut().for_each(|(_, crossings)| crossings.sort_by(f64::total_cmp));
    rows
}

/// Edge pieces by the cells of a square grid that they come near to.
struct NearEdges<'a> {
    graph: &'a RingGraph,
    distance: f64,
    cell: f64,
    cells: HashMap<[i64; 2], Vec<usize>>,
}

impl<'a> NearEdges<'a> {
    fn new(graph: &'a RingGraph, distance: f64) -> Self {
        let mut near = Self { graph, distance, cell: 2.0 * distance, cells: HashMap::new() };
        for (index, &[start, end]) in graph.edges.iter().enumerate() {
            let (a, b) = (graph.points[start], graph.points[end]);
            let margin = Vector2::repeat(distance);
            let (low, high) = (near.cell_of(a.inf(&b) - margin), near.cell_of(a.sup(&b) + margin));
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    near.cells.entry([x, y]).or_default().push(index);
                }
            }
        }
        near
    }

    fn cell_of(&self, point: Vector2<f64>) -> [i64; 2] {
        [point.x, point.y].map(|x| (x / self.cell).floor() as i64)
    }

    fn is_near(&self, point: Vector2<f64>) -> bool {
        let candidates = self.cells.get(&self.cell_of(point)).map_or(&[][..], Vec::as_slice);
        candidates.iter().any(|&index| {
            let [start, end] = self.graph.edges[index];
            distance_to_segment(point, self.graph.points[start], self.graph.points[end]) < self.distance
        })
    }
}

fn distance_to_segment(point: Vector2<f64>, a: Vector2<f64>, b: Vector2<f64>) -> f64 {
    let along = b - a;
    let share = ((point - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (point - a - share * along).norm()
}

/// Moves each free vertex to the mean of its neighbors, unless that would turn a triangle over.
fn smooth(cdt: &Cdt<'_>, points: &mut [Vector2<f64>], fixed: usize) {
    for vertex in cdt.vertices().skip(fixed) {
        let around: Vec<usize> = vertex.out_edges().map(|edge| edge.to().index()).collect();
        let mean = around.iter().map(|&k| points[k]).sum::<Vector2<f64>>() / around.len() as f64;
        let turns_over = vertex.out_edges().any(|edge| {
            let (a, b) = (points[edge.to().index()], points[edge.next().to().index()]);
            (a - mean).perp(&(b - mean)) <= 0.0
        });
        if !turns_over {
            points[vertex.index()] = mean;
        }
    }
}

/// Drops the triangles without extent between points set on the same edge.
fn drop_slivers(mesh: &mut PlaneMesh, chains: &[usize], corners: usize, edge_length: f64) {
    let smallest = SLIVER_FRACTION * 0.5 * ROW_SPACING * edge_length * edge_length;
    let mut triangles = std::mem::take(&mut mesh.triangles);
    let is_sliver = |&triangle: &[usize; 3]| {
        let mut on_edge = triangle.iter().filter_map(|&k| chains.get(k.checked_sub(corners)?));
        let first = on_edge.next();
        first.is_some() && on_edge.all(|chain| Some(chain) == first) && mesh.triangle_area(triangle) < smallest
    };
    triangles.retain(|triangle| !is_sliver(triangle));
    mesh.triangles = triangles;
}
