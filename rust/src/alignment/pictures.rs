//! Pictures of a photo that hold how much likelier it is with the image of an edge in a pixel than with none
//! (`docs/math.md`, eq. 18.6).

use std::array;

/// Directions across which edges are told apart, 45 degrees apart.
pub const DIRECTIONS: usize = 4;

/// The tangent of an eighth of half a turn: where one direction ends and the next begins.
const BETWEEN: f32 = 0.414_213_56;

/// Log likelihood ratios of an edge in each pixel, across each of four directions, by one spread of the edges.
#[derive(Debug, Clone)]
pub struct LogRatios {
    /// Of all directions of a pixel, row by row.
    values: Vec<[f32; DIRECTIONS]>,
    rows: usize,
    columns: usize,
    /// Pixels of the photo along the side of one of these.
    reduction: f64,
}

impl LogRatios {
    /// Those of pictures of so many rows and columns, one direction after the other, averaged over squares of `reduction` pixels.
    /// `None` where the values do not fill four pictures, or there are none.
    pub fn new(values: &[f32], rows: usize, columns: usize, reduction: usize) -> Option<Self> {
        let size = rows.checked_mul(columns)?;
        if size == 0 || reduction == 0 || values.len() != DIRECTIONS * size {
            return None;
        }
        let (down, right) = (rows.div_ceil(reduction), columns.div_ceil(reduction));
        let mut reduced = Vec::with_capacity(down * right);
        for row in 0..down {
            let rows = row * reduction..((row + 1) * reduction).min(rows);
            for column in 0..right {
                let columns_ = column * reduction..((column + 1) * reduction).min(columns);
                let count = (rows.len() * columns_.len()) as f32;
                reduced.push(array::from_fn(|direction| {
                    let picture = &values[direction * size..][..size];
                    let line = |row: usize| picture[row * columns..][columns_.clone()].iter().sum::<f32>();
                    rows.clone().map(line).sum::<f32>() / count
                }));
            }
        }
        Some(Self { values: reduced, rows: down, columns: right, reduction: reduction as f64 })
    }

    /// The value at a pixel of the photo for an edge that lies across a way, between those of the four pixels about it; `None` outside.
    #[inline(always)]
    pub(super) fn at(&self, pixel: [f32; 2], way: [f32; 2]) -> Option<f32> {
        let scale = (1.0 / self.reduction) as f32;
        let (x, y) = ((pixel[0] + 0.5) * scale - 0.5, (pixel[1] + 0.5) * scale - 0.5);
        // Fails for NaN, too.
        if !(x >= 0.0 && y >= 0.0 && x < (self.columns - 1) as f32 && y < (self.rows - 1) as f32) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (right, down) = (x - column as f32, y - row as f32);
        let top = row * self.columns + column;
        let direction = direction_of(way);
        let value = |place: usize| self.values[place][direction];
        let upper = value(top) * (1.0 - right) + value(top + 1) * right;
        let lower = value(top + self.columns) * (1.0 - right) + value(top + self.columns + 1) * right;
        Some(upper * (1.0 - down) + lower * down)
    }

    /// The value at a pixel of the photo across a direction, and its derivatives by the pixel's place; `None` outside.
    #[inline(always)]
    pub(super) fn with_slope(&self, pixel: [f32; 2], direction: usize) -> Option<(f32, [f32; 2])> {
        let scale = (1.0 / self.reduction) as f32;
        let (x, y) = ((pixel[0] + 0.5) * scale - 0.5, (pixel[1] + 0.5) * scale - 0.5);
        if !(x >= 0.0 && y >= 0.0 && x < (self.columns - 1) as f32 && y < (self.rows - 1) as f32) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (right, down) = (x - column as f32, y - row as f32);
        let top = row * self.columns + column;
        let value = |place: usize| self.values[place][direction];
        let (a, b, c, d) = (value(top), value(top + 1), value(top + self.columns), value(top + self.columns + 1));
        let (upper, lower) = (a + (b - a) * right, c + (d - c) * right);
        let slope = [(b - a) * (1.0 - down) + (d - c) * down, lower - upper];
        Some((upper + (lower - upper) * down, slope.map(|value| value * scale)))
    }
}

/// The number of the direction nearest to a way in the image, of those 45 degrees apart from x towards y; opposite ways have one.
#[inline(always)]
pub(super) fn direction_of([x, y]: [f32; 2]) -> usize {
    let (along_x, along_y) = (y.abs() <= BETWEEN * x.abs(), x.abs() < BETWEEN * y.abs());
    let slanted = if (x < 0.0) == (y < 0.0) { 1 } else { 3 };
    if along_x {
        0
    } else if along_y {
        2
    } else {
        slanted
    }
}
