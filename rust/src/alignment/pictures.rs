//! Log likelihood ratios of a photo's pixels: with the image of an edge in a pixel against none (`docs/math.md`, eq. 18.2).

use super::groups::{Floats, GROUP, Numbers, ZEROS, whole};

/// Number of edge orientations, 45 degrees apart.
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
    /// Log likelihood ratios of `rows` by `columns` pixels, one direction after the other, averaged over squares of `reduction` pixels.
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

    /// Values of the four pixels about each given pixel of the photo, across directions.
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

/// Values of the four pixels about each given place, and the place among them.
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

#[cfg(test)]
mod tests {
    use std::array;
    use std::f32::consts::{FRAC_PI_4, TAU};

    use proptest::prelude::*;

    use super::*;

    /// Pictures that rise along both axes, differently by direction.
    fn sloped(rows: usize, columns: usize) -> Vec<f32> {
        let value = |direction: usize, row: usize, column: usize| {
            (direction + 1) as f32 * (0.5 * column as f32 - 0.25 * row as f32) + direction as f32
        };
        let line = |direction, row| (0..columns).map(move |column| value(direction, row, column));
        (0..DIRECTIONS).flat_map(|direction| (0..rows).flat_map(move |row| line(direction, row))).collect()
    }

    /// The value at a pixel and its slope, `None` where it is not shown: of every other edge of a group, the rest being nowhere.
    fn at(made: &LogRatios, pixel: [f32; 2], direction: usize) -> Option<(f32, [f32; 2])> {
        let pixels = pixel.map(|value| array::from_fn(|edge| if edge % 2 == 0 { value } else { f32::NAN }));
        let around = made.around(&pixels, &[direction as i32; GROUP]);
        let (values, slopes) = (around.values(), around.slopes());
        let is_shown = around.shown[0] == 1;
        for (edge, shown) in around.shown.into_iter().enumerate() {
            assert_eq!(shown, i32::from(is_shown && edge % 2 == 0), "{edge}");
            if shown == 1 {
                assert_eq!((values[edge], slopes[0][edge], slopes[1][edge]), (values[0], slopes[0][0], slopes[1][0]));
            }
        }
        assert_eq!(around.count(), if is_shown { GROUP / 2 } else { 0 });
        is_shown.then(|| (values[0], slopes.map(|along| along[0])))
    }

    /// The direction of a way, which all edges of a group have.
    fn direction_of(way: [f32; 2]) -> usize {
        let directions = directions_of(&way.map(|value| [value; GROUP]));
        assert_eq!(directions, [directions[0]; GROUP]);
        directions[0] as usize
    }

    #[test]
    fn what_does_not_fill_four_pictures_is_none() {
        for (values, rows, columns, reduction) in
            [(48, 3, 4, 0), (47, 3, 4, 1), (0, 0, 4, 1), (0, 3, 0, 1), (4, usize::MAX, 2, 1), (4, 1 << 32, 1 << 32, 1)]
        {
            assert!(LogRatios::new(&vec![0.0; values], rows, columns, reduction).is_none());
        }
        assert!(LogRatios::new(&[0.0; 48], 3, 4, 100).is_some());
    }

    /// Squares at the right and lower sides are of fewer pixels.
    #[test]
    fn reduced_pictures_hold_means_of_squares() {
        let (rows, columns) = (7, 11);
        let values = sloped(rows, columns);
        for reduction in [1, 2, 3, 4, 20] {
            let made = LogRatios::new(&values, rows, columns, reduction).unwrap();
            assert_eq!((made.rows, made.columns), (rows.div_ceil(reduction), columns.div_ceil(reduction)));
            let held = made.values.chunks(DIRECTIONS).take(made.rows * made.columns);
            assert_eq!(held.len(), made.rows * made.columns);
            for (place, found) in held.enumerate() {
                let (down, right) = (place / made.columns * reduction, place % made.columns * reduction);
                for (direction, found) in found.iter().enumerate() {
                    let square = (down..rows.min(down + reduction)).flat_map(|row| {
                        (right..columns.min(right + reduction))
                            .map(move |column| (direction * rows + row) * columns + column)
                    });
                    let (sum, count) = square.fold((0.0, 0.0), |(sum, count), at| (sum + values[at], count + 1.0));
                    assert!((found - sum / count).abs() < 1e-4, "{reduction}: {found}");
                }
            }
        }
    }

    proptest! {
        /// Between pixels' centers, the first of which is at 0 whatever the reduction; a plane is met exactly.
        #[test]
        fn values_between_pixels_are_on_the_plane_through_them(
            x in -2.0..41.0_f32,
            y in -2.0..25.0_f32,
            direction in 0..DIRECTIONS,
            reduction in 1..5_usize,
        ) {
            let (rows, columns) = (24, 36);
            let made = LogRatios::new(&sloped(rows, columns), rows, columns, reduction).unwrap();
            let margin = 0.5 * (reduction as f32 - 1.0);
            let beyond = |at: f32, count: usize| (margin - at).max(at - (count as f32 - 1.0 - margin));
            let outside = beyond(x, columns).max(beyond(y, rows));
            let found = at(&made, [x, y], direction);
            if outside > 1e-3 && reduction != 1 && columns % reduction + rows % reduction > 0 {
                // The last square is of fewer pixels, and its middle elsewhere.
                return Ok(());
            }
            prop_assert!(outside.abs() < 1e-3 || found.is_some() == (outside < 0.0), "{found:?} {outside}");
            let Some((found, slope)) = found else { return Ok(()) };
            let rise = (direction + 1) as f32;
            let is_whole = x < 30.0 && y < 18.0;
            let expected = rise * (0.5 * x - 0.25 * y) + direction as f32;
            prop_assert!(!is_whole || (found - expected).abs() < 1e-3, "{found} {expected}");
            let error = (slope[0] - 0.5 * rise).abs().max((slope[1] + 0.25 * rise).abs());
            prop_assert!(!is_whole || error < 1e-3, "{slope:?}");
        }

        /// A curved picture: the slope is the derivative of what is between the pixels, and the corners are the pixels.
        #[test]
        fn slopes_are_those_of_the_values(x in 0.1..10.9_f32, y in 0.1..6.9_f32, seed in 0..1000_u32) {
            let value = |place: u32| ((place.wrapping_mul(747_796_405).wrapping_add(seed) >> 7) % 1000) as f32 / 500.0 - 1.0;
            let values: Vec<f32> = (0..4 * 96).map(value).collect();
            let made = LogRatios::new(&values, 8, 12, 1).unwrap();
            let step = 1e-2;
            let is_inside = |at: f32| at.fract() > step && at.fract() < 1.0 - step;
            prop_assume!(is_inside(x) && is_inside(y));
            let value = |x: f32, y: f32| at(&made, [x, y], 2).unwrap().0;
            let (_, slope) = at(&made, [x, y], 2).unwrap();
            prop_assert!((slope[0] - (value(x + step, y) - value(x - step, y)) / (2.0 * step)).abs() < 1e-3);
            prop_assert!((slope[1] - (value(x, y + step) - value(x, y - step)) / (2.0 * step)).abs() < 1e-3);
            let corner = value(x.floor(), y.floor());
            prop_assert_eq!(corner, values[2 * 96 + y as usize * 12 + x as usize]);
        }

        #[test]
        fn directions_are_the_nearest_of_four(angle in 0.0..TAU, length in 1e-6..1e6_f32) {
            let eighths = angle / FRAC_PI_4;
            // Rounding decides half-way between two.
            prop_assume!((eighths.fract() - 0.5).abs() > 1e-4);
            let found = direction_of([length * angle.cos(), length * angle.sin()]);
            prop_assert_eq!(found, eighths.round() as usize % DIRECTIONS);
            prop_assert_eq!(direction_of([-length * angle.cos(), -length * angle.sin()]), found);
        }
    }

    #[test]
    fn ways_along_the_axes_have_their_directions() {
        for (way, direction) in
            [([1.0, 0.0], 0), ([-1.0, -0.0], 0), ([0.0, 1.0], 2), ([-0.0, -1.0], 2), ([1.0, 1.0], 1)]
        {
            assert_eq!(direction_of(way), direction);
        }
        assert_eq!(direction_of([-1.0, 1.0]), 3);
    }

    #[test]
    fn there_is_nothing_outside_and_at_no_pixel() {
        let made = LogRatios::new(&sloped(6, 9), 6, 9, 1).unwrap();
        for pixel in [[-0.01, 2.0], [8.0, 2.0], [3.0, 5.0], [f32::NAN, 2.0], [3.0, f32::INFINITY]] {
            assert!(at(&made, pixel, 0).is_none(), "{pixel:?}");
        }
        // A picture of one row has no pixels to be between.
        assert!(at(&LogRatios::new(&[1.0; 36], 1, 9, 1).unwrap(), [3.0, 0.0], 0).is_none());
    }
}
