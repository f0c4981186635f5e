//! The nearest edge of closed rings to any point of their plane (`docs/math.md`, section 11).
//!
//! Rings never change while poses do: which edges may be nearest in a cell of a grid is found once, when a point first falls into
//! it, and the nearest one is then a look-up and a few distances. Points need not lie on any outline.

use std::sync::OnceLock;

use nalgebra::Vector2;

use crate::moments::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Cells along a side of the grid: of a region of some hundred pixels they are as large as the distances that decide a pose.
const CELLS: usize = 32;

/// Room around the rings that the grid covers, as a share of their extent.
const MARGIN: f64 = 0.25;

/// Closed rings, and for every place about them the edges that may be nearest.
#[derive(Debug, Clone)]
pub struct EdgeField {
    edges: Vec<FieldEdge>,
    groups: Vec<EdgeGroup>,
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

impl FieldEdge {
    /// Squared distance of a point.
    fn square(&self, point: &Vector2<f64>) -> f64 {
        let offset = point - self.start;
        let share = (offset.dot(&self.step) * self.inverse).clamp(0.0, 1.0);
        (offset - self.step * share).norm_squared()
    }
}

/// Edges whose distances are worked out together; past the last one comes it again.
#[derive(Debug, Clone, Copy)]
struct EdgeGroup {
    start: [Lanes; 2],
    step: [Lanes; 2],
    inverse: Lanes,
}

impl EdgeGroup {
    fn new(edges: &[FieldEdge]) -> Self {
        let edge: [FieldEdge; LANES] = std::array::from_fn(|lane| edges[lane.min(edges.len() - 1)]);
        let lanes = |value: fn(&FieldEdge) -> f64| Lanes(edge.map(|edge| value(&edge)));
        Self {
            start: [lanes(|edge| edge.start.x), lanes(|edge| edge.start.y)],
            step: [lanes(|edge| edge.step.x), lanes(|edge| edge.step.y)],
            inverse: lanes(|edge| edge.inverse),
        }
    }
}

/// Squared distances of a point from all edges.
struct Squares<'a> {
    groups: &'a [EdgeGroup],
    point: Vector2<f64>,
}

impl NullaryFnOnce for Squares<'_> {
    type Output = Vec<Lanes>;

    #[inline(always)]
    fn call(self) -> Vec<Lanes> {
        let point = [Lanes::splat(self.point.x), Lanes::splat(self.point.y)];
        let mut squares = Vec::with_capacity(self.groups.len());
        for EdgeGroup { start, step, inverse } in self.groups {
            let [x, y] = [point[0] - start[0], point[1] - start[1]];
            let share = ((x * step[0] + y * step[1]) * *inverse).upper(Lanes::ZERO).lower(Lanes::splat(1.0));
            let [x, y] = [x - share * step[0], y - share * step[1]];
            squares.push(x * x + y * y);
        }
        squares
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
        let groups = edges.chunks(LANES).map(EdgeGroup::new).collect();
        Self { edges, groups, origin: low - room, cell, candidates: vec![OnceLock::new(); CELLS * CELLS] }
    }

    /// The edges that may be nearest to a point of a cell: those that are farther from its middle than the nearest by no more
    /// than the cell's diagonal.
    fn may_be_nearest(&self, cell: usize) -> Box<[u32]> {
        let place = Vector2::new((cell % CELLS) as f64 + 0.5, (cell / CELLS) as f64 + 0.5);
        let middle = self.origin + self.cell.component_mul(&place);
        let squares = vectorized(Squares { groups: &self.groups, point: middle });
        let least = squares.iter().fold(Lanes::splat(f64::INFINITY), |least, square| least.lower(*square)).min();
        let limit = (least.sqrt() + self.cell.norm()).powi(2);
        let mut near = Vec::with_capacity(LANES * LANES);
        for (group, squares) in squares.iter().enumerate().filter(|(_, squares)| squares.min() <= limit) {
            let edges = (group * LANES..self.edges.len()).zip(squares.0);
            near.extend(edges.filter(|(_, square)| *square <= limit).map(|(edge, _)| edge as u32));
        }
        near.into()
    }

    /// The edge nearest to a point, by its number.
    pub fn nearest_edge(&self, point: &Vector2<f64>) -> usize {
        let mut best = (f64::INFINITY, 0);
        let mut look_at = |edge: u32| {
            let square = self.edges[edge as usize].square(point);
            if square < best.0 {
                best = (square, edge);
            }
        };
        match self.cell_of(point) {
            Some(cell) => {
                let candidates = self.candidates[cell].get_or_init(|| self.may_be_nearest(cell));
                candidates.iter().for_each(|&edge| look_at(edge));
            }
            None => (0..self.edges.len() as u32).for_each(look_at),
        }
        best.1 as usize
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
