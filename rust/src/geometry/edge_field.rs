//! The nearest edge of closed rings to any point of their plane (`docs/math.md`, section 11).
//!
//! Rings never change while poses do: which edges may be nearest in a cell of a grid is found once, after a few points
//! fell into it, and the nearest one is then a look-up and a few distances. Points need not lie on any outline.

use std::array;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

use nalgebra::Vector2;

use crate::geometry::rings::bounding_box;
use crate::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Cells along a side of the grid: of a region of some hundred pixels they are as large as the distances that decide a pose.
const CELLS: usize = 32;

/// Room around the rings that the grid covers, as a share of their extent.
const MARGIN: f64 = 0.25;

/// Consecutive edges that a box is put around: of a contour of some hundred edges as many boxes as edges in one.
const GROUP: usize = 4 * LANES;

/// Points of a cell for which all edges are looked at: as many as take the time to find the cell's own (by callgrind).
const FEW: u8 = 2;

/// Room around a box, as a share of its coordinates: more than distances are rounded by, less than tells edges apart.
const ROUNDING: f64 = 1e-9;

/// Closed rings, and for every place about them the edges that may be nearest.
#[derive(Debug)]
pub struct EdgeField {
    edges: Vec<FieldEdge>,
    groups: Vec<Group>,
    origin: Vector2<f64>,
    /// Size of a cell.
    cell: Vector2<f64>,
    /// Points that fell into each cell, up to [`FEW`].
    seen: [AtomicU8; CELLS * CELLS],
    /// Those of each cell, once more than a few points fell into one.
    candidates: OnceLock<Box<[Candidates]>>,
}

/// Numbers of the edges that may be nearest to a point of a cell, once they are asked for.
type Candidates = OnceLock<Box<[u32]>>;

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

/// Consecutive edges, the last one repeated where they are too few, and a box around them.
#[derive(Debug, Clone, Copy)]
struct Group {
    low: Vector2<f64>,
    high: Vector2<f64>,
    start: [[Lanes; 2]; GROUP / LANES],
    step: [[Lanes; 2]; GROUP / LANES],
    inverse: [Lanes; GROUP / LANES],
}

impl Group {
    fn of(edges: &[FieldEdge]) -> Self {
        let (low, high) = bounding_box(edges.iter().flat_map(|edge| [edge.start, edge.start + edge.step]));
        let room = Vector2::repeat(ROUNDING * low.amax().max(high.amax()));
        let mut group = Self {
            low: low - room,
            high: high + room,
            start: Default::default(),
            step: Default::default(),
            inverse: Default::default(),
        };
        for place in 0..GROUP {
            let (edge, [k, lane]) = (&edges[place.min(edges.len() - 1)], [place / LANES, place % LANES]);
            for axis in 0..2 {
                group.start[k][axis].0[lane] = edge.start[axis];
                group.step[k][axis].0[lane] = edge.step[axis];
            }
            group.inverse[k].0[lane] = edge.inverse;
        }
        group
    }

    /// Squared distance of a point from the box: no edge in it is nearer.
    #[inline(always)]
    fn square(&self, point: &Vector2<f64>) -> f64 {
        let outside = |axis: usize| {
            let (below, above) = (self.low[axis] - point[axis], point[axis] - self.high[axis]);
            let beyond = if below > above { below } else { above };
            if beyond > 0.0 { beyond } else { 0.0 }
        };
        let [x, y] = [outside(0), outside(1)];
        x * x + y * y
    }

    /// Squared distances of a point from all edges, as [`FieldEdge::square`] gives them.
    #[inline(always)]
    fn squares(&self, point: &Vector2<f64>) -> [Lanes; GROUP / LANES] {
        array::from_fn(|k| {
            let [x, y] = [0, 1].map(|axis| Lanes::splat(point[axis]) - self.start[k][axis]);
            let [dx, dy] = self.step[k];
            let share = ((x * dx + y * dy) * self.inverse[k]).upper(Lanes::ZERO).lower(Lanes::splat(1.0));
            let (x, y) = (x - dx * share, y - dy * share);
            x * x + y * y
        })
    }
}

/// The squared distance and number of the first of the edges nearest to a point, of groups of which there is one at least.
struct Nearest<'a>(&'a [Group], &'a Vector2<f64>);

impl NullaryFnOnce for Nearest<'_> {
    type Output = (f64, usize);

    /// That of the nearest box first, then of all boxes that may hold a nearer one.
    #[inline(always)]
    fn call(self) -> (f64, usize) {
        let Self(groups, point) = self;
        let least =
            |group: &Group| group.squares(point).into_iter().fold(Lanes::splat(f64::INFINITY), Lanes::lower).min();
        let mut nearest = (f64::INFINITY, 0);
        for (number, group) in groups.iter().enumerate() {
            let square = group.square(point);
            nearest = if square < nearest.0 { (square, number) } else { nearest };
        }
        let mut best = (least(&groups[nearest.1]), nearest.1);
        for (number, group) in groups.iter().enumerate() {
            if group.square(point) <= best.0 && number != nearest.1 {
                let square = least(group);
                best = if (square, number) < best { (square, number) } else { best };
            }
        }
        let squares = groups[best.1].squares(point).map(|squares| squares.0);
        let place = squares.as_flattened().iter().position(|square| *square == best.0).unwrap_or(0);
        (best.0, best.1 * GROUP + place)
    }
}

/// Gives the numbers of the edges within a squared distance of a point, rising.
struct Within<'a, F>(&'a [Group], &'a Vector2<f64>, f64, F);

impl<F: FnMut(usize)> NullaryFnOnce for Within<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self(groups, point, limit, mut found) = self;
        for (number, group) in groups.iter().enumerate().filter(|(_, group)| group.square(point) <= limit) {
            for (k, squares) in group.squares(point).into_iter().enumerate() {
                for (lane, square) in squares.0.into_iter().enumerate() {
                    if square <= limit {
                        found(number * GROUP + k * LANES + lane);
                    }
                }
            }
        }
    }
}

impl EdgeField {
    /// The field of closed rings; edges are counted ring after ring.
    pub fn new(rings: &[Vec<Vector2<f64>>]) -> Self {
        let edges: Vec<FieldEdge> = rings.iter().flat_map(|ring| edges_of(ring)).collect();
        let (low, high) = bounding_box(rings.iter().flatten().copied());
        let room = (high - low) * MARGIN;
        let cell = (high - low + room * 2.0) / CELLS as f64;
        let groups = edges.chunks(GROUP).map(Group::of).collect();
        let seen = [const { AtomicU8::new(0) }; CELLS * CELLS];
        Self { edges, groups, origin: low - room, cell, seen, candidates: OnceLock::new() }
    }

    /// The edges that may be nearest to a point of a cell: those that are farther from its middle than the nearest by no more
    /// than the cell's diagonal.
    fn may_be_nearest(&self, cell: usize) -> Box<[u32]> {
        let place = Vector2::new((cell % CELLS) as f64 + 0.5, (cell / CELLS) as f64 + 0.5);
        let middle = self.origin + self.cell.component_mul(&place);
        let limit = (self.nearest_of_all(&middle).0.sqrt() + self.cell.norm()).powi(2);
        let mut numbers = Vec::new();
        // The last group repeats the last edge.
        let found = |number: usize| numbers.extend((number < self.edges.len()).then_some(number as u32));
        vectorized(Within(&self.groups, &middle, limit, found));
        numbers.into()
    }

    /// The edge nearest to a point, by its number; the first of several.
    pub fn nearest_edge(&self, point: &Vector2<f64>) -> usize {
        match self.cell_of(point).filter(|&cell| self.is_busy(cell)) {
            Some(cell) => self.nearest_among(point, self.candidates(cell)),
            None => self.nearest_of_all(point).1,
        }
    }

    fn nearest_among(&self, point: &Vector2<f64>, edges: &[u32]) -> usize {
        let nearer = |best: (f64, u32), other: (f64, u32)| if other.0 < best.0 { other } else { best };
        let squares = edges.iter().map(|&edge| (self.edges[edge as usize].square(point), edge));
        squares.fold((f64::INFINITY, 0), nearer).1 as usize
    }

    /// By its squared distance and number.
    fn nearest_of_all(&self, point: &Vector2<f64>) -> (f64, usize) {
        vectorized(Nearest(&self.groups, point))
    }

    /// Whether more than a few points fell into a cell.
    fn is_busy(&self, cell: usize) -> bool {
        let seen = &self.seen[cell];
        let count = seen.load(Ordering::Relaxed);
        if count < FEW {
            seen.store(count + 1, Ordering::Relaxed);
        }
        count == FEW
    }

    fn candidates(&self, cell: usize) -> &[u32] {
        let cells = self.candidates.get_or_init(|| vec![OnceLock::new(); CELLS * CELLS].into());
        cells[cell].get_or_init(|| self.may_be_nearest(cell))
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
