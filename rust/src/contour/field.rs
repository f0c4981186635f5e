//! The nearest edge of closed rings to any point of their plane (`docs/math.md`, section 11).
//!
//! Rings never change while poses do: their edges are sorted into a grid once, and the nearest one is then a look-up and a few
//! distances. Points need not lie on any outline.

use nalgebra::Vector2;

/// Samples of the rings for each edge, and at least: enough that the nearest sample lies on the nearest edge or next to it.
const SAMPLES_PER_EDGE: usize = 3;
const FEWEST_SAMPLES: usize = 192;

/// Room around the rings that the grid covers, as a share of their extent; beyond, the cell at the rim serves.
const MARGIN: f64 = 0.15;

/// Cells along the longer side at most.
const MOST_CELLS: f64 = 128.0;

/// No sample.
const NONE: u32 = u32::MAX;

/// Closed rings, and for every place of their plane the nearest of their edges.
#[derive(Debug, Clone)]
pub struct EdgeField {
    edges: Vec<FieldEdge>,
    samples: Vec<Sample>,
    origin: Vector2<f64>,
    cell: f64,
    columns: usize,
    rows: usize,
    /// Where the samples of each cell begin; one more than there are cells.
    starts: Vec<u32>,
    /// A sample near each cell, for those that hold none.
    near: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct FieldEdge {
    start: Vector2<f64>,
    step: Vector2<f64>,
    inverse: f64,
    /// Indices of the edges before and after on the ring.
    around: [u32; 2],
}

impl FieldEdge {
    /// Squared distance of a point.
    fn square(&self, point: &Vector2<f64>) -> f64 {
        let offset = point - self.start;
        let share = (offset.dot(&self.step) * self.inverse).clamp(0.0, 1.0);
        (offset - self.step * share).norm_squared()
    }
}

#[derive(Debug, Clone, Copy)]
struct Sample {
    at: Vector2<f64>,
    edge: u32,
}

impl EdgeField {
    /// The field of closed rings; edges are counted ring after ring.
    pub fn new(rings: &[Vec<Vector2<f64>>]) -> Self {
        let edges = edges_of(rings);
        let length: f64 = edges.iter().map(|edge| edge.step.norm()).sum();
        let spacing = length / (SAMPLES_PER_EDGE * edges.len()).max(FEWEST_SAMPLES) as f64;
        let samples: Vec<Sample> = (0..).zip(&edges).flat_map(|(index, edge)| sampled(index, edge, spacing)).collect();
        let low = samples.iter().fold(Vector2::repeat(f64::INFINITY), |low, sample| low.inf(&sample.at));
        let high = samples.iter().fold(Vector2::repeat(f64::NEG_INFINITY), |high, sample| high.sup(&sample.at));
        let size = (high - low) * (1.0 + 2.0 * MARGIN);
        // About as many cells as samples, so that a cell on a ring holds a few.
        let cell = (size.x * size.y / samples.len() as f64).sqrt().max(size.max() / MOST_CELLS);
        let [columns, rows] = [size.x, size.y].map(|side| (side / cell).ceil() as usize + 1);
        let origin = low - (high - low) * MARGIN;
        let mut field = Self { edges, samples, origin, cell, columns, rows, starts: Vec::new(), near: Vec::new() };
        field.sort_into_cells();
        field.spread();
        field
    }

    fn sort_into_cells(&mut self) {
        let cell = |sample: &Sample| {
            let (column, row) = self.place_of(&sample.at);
            row * self.columns + column
        };
        let mut sorted: Vec<(usize, Sample)> = self.samples.iter().map(|sample| (cell(sample), *sample)).collect();
        sorted.sort_unstable_by_key(|(cell, sample)| (*cell, sample.edge));
        let mut starts = vec![0_u32; self.columns * self.rows + 1];
        sorted.iter().for_each(|(cell, _)| starts[cell + 1] += 1);
        for k in 1..starts.len() {
            starts[k] += starts[k - 1];
        }
        self.starts = starts;
        self.samples = sorted.into_iter().map(|(_, sample)| sample).collect();
    }

    /// Gives every cell a sample near it: its own, or the nearest of those that its neighbours have, from both corners.
    fn spread(&mut self) {
        let count = self.columns * self.rows;
        let first = |cell: usize| if self.starts[cell] < self.starts[cell + 1] { self.starts[cell] } else { NONE };
        self.near = (0..count).map(first).collect();
        for step in 0..count {
            self.near[step] = self.nearest_among_neighbours(step, -1);
        }
        for step in (0..count).rev() {
            self.near[step] = self.nearest_among_neighbours(step, 1);
        }
    }

    fn nearest_among_neighbours(&self, cell: usize, side: isize) -> u32 {
        let (column, row) = ((cell % self.columns) as isize, (cell / self.columns) as isize);
        let middle = self.origin + Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * self.cell;
        let square = |sample: u32| match self.samples.get(sample as usize) {
            None => f64::INFINITY,
            Some(sample) => (sample.at - middle).norm_squared(),
        };
        let mut best = self.near[cell];
        if self.starts[cell] < self.starts[cell + 1] {
            return best;
        }
        for (across, down) in [(side, 0), (-1, side), (0, side), (1, side)] {
            let (x, y) = (column + across, row + down);
            if (0..self.columns as isize).contains(&x) && (0..self.rows as isize).contains(&y) {
                let other = self.near[y as usize * self.columns + x as usize];
                if square(other) < square(best) {
                    best = other;
                }
            }
        }
        best
    }

    fn place_of(&self, point: &Vector2<f64>) -> (usize, usize) {
        let at = (point - self.origin) / self.cell;
        // A conversion from a float saturates, so that what lies outside has the cell at the rim.
        ((at.x as usize).min(self.columns - 1), (at.y as usize).min(self.rows - 1))
    }

    /// The edge nearest to a point, by its number.
    ///
    /// Next to the rings it is the nearest; from about a tenth of their extent on one point in fifty is given another, farther by
    /// less than a seventh of the extent, and beyond the grid one that is farther by less than half of it.
    pub fn nearest_edge(&self, point: &Vector2<f64>) -> usize {
        let (column, row) = self.place_of(point);
        let start = self.near[row * self.columns + column];
        let mut best = ((self.samples[start as usize].at - point).norm_squared(), start);
        let at = (point - self.origin) / self.cell - Vector2::new(column as f64, row as f64);
        let gaps =
            [[at.x, 0.0, 1.0 - at.x], [at.y, 0.0, 1.0 - at.y]].map(|gaps| gaps.map(|gap| (gap * self.cell).max(0.0)));
        for (across, down) in [(1, 1), (1, 0), (0, 1), (2, 1), (1, 2), (0, 0), (2, 0), (0, 2), (2, 2)] {
            let (x, y) = ((column + across).wrapping_sub(1), (row + down).wrapping_sub(1));
            let gap = gaps[0][across].powi(2) + gaps[1][down].powi(2);
            if gap < best.0 && x < self.columns && y < self.rows {
                self.look_into(y * self.columns + x, point, &mut best);
            }
        }
        self.nearest_around(self.samples[best.1 as usize].edge, point)
    }

    fn look_into(&self, cell: usize, point: &Vector2<f64>, best: &mut (f64, u32)) {
        for index in self.starts[cell]..self.starts[cell + 1] {
            let square = (self.samples[index as usize].at - point).norm_squared();
            if square < best.0 {
                *best = (square, index);
            }
        }
    }

    /// The nearest of the edges from one on along its ring, for as long as they come nearer.
    fn nearest_around(&self, edge: u32, point: &Vector2<f64>) -> usize {
        let mut best = (self.edges[edge as usize].square(point), edge);
        for way in [0, 1] {
            loop {
                let next = self.edges[best.1 as usize].around[way];
                let square = self.edges[next as usize].square(point);
                if square >= best.0 {
                    break;
                }
                best = (square, next);
            }
        }
        best.1 as usize
    }
}

fn edges_of(rings: &[Vec<Vector2<f64>>]) -> Vec<FieldEdge> {
    let mut edges = Vec::with_capacity(rings.iter().map(Vec::len).sum());
    for ring in rings {
        let (first, count) = (edges.len(), ring.len());
        edges.extend((0..count).map(|k| {
            let step = ring[(k + 1) % count] - ring[k];
            let around = [count - 1, 1].map(|by| (first + (k + by) % count) as u32);
            FieldEdge { start: ring[k], step, inverse: 1.0 / step.norm_squared().max(f64::MIN_POSITIVE), around }
        }));
    }
    edges
}

/// Samples in the middles of equal parts of an edge, at most `spacing` apart.
fn sampled(index: u32, edge: &FieldEdge, spacing: f64) -> impl Iterator<Item = Sample> + use<> {
    let count = (edge.step.norm() / spacing).ceil().max(1.0);
    let (start, step) = (edge.start, edge.step);
    (0..count as usize).map(move |k| Sample { at: start + step * ((k as f64 + 0.5) / count), edge: index })
}
