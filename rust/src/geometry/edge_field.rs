//! The nearest edge of closed rings to any point of their plane (`docs/math.md`, section 11).
//!
//! Rings never change while poses do: which edges may be nearest in a cell of a grid is found once, when a point first falls into
//! it, and the nearest one is then a look-up and a few distances. Points need not lie on any outline.

use std::sync::OnceLock;

use nalgebra::Vector2;

/// Cells along a side of the grid: of a region of some hundred pixels they are as large as the distances that decide a pose.
const CELLS: usize = 32;

/// Room around the rings that the grid covers, as a share of their extent.
const MARGIN: f64 = 0.25;

/// Consecutive edges that are looked at together: of a contour of some hundred edges as many groups as edges in a group.
const GROUP: usize = 16;

/// Before any edge was looked at.
const NONE: (f64, u32) = (f64::INFINITY, 0);

/// Closed rings, and for every place about them the edges that may be nearest.
#[derive(Debug, Clone)]
pub struct EdgeField {
    edges: Vec<FieldEdge>,
    groups: Vec<Group>,
    origin: Vector2<f64>,
    /// Size of a cell.
    cell: Vector2<f64>,
    /// Numbers of the edges that may be nearest to a point of each cell.
    candidates: Vec<OnceLock<Box<[u32]>>>,
}

#[derive(Debug, Clone, Copy)]
struct FieldEdge {
    start: Vector2<f64>,
    step: Vector2<f64>,
    inverse: f64,
}

/// A box around consecutive edges.
#[derive(Debug, Clone, Copy)]
struct Group {
    low: Vector2<f64>,
    high: Vector2<f64>,
}

impl Group {
    fn around(edges: &[FieldEdge]) -> Self {
        let ends = || edges.iter().flat_map(|edge| [edge.start, edge.start + edge.step]);
        let low = ends().fold(Vector2::repeat(f64::INFINITY), |low, end| low.inf(&end));
        let high = ends().fold(Vector2::repeat(f64::NEG_INFINITY), |high, end| high.sup(&end));
        Self { low, high }
    }

    /// Squared distance of a point from the box: no edge in it is nearer.
    fn square(&self, point: &Vector2<f64>) -> f64 {
        (self.low - point).sup(&(point - self.high)).sup(&Vector2::zeros()).norm_squared()
    }
}

impl FieldEdge {
    /// Squared distance of a point.
    fn square(&self, point: &Vector2<f64>) -> f64 {
        let offset = point - self.start;
        let share = (offset.dot(&self.step) * self.inverse).clamp(0.0, 1.0);
        (offset - self.step * share).norm_squared()
    }
}

impl EdgeField {
    /// The field of closed rings; edges are counted ring after ring.
    pub fn new(rings: &[Vec<Vector2<f64>>]) -> Self {
        let edges: Vec<FieldEdge> = rings.iter().flat_map(|ring| edges_of(ring)).collect();
        let points = || rings.iter().flatten();
        let low = points().fold(Vector2::repeat(f64::INFINITY), |low, point| low.inf(point));
        let high = points().fold(Vector2::repeat(f64::NEG_INFINITY), |high, point| high.sup(point));
        let room = (high - low) * MARGIN;
        let cell = (high - low + room * 2.0) / CELLS as f64;
        let groups = edges.chunks(GROUP).map(Group::around).collect();
        Self { edges, groups, origin: low - room, cell, candidates: vec![OnceLock::new(); CELLS * CELLS] }
    }

    /// The edges that may be nearest to a point of a cell: those that are farther from its middle than the nearest by no more
    /// than the cell's diagonal.
    fn may_be_nearest(&self, cell: usize) -> Box<[u32]> {
        let place = Vector2::new((cell % CELLS) as f64 + 0.5, (cell / CELLS) as f64 + 0.5);
        let middle = self.origin + self.cell.component_mul(&place);
        let limit = (self.nearest_of_all(&middle).0.sqrt() + self.cell.norm()).powi(2);
        let groups = (0..self.groups.len()).filter(|&group| self.groups[group].square(&middle) <= limit);
        let near = |edge: &u32| self.edges[*edge as usize].square(&middle) <= limit;
        groups.flat_map(|group| self.numbers_in(group)).filter(near).collect()
    }

    /// The numbers of the edges in a group.
    fn numbers_in(&self, group: usize) -> std::ops::Range<u32> {
        (group * GROUP) as u32..((group + 1) * GROUP).min(self.edges.len()) as u32
    }

    /// The nearest of some edges, by its squared distance and number, or the one before where none is nearer.
    fn nearest_among(&self, point: &Vector2<f64>, edges: impl Iterator<Item = u32>, before: (f64, u32)) -> (f64, u32) {
        edges
            .map(|edge| (self.edges[edge as usize].square(point), edge))
            .fold(before, |best, other| if other.0 < best.0 { other } else { best })
    }

    /// The nearest of all edges: of those in the nearest box, then of those in all boxes that may hold a nearer.
    fn nearest_of_all(&self, point: &Vector2<f64>) -> (f64, u32) {
        let square = |group: &usize| self.groups[*group].square(point);
        let first = (0..self.groups.len()).min_by(|a, b| square(a).total_cmp(&square(b))).unwrap_or(0);
        let mut best = self.nearest_among(point, self.numbers_in(first), NONE);
        for group in (0..self.groups.len()).filter(|&group| group != first) {
            if square(&group) < best.0 {
                best = self.nearest_among(point, self.numbers_in(group), best);
            }
        }
        best
    }

    /// The edge nearest to a point, by its number.
    pub fn nearest_edge(&self, point: &Vector2<f64>) -> usize {
        let nearest = match self.cell_of(point) {
            Some(cell) => {
                let candidates = self.candidates[cell].get_or_init(|| self.may_be_nearest(cell));
                self.nearest_among(point, candidates.iter().copied(), NONE)
            }
            None => self.nearest_of_all(point),
        };
        nearest.1 as usize
    }

    /// The cell that a point lies in; `None` outside the grid.
    fn cell_of(&self, point: &Vector2<f64>) -> Option<usize> {
        let at = (point - self.origin).component_div(&self.cell);
        let inside = |x: f64| (0.0..CELLS as f64).contains(&x);
        (inside(at.x) && inside(at.y)).then(|| at.y as usize * CELLS + at.x as usize)
    }
}

fn edges_of(ring: &[Vector2<f64>]) -> impl Iterator<Item = FieldEdge> + '_ {
    (0..ring.len()).map(|k| {
        let step = ring[(k + 1) % ring.len()] - ring[k];
        FieldEdge { start: ring[k], step, inverse: 1.0 / step.norm_squared().max(f64::MIN_POSITIVE) }
    })
}
