//! Pictures of a photo that hold how much likelier it is with the image of an edge in a pixel than with none
//! (`docs/math.md`, eq. 18.6).

use super::groups::{Floats, GROUP, Numbers, ZEROS, whole};

/// Directions across which edges are told apart, 45 degrees apart.
pub const DIRECTIONS: usize = 4;

/// The tangent of an eighth of half a turn: where one direction ends and the next begins.
const BETWEEN: f32 = 0.414_213_56;

/// Log likelihood ratios of an edge in each pixel, across each of four directions, by one spread of the edges.
#[derive(Debug, Clone)]
pub struct LogRatios {
    /// Of all directions of a pixel, row by row; and a row and a pixel more, so that four lie about any.
    values: Vec<f32>,
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
        let mut reduced = Vec::with_capacity(DIRECTIONS * (down * right + right + 1));
        for row in 0..down {
            let rows = row * reduction..((row + 1) * reduction).min(rows);
            for column in 0..right {
                let columns_ = column * reduction..((column + 1) * reduction).min(columns);
                let count = (rows.len() * columns_.len()) as f32;
                reduced.extend(values.chunks(size).map(|picture| {
                    let line = |row: usize| picture[row * columns..][columns_.clone()].iter().sum::<f32>();
                    rows.clone().map(line).sum::<f32>() / count
                }));
            }
        }
        reduced.resize(DIRECTIONS * (down * right + right + 1), 0.0);
        Some(Self { values: reduced, rows: down, columns: right, reduction: reduction as f64 })
    }

    /// What the four pixels about each of some pixels of the photo hold across directions.
    #[inline(always)]
    pub(super) fn around(&self, pixels: &[Floats; 2], directions: &Numbers) -> Around {
        let scale = (1.0 / self.reduction) as f32;
        let (columns, rows) = ((self.columns - 1) as f32, (self.rows - 1) as f32);
        let mut around = Around { shown: [0; GROUP], right: ZEROS, down: ZEROS, corners: [ZEROS; 4], scale };
        let mut places = [0; GROUP];
        for edge in 0..GROUP {
            let (x, y) = ((pixels[0][edge] + 0.5) * scale - 0.5, (pixels[1][edge] + 0.5) * scale - 0.5);
            // Fails for NaN, too.
            let shown = (x >= 0.0) & (y >= 0.0) & (x < columns) & (y < rows);
            let (column, row) = (whole(x, columns), whole(y, rows));
            around.shown[edge] = i32::from(shown);
            around.right[edge] = x - column as f32;
            around.down[edge] = y - row as f32;
            let place = (row * self.columns as i32 + column) * DIRECTIONS as i32 + directions[edge];
            // Memory is slow: what is not shown all lies in one place.
            places[edge] = if shown { place } else { 0 };
        }
        for edge in 0..GROUP {
            let top = &self.values[places[edge] as usize..];
            let bottom = &top[DIRECTIONS * self.columns..];
            let corners = [top[0], top[DIRECTIONS], bottom[0], bottom[DIRECTIONS]];
            for (held, value) in around.corners.iter_mut().zip(corners) {
                held[edge] = value;
            }
        }
        around
    }
}

/// What the four pixels about each of some places hold, and where among them these lie.
pub(super) struct Around {
    /// Whether the photo shows a place: 1, else 0.
    pub(super) shown: Numbers,
    /// From 0 to 1.
    right: Floats,
    down: Floats,
    /// Row by row.
    corners: [Floats; 4],
    /// Reduced pixels in a pixel.
    scale: f32,
}

impl Around {
    /// The values at the places; of those that are not shown some others.
    #[inline(always)]
    pub(super) fn values(&self) -> Floats {
        let ([a, b, c, d], mut values) = (&self.corners, ZEROS);
        for edge in 0..GROUP {
            let upper = a[edge] + (b[edge] - a[edge]) * self.right[edge];
            let lower = c[edge] + (d[edge] - c[edge]) * self.right[edge];
            values[edge] = upper + (lower - upper) * self.down[edge];
        }
        values
    }

    /// The derivatives of the values by the pixels' places.
    #[inline(always)]
    pub(super) fn slopes(&self) -> [Floats; 2] {
        let ([a, b, c, d], mut slopes) = (&self.corners, [ZEROS; 2]);
        for edge in 0..GROUP {
            let (right, down) = (self.right[edge], self.down[edge]);
            let by_x = (b[edge] - a[edge]) * (1.0 - down) + (d[edge] - c[edge]) * down;
            let by_y = (c[edge] - a[edge]) * (1.0 - right) + (d[edge] - b[edge]) * right;
            slopes[0][edge] = by_x * self.scale;
            slopes[1][edge] = by_y * self.scale;
        }
        slopes
    }

    /// How many places the photo shows.
    #[inline(always)]
    pub(super) fn count(&self) -> usize {
        self.shown.iter().sum::<i32>() as usize
    }
}

/// The numbers of the directions nearest to ways in the image, of those 45 degrees apart from x towards y; opposite ways have one.
#[inline(always)]
pub(super) fn directions_of(ways: &[Floats; 2]) -> Numbers {
    let mut directions = [0; GROUP];
    for edge in 0..GROUP {
        let (x, y) = (ways[0][edge], ways[1][edge]);
        let slanted = if (x < 0.0) == (y < 0.0) { 1 } else { 3 };
        let steep = if x.abs() < BETWEEN * y.abs() { 2 } else { slanted };
        directions[edge] = if y.abs() <= BETWEEN * x.abs() { 0 } else { steep };
    }
    directions
}
