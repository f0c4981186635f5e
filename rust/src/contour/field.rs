//! The nearest edge of closed rings to any point of their plane (`docs/math.md`, section 11).
//!
//! Rings never change while poses do: which edges may be nearest in each cell of a grid is found once, and the nearest one is
//! then a look-up and a few distances. Points need not lie on any outline.

use nalgebra::Vector2;

/// Cells along a side are split into so many at a time, twice: edges are compared with a few large cells first.
const SPLIT: usize = 4;
const LEVELS: usize = 2;

/// Room around the rings that the grid covers, as a share of their extent.
const MARGIN: f64 = 0.25;

/// Closed rings, and for every place about them the edges that may be nearest.
#[derive(Debug, Clone)]
pub struct EdgeField {
    edges: Vec<FieldEdge>,
    origin: Vector2<f64>,
    /// Size of a cell.
    cell: Vector2<f64>,
    /// Cells along a side.
    side: usize,
    /// Where the candidates of each cell begin in `candidates`; one more than there are cells.
    starts: Vec<u32>,
    /// Numbers of edges, cell by cell.
    candidates: Vec<u32>,
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

impl EdgeField {
    /// The field of closed rings; edges are counted ring after ring.
    pub fn new(rings: &[Vec<Vector2<f64>>]) -> Self {
        let edges: Vec<FieldEdge> = rings.iter().flat_map(|ring| edges_of(ring)).collect();
        let points = || rings.iter().flatten();
        let low = points().fold(Vector2::repeat(f64::INFINITY), |low, point| low.inf(point));
        let high = points().fold(Vector2::repeat(f64::NEG_INFINITY), |high, point| high.sup(point));
        let room = (high - low) * MARGIN;
        let side = SPLIT.pow(LEVELS as u32);
        let (origin, cell) = (low - room, (high - low + room * 2.0) / side as f64);
        let mut field = Self { edges, origin, cell, side, starts: Vec::new(), candidates: Vec::new() };
        field.fill();
        field
    }

    /// Finds every cell's candidates among those of the larger cell around it.
    fn fill(&mut self) {
        let (mut side, mut lists) = (1, vec![(0..self.edges.len() as u32).collect::<Vec<u32>>()]);
        for _ in 0..LEVELS {
            let (next, size) = (side * SPLIT, self.cell * (self.side / (side * SPLIT)) as f64);
            let of = |cell: usize| {
                let (column, row) = (cell % next, cell / next);
                let middle = self.origin + size.component_mul(&Vector2::new(column as f64 + 0.5, row as f64 + 0.5));
                self.may_be_nearest(&lists[row / SPLIT * side + column / SPLIT], &middle, size.norm())
            };
            (lists, side) = ((0..next * next).map(of).collect(), next);
        }
        self.starts = std::iter::once(0)
            .chain(lists.iter().scan(0, |end, list| {
                *end += list.len() as u32;
                Some(*end)
            }))
            .collect();
        self.candidates = lists.concat();
    }

    /// The edges that may be nearest to a point of a cell of this diagonal: those that are farther from its middle than the
    /// nearest by no more than the diagonal.
    fn may_be_nearest(&self, among: &[u32], middle: &Vector2<f64>, diagonal: f64) -> Vec<u32> {
        let squares: Vec<f64> = among.iter().map(|&edge| self.edges[edge as usize].square(middle)).collect();
        let limit = (squares.iter().copied().fold(f64::INFINITY, f64::min).sqrt() + diagonal).powi(2);
        among.iter().zip(&squares).filter(|(_, square)| **square <= limit).map(|(edge, _)| *edge).collect()
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
                let held = self.starts[cell] as usize..self.starts[cell + 1] as usize;
                self.candidates[held].iter().for_each(|&edge| look_at(edge));
            }
            None => (0..self.edges.len() as u32).for_each(look_at),
        }
        best.1 as usize
    }

    /// The cell that a point lies in; `None` outside the grid.
    fn cell_of(&self, point: &Vector2<f64>) -> Option<usize> {
        let at = (point - self.origin).component_div(&self.cell);
        let inside = |x: f64| (0.0..self.side as f64).contains(&x);
        (inside(at.x) && inside(at.y)).then(|| at.y as usize * self.side + at.x as usize)
    }
}

fn edges_of(ring: &[Vector2<f64>]) -> impl Iterator<Item = FieldEdge> + '_ {
    (0..ring.len()).map(|k| {
        let step = ring[(k + 1) % ring.len()] - ring[k];
        FieldEdge { start: ring[k], step, inverse: 1.0 / step.norm_squared().max(f64::MIN_POSITIVE) }
    })
}
