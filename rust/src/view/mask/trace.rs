//! Contours of a mask between the runs of its rows (marching squares, Lorensen and Cline 1987).

use nalgebra::Vector2;

use super::pixels::{CONTOUR_LEVEL, Mask, MaskValue};
use super::scan::Runs;

/// Least distance (pixels) of a contour from a pixel's center: where the coverage there is the level itself, the contour
/// would pass the center on both sides and touch itself.
const CLEAR_OF_CENTERS_PX: f64 = 1e-10;

/// Extent (pixels) up to which a ring is the contour of one pixel at the level: a point.
const POINT_PX: f64 = 4.0 * CLEAR_OF_CENTERS_PX;

/// Distance (pixels) by which the border of the image lies outside the outermost centers.
const BEYOND_CENTERS_PX: f64 = 0.5;

/// Cells are numbered from the pixels this far before the first: one that the mask goes on for, and an empty one.
const MARGIN: usize = 2;

/// Closed contours (their first vertex repeated at the end) of a mask in pixels, from the runs of its rows from `top` on.
///
/// They come in the order of their first cells, row by row, and each begins where its last cell is left.
pub(super) fn contours<T: MaskValue>(mask: Mask<'_, T>, top: usize, runs: &Runs) -> Vec<Vec<Vector2<f64>>> {
    let mut tracer = Tracer::new(mask);
    let mut upper = Vec::new();
    let held = PaddedRows { runs, top, rows: mask.rows(), columns: mask.columns };
    for row in held.first()..=held.last() {
        let lower = held.changes(row);
        tracer.march(row - 1, &upper, &lower);
        upper = lower;
    }
    tracer.march(held.last(), &upper, &[]);
    tracer.segments.rings()
}

/// The rows of a mask as the contour sees them: the outermost rows and columns of the image once more outside of it.
struct PaddedRows<'a> {
    runs: &'a Runs,
    top: usize,
    rows: usize,
    columns: usize,
}

impl PaddedRows<'_> {
    fn first(&self) -> usize {
        self.top + MARGIN - usize::from(self.top == 0)
    }

    fn last(&self) -> usize {
        let bottom = self.top + self.runs.len();
        bottom - 1 + MARGIN + usize::from(bottom == self.rows)
    }

    /// Columns at which a padded row changes sides of the level.
    fn changes(&self, row: usize) -> Vec<usize> {
        let index = (row.max(MARGIN) - MARGIN).clamp(self.top, self.top + self.runs.len() - 1) - self.top;
        let moved = |&column: &usize| match column {
            0 => MARGIN - 1,
            last if last == self.columns => last + MARGIN + 1,
            other => other + MARGIN,
        };
        self.runs.row(index).iter().map(moved).collect()
    }
}

/// Whether the upper and the lower of two neighbors in a column are at or above the level.
type Column = [bool; 2];

/// A side of a cell that the contour crosses.
#[derive(Clone, Copy)]
enum Side {
    Top,
    Left,
    Bottom,
    Right,
}

/// The pieces of the contour in a cell, with the covered pixels to the same hand, from the left and the right column.
///
/// Where two corners across are covered, each has a piece of its own.
fn pieces(left: Column, right: Column) -> &'static [(Side, Side)] {
    use Side::{Bottom, Left, Right, Top};
    let corner = |covered: bool, bit: u8| u8::from(covered) << bit;
    match corner(left[0], 0) | corner(right[0], 1) | corner(left[1], 2) | corner(right[1], 3) {
        1 => &[(Top, Left)],
        2 => &[(Right, Top)],
        3 => &[(Right, Left)],
        4 => &[(Left, Bottom)],
        5 => &[(Top, Bottom)],
        6 => &[(Right, Top), (Left, Bottom)],
        7 => &[(Right, Bottom)],
        8 => &[(Bottom, Right)],
        9 => &[(Top, Left), (Bottom, Right)],
        10 => &[(Bottom, Top)],
        11 => &[(Bottom, Left)],
        12 => &[(Left, Right)],
        13 => &[(Top, Right)],
        14 => &[(Left, Top)],
        _ => &[],
    }
}

/// Marching squares under way, row of cells by row of cells.
struct Tracer<'a, T> {
    mask: Mask<'a, T>,
    segments: Segments,
    /// Vertices on the changes of the row above, in order, and on those of the row below.
    above: Vec<usize>,
    below: Vec<usize>,
}

impl<'a, T: MaskValue> Tracer<'a, T> {
    fn new(mask: Mask<'a, T>) -> Self {
        Self { mask, segments: Segments::default(), above: Vec::new(), below: Vec::new() }
    }

    /// Traces the cells between the padded rows `row` and `row + 1`, which change sides at these columns.
    fn march(&mut self, row: usize, upper: &[usize], lower: &[usize]) {
        self.above = std::mem::take(&mut self.below);
        let (mut up, mut low, mut top) = (upper, lower, 0);
        let (mut column, mut state, mut left) = (0, [false, false], 0);
        while let Some(&next) = up.first().into_iter().chain(low.first()).min() {
            if state[0] != state[1] {
                for straight in column..next - 1 {
                    left = self.cell(row, straight, [state, state], [usize::MAX, left]);
                }
            }
            let turned = [after(&mut up, next) != state[0], after(&mut low, next) != state[1]];
            let vertex = self.above.get(top).copied().unwrap_or(usize::MAX);
            left = self.cell(row, next - 1, [state, turned], [vertex, left]);
            top += usize::from(turned[0] != state[0]);
            (column, state) = (next, turned);
        }
    }

    /// Traces a cell whose upper left pixel is given, from the vertices on its top and left side; the one on its right.
    fn cell(&mut self, row: usize, column: usize, [left, right]: [Column; 2], [above, before]: [usize; 2]) -> usize {
        let mut vertices = [above, before, usize::MAX, usize::MAX];
        if left[1] != right[1] {
            vertices[Side::Bottom as usize] = self.vertex([row + 1, column], [row + 1, column + 1]);
            self.below.push(vertices[Side::Bottom as usize]);
        }
        if right[0] != right[1] {
            vertices[Side::Right as usize] = self.vertex([row, column + 1], [row + 1, column + 1]);
        }
        for &(from, to) in pieces(left, right) {
            self.segments.add(vertices[from as usize], vertices[to as usize]);
        }
        vertices[Side::Right as usize]
    }

    /// A new vertex where the coverage between two neighbors, each [row, column] of the padded mask, is at the level.
    fn vertex(&mut self, first: [usize; 2], second: [usize; 2]) -> usize {
        let (from, to) = (self.coverage(first), self.coverage(second));
        let share = ((CONTOUR_LEVEL - from) / (to - from)).clamp(CLEAR_OF_CENTERS_PX, 1.0 - CLEAR_OF_CENTERS_PX);
        let [y, x] = [0, 1].map(|axis| {
            let size = if axis == 0 { self.mask.rows() } else { self.mask.columns };
            let place = first[axis] as f64 - MARGIN as f64 + share * (second[axis] - first[axis]) as f64;
            place.clamp(-BEYOND_CENTERS_PX, size as f64 - BEYOND_CENTERS_PX)
        });
        self.segments.vertex(Vector2::new(x, y))
    }

    /// Coverage of a pixel of the padded mask.
    fn coverage(&self, [row, column]: [usize; 2]) -> f64 {
        let (rows, columns) = (self.mask.rows(), self.mask.columns);
        let is_outside = |place: usize, size: usize| place == 0 || place == size + 2 * MARGIN - 1;
        if is_outside(row, rows) || is_outside(column, columns) {
            return 0.0;
        }
        let inside = |place: usize, size: usize| place.saturating_sub(MARGIN).min(size - 1);
        self.mask.row(inside(row, rows))[inside(column, columns)].coverage()
    }
}

/// Whether a row changes sides at a column; a change there is taken off the front.
fn after(changes: &mut &[usize], column: usize) -> bool {
    match changes.split_first() {
        Some((&first, rest)) if first == column => {
            *changes = rest;
            true
        }
        _ => false,
    }
}

/// Pieces of contours in the order of their cells, row by row, each from one vertex to another.
#[derive(Default)]
struct Segments {
    vertices: Vec<Vector2<f64>>,
    /// For each vertex the piece that begins there: its number, and the vertex where it ends.
    leaving: Vec<(usize, usize)>,
    /// The vertex where each piece begins.
    begins: Vec<usize>,
}

impl Segments {
    fn vertex(&mut self, place: Vector2<f64>) -> usize {
        self.vertices.push(place);
        self.leaving.push((usize::MAX, usize::MAX));
        self.vertices.len() - 1
    }

    fn add(&mut self, from: usize, to: usize) {
        self.leaving[from] = (self.begins.len(), to);
        self.begins.push(from);
    }

    /// The closed contours, but for those that are a point.
    fn rings(&self) -> Vec<Vec<Vector2<f64>>> {
        let mut is_taken = vec![false; self.vertices.len()];
        let mut rings = Vec::new();
        for &begin in &self.begins {
            if !is_taken[begin] {
                let ring = self.ring(begin, &mut is_taken);
                rings.extend((extent(&ring) > POINT_PX).then_some(ring));
            }
        }
        rings
    }

    /// The contour through a vertex, from the end of its last piece on and back to it.
    fn ring(&self, begin: usize, is_taken: &mut [bool]) -> Vec<Vector2<f64>> {
        let mut ring = Vec::new();
        let (mut vertex, mut last, mut start) = (begin, 0, 0);
        while !is_taken[vertex] {
            is_taken[vertex] = true;
            let (number, next) = self.leaving[vertex];
            ring.push(self.vertices[vertex]);
            if number >= last {
                (last, start) = (number, ring.len());
            }
            vertex = next;
        }
        let count = ring.len();
        ring.rotate_left(start % count);
        ring.push(ring[0]);
        ring
    }
}

/// The larger side of the box around a ring, pixels.
fn extent(ring: &[Vector2<f64>]) -> f64 {
    let (low, high) = crate::geometry::rings::bounding_box(ring.iter().copied());
    (high - low).amax()
}
