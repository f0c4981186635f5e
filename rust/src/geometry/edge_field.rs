//! Nearest-edge queries to closed rings (`docs/math.md`, section 11).
//!
//! Rings never change while poses do: which edges may be nearest in a cell of a grid is found once, after a few points
//! fell into it, and the nearest one is then a look-up and a few distances. Points need not lie on any outline.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, Ordering};

use nalgebra::Vector2;

use crate::geometry::rings::bounding_box;
use crate::math::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Cells along a side of the grid: of a region of some hundred pixels they are as large as the distances that decide a pose.
const CELLS: usize = 32;

/// Room around the rings that the grid covers, as a share of their extent.
const MARGIN: f64 = 0.25;

/// Consecutive edges that a box is put around: of a contour of some hundred edges as many boxes as edges in one.
pub(crate) const GROUP: usize = 4 * LANES;

/// Points of a cell for which all edges are evaluated: as many as take the time to find the cell's own (by callgrind).
const FIRST_POINTS: u8 = 2;

/// Room around a box, as a share of its coordinates: more than distances are rounded by, less than edges differ by.
pub(crate) const ROUNDING: f64 = 1e-9;

/// Closed rings, and for every place about them the edges that may be nearest.
#[derive(Debug)]
pub struct EdgeField {
    edges: Vec<FieldEdge>,
    groups: Vec<Group>,
    boxes: Vec<Boxes>,
    origin: Vector2<f64>,
    /// Size of a cell.
    cell: Vector2<f64>,
    /// Points that fell into each cell, up to [`FIRST_POINTS`].
    visits: [AtomicU8; CELLS * CELLS],
    /// Those of each cell, once more than a few points fell into one.
    candidates: OnceLock<Box<[Candidates]>>,
}

/// The edges that may be nearest to a point of a cell and their numbers, rising, computed on demand.
type Candidates = OnceLock<Box<[(Few, [u32; LANES])]>>;

#[derive(Debug, Clone, Copy)]
struct FieldEdge {
    start: Vector2<f64>,
    step: Vector2<f64>,
    inverse: f64,
}

/// As many edges as lanes, the last one repeated where they are too few.
#[derive(Debug, Clone, Copy, Default)]
struct Few {
    start: [Lanes; 2],
    step: [Lanes; 2],
    inverse: Lanes,
}

impl Few {
    fn of(edges: &[FieldEdge]) -> Self {
        let mut few = Self::default();
        for lane in 0..LANES {
            let edge = &edges[lane.min(edges.len() - 1)];
            for axis in 0..2 {
                few.start[axis].0[lane] = edge.start[axis];
                few.step[axis].0[lane] = edge.step[axis];
            }
            few.inverse.0[lane] = edge.inverse;
        }
        few
    }

    /// Squared distances of a point.
    #[inline(always)]
    fn squares(&self, point: &[Lanes; 2]) -> Lanes {
        let [x, y] = [point[0] - self.start[0], point[1] - self.start[1]];
        let [dx, dy] = self.step;
        let share = ((x * dx + y * dy) * self.inverse).upper(Lanes::ZERO).lower(Lanes::splat(1.0));
        let (x, y) = (x - dx * share, y - dy * share);
        x * x + y * y
    }
}

/// Consecutive edges, the last one repeated where they are too few.
#[derive(Debug, Clone, Copy)]
struct Group([Few; GROUP / LANES]);

impl Group {
    fn of(edges: &[FieldEdge]) -> Self {
        let few = |k: usize| Few::of(&edges[(k * LANES).min(edges.len() - 1)..]);
        Self(std::array::from_fn(few))
    }

    /// Squared distances of a point from all edges.
    #[inline(always)]
    fn squares(&self, point: &[Lanes; 2]) -> [Lanes; GROUP / LANES] {
        let mut squares = [Lanes::ZERO; GROUP / LANES];
        for (square, few) in squares.iter_mut().zip(&self.0) {
            *square = few.squares(point);
        }
        squares
    }
}

/// The number of the first of a cell's edges nearest to a point.
struct NearestAmong<'a>(&'a [(Few, [u32; LANES])], &'a Vector2<f64>);

impl NullaryFnOnce for NearestAmong<'_> {
    type Output = u32;

    #[inline(always)]
    fn call(self) -> u32 {
        let point = in_lanes(self.1);
        let (mut squares, mut places) = (Lanes::splat(f64::INFINITY), [0; LANES]);
        for (place, (few, _)) in self.0.iter().enumerate() {
            let next_squares = few.squares(&point);
            for (lane, first) in places.iter_mut().enumerate() {
                let nearer = next_squares.0[lane] < squares.0[lane];
                squares.0[lane] = if nearer { next_squares.0[lane] } else { squares.0[lane] };
                *first = if nearer { place } else { *first };
            }
        }
        let least = squares.min();
        let first = |lane: usize| if squares.0[lane] == least { places[lane] * LANES + lane } else { usize::MAX };
        let first = first(0).min(first(1)).min(first(2)).min(first(3));
        // A point that is not finite is as near to any.
        self.0.get(first / LANES).map_or(0, |(_, numbers)| numbers[first % LANES])
    }
}

/// Boxes around the edges of as many groups.
#[derive(Debug, Clone, Copy)]
struct Boxes {
    low: [Lanes; 2],
    high: [Lanes; 2],
}

impl Boxes {
    /// Those of the groups that up to so many edges make.
    fn of(edges: &[FieldEdge]) -> Self {
        // Past the last group nothing is near.
        let [low, high] = [f64::INFINITY, f64::NEG_INFINITY].map(|far| [Lanes::splat(far); 2]);
        let mut boxes = Self { low, high };
        for (lane, group) in edges.chunks(GROUP).enumerate() {
            let (low, high) = bounding_box(group.iter().flat_map(|edge| [edge.start, edge.start + edge.step]));
            let room = ROUNDING * low.amax().max(high.amax());
            for axis in 0..2 {
                boxes.low[axis].0[lane] = low[axis] - room;
                boxes.high[axis].0[lane] = high[axis] + room;
            }
        }
        boxes
    }

    /// Squared distances of a point: no edge in a box is nearer.
    #[inline(always)]
    fn squares(&self, point: &[Lanes; 2]) -> Lanes {
        let outside =
            |axis: usize| (self.low[axis] - point[axis]).upper(point[axis] - self.high[axis]).upper(Lanes::ZERO);
        let [x, y] = [outside(0), outside(1)];
        x * x + y * y
    }
}

#[inline(always)]
fn in_lanes(point: &Vector2<f64>) -> [Lanes; 2] {
    [Lanes::splat(point.x), Lanes::splat(point.y)]
}

/// The squared distance and number of the first of the edges nearest to a point.
struct Nearest<'a>(&'a EdgeField, &'a Vector2<f64>);

impl NullaryFnOnce for Nearest<'_> {
    type Output = (f64, usize);

    /// That of the nearest box first, then of all boxes that may hold a nearer one.
    #[inline(always)]
    fn call(self) -> (f64, usize) {
        let Self(EdgeField { groups, boxes, .. }, point) = self;
        let point = in_lanes(point);
        let (mut square, mut first) = (f64::INFINITY, 0);
        for (k, boxes) in boxes.iter().enumerate() {
            // Of points that are not finite those past the last group may seem near, too.
            for (number, other) in (k * LANES..groups.len()).zip(boxes.squares(&point).0) {
                (square, first) = if other < square { (other, number) } else { (square, first) };
            }
        }
        let mut best = Found::of(&groups[first], first, &point);
        for (k, boxes) in boxes.iter().enumerate() {
            for (number, square) in (k * LANES..groups.len()).zip(boxes.squares(&point).0) {
                if square <= best.square && number != first {
                    let found = Found::of(&groups[number], number, &point);
                    let nearer = (found.square, number) < (best.square, best.group);
                    best = if nearer { found } else { best };
                }
            }
        }
        (best.square, best.edge())
    }
}

/// The least of a group's squared distances.
struct Found {
    square: f64,
    group: usize,
    squares: [Lanes; GROUP / LANES],
}

impl Found {
    #[inline(always)]
    fn of(edges: &Group, group: usize, point: &[Lanes; 2]) -> Self {
        let squares = edges.squares(point);
        let mut least = squares[0];
        for other in &squares[1..] {
            least = least.lower(*other);
        }
        Self { square: least.min(), group, squares }
    }

    /// The first edge that lies so near.
    #[inline(always)]
    fn edge(&self) -> usize {
        let squares = self.squares.map(|lanes| lanes.0);
        let place = squares.as_flattened().iter().position(|square| *square == self.square).unwrap_or(0);
        self.group * GROUP + place
    }
}

/// Gives the numbers of the edges within a squared distance of a point, rising.
struct Within<'a, F>(&'a EdgeField, &'a Vector2<f64>, f64, F);

impl<F: FnMut(usize)> NullaryFnOnce for Within<'_, F> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self(EdgeField { groups, boxes, .. }, point, limit, mut found) = self;
        let point = in_lanes(point);
        for (number, group) in groups.iter().enumerate() {
            if boxes[number / LANES].squares(&point).0[number % LANES] > limit {
                continue;
            }
            for (k, squares) in group.squares(&point).into_iter().enumerate() {
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
        let boxes = edges.chunks(GROUP * LANES).map(Boxes::of).collect();
        let visits = [const { AtomicU8::new(0) }; CELLS * CELLS];
        Self { edges, groups, boxes, origin: low - room, cell, visits, candidates: OnceLock::new() }
    }

    /// The edges that may be nearest to a point of a cell: those that are farther from its middle than the nearest by no more
    /// than the cell's diagonal.
    fn may_be_nearest(&self, cell: usize) -> Box<[(Few, [u32; LANES])]> {
        let place = Vector2::new((cell % CELLS) as f64 + 0.5, (cell / CELLS) as f64 + 0.5);
        let middle = self.origin + self.cell.component_mul(&place);
        let limit = (self.nearest_of_all(&middle).0.sqrt() + self.cell.norm()).powi(2);
        let mut numbers = Vec::new();
        // The last group repeats the last edge.
        let found = |number: usize| numbers.extend((number < self.edges.len()).then_some(number as u32));
        vectorized(Within(self, &middle, limit, found));
        let few = |numbers: &[u32]| {
            let edges: Vec<_> = numbers.iter().map(|&number| self.edges[number as usize]).collect();
            (Few::of(&edges), std::array::from_fn(|lane| numbers[lane.min(numbers.len() - 1)]))
        };
        numbers.chunks(LANES).map(few).collect()
    }

    /// The edge nearest to a point, by its number; the first of several.
    pub fn nearest_edge(&self, point: &Vector2<f64>) -> usize {
        match self.cell_of(point).filter(|&cell| self.is_busy(cell)) {
            Some(cell) => vectorized(NearestAmong(self.candidates(cell), point)) as usize,
            None => self.nearest_of_all(point).1,
        }
    }

    /// By its squared distance and number.
    fn nearest_of_all(&self, point: &Vector2<f64>) -> (f64, usize) {
        vectorized(Nearest(self, point))
    }

    /// Whether more than a few points fell into a cell.
    fn is_busy(&self, cell: usize) -> bool {
        let visits = &self.visits[cell];
        let count = visits.load(Ordering::Relaxed);
        if count < FIRST_POINTS {
            visits.store(count + 1, Ordering::Relaxed);
        }
        count == FIRST_POINTS
    }

    fn candidates(&self, cell: usize) -> &[(Few, [u32; LANES])] {
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
        let step = ring[if k + 1 < ring.len() { k + 1 } else { 0 }] - ring[k];
        FieldEdge { start: ring[k], step, inverse: 1.0 / step.norm_squared().max(f64::MIN_POSITIVE) }
    })
}
