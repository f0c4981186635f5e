//! A picture spread by a kernel that is the same to all sides (`docs/math.md`, eq. 18.2).

use std::array;

use crate::math::lanes::{NullaryFnOnce, vectorized};

/// A picture of so many columns, row by row, spread down the columns and then along the rows; mirrored beyond its sides.
///
/// `weights`: of the pixel itself, and of those that are 1, 2, ... pixels away to either side; none leave the picture as it is.
/// Sums are taken in f64, from the farthest pixels to the nearest, what is between both in f32. Values that do not fill the last row are
/// left out.
pub fn blurred(values: &[f32], columns: usize, weights: &[f64]) -> Vec<f32> {
    match weights {
        [] => values.to_vec(),
        _ if columns == 0 => Vec::new(),
        [middle, beside @ ..] => vectorized(Blur { values, columns, middle: *middle, beside }),
    }
}

/// Pixels that are summed at once: as many as the machine's registers hold.
const GROUP: usize = 16;

struct Blur<'a> {
    values: &'a [f32],
    columns: usize,
    middle: f64,
    beside: &'a [f64],
}

impl NullaryFnOnce for Blur<'_> {
    type Output = Vec<f32>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let (columns, reach) = (self.columns, self.beside.len());
        let (groups, rows) = (columns.div_ceil(GROUP), self.values.len() / columns);
        let picture = filled(self.values, columns);
        let mut spread = Vec::with_capacity(rows * columns);
        let mut down = vec![0.0; GROUP * groups];
        let mut line = vec![0.0; GROUP * groups + 2 * reach];
        let (around, beside) = (mirrored(reach, rows), mirrored(reach, columns));
        for about in around.windows(2 * reach + 1) {
            for (group, sums) in down.as_chunks_mut().0.iter_mut().enumerate() {
                self.sum(|place| &picture[groups * about[place] + group], sums);
            }
            for (value, column) in line.iter_mut().zip(&beside) {
                *value = down[*column];
            }
            for start in (0..columns).step_by(GROUP) {
                let mut sums = [0.0; GROUP];
                self.sum(|place| line[start + place..].first_chunk().expect("a group"), &mut sums);
                spread.extend_from_slice(&sums[..GROUP.min(columns - start)]);
            }
        }
        spread
    }
}

impl Blur<'_> {
    /// The weighted sums of groups of pixels, from the first that the weights reach to the last.
    #[inline(always)]
    fn sum<'b>(&self, at: impl Fn(usize) -> &'b [f32; GROUP], sums: &mut [f32; GROUP]) {
        let reach = self.beside.len();
        let (mut totals, middle) = ([0.0; GROUP], at(reach));
        for k in 0..GROUP {
            totals[k] = f64::from(middle[k]) * self.middle;
        }
        for way in (1..=reach).rev() {
            let (before, after, weight) = (at(reach - way), at(reach + way), self.beside[way - 1]);
            for k in 0..GROUP {
                totals[k] += (f64::from(before[k]) + f64::from(after[k])) * weight;
            }
        }
        for k in 0..GROUP {
            sums[k] = totals[k] as f32;
        }
    }
}

/// The groups of each row, filled up with 0.
fn filled(values: &[f32], columns: usize) -> Vec<[f32; GROUP]> {
    let groups = values.chunks_exact(columns).flat_map(|row| row.chunks(GROUP));
    let whole = |part: &[f32]| array::from_fn(|place| part.get(place).copied().unwrap_or(0.0));
    groups.map(whole).collect()
}

/// The numbers of so many items, and of those that as many places before and after as the weights reach show in the mirror.
fn mirrored(reach: usize, count: usize) -> Vec<usize> {
    let places = -(reach as isize)..(count + reach) as isize;
    let turned = |place: isize| place.rem_euclid(2 * count as isize) as usize;
    if count == 0 { Vec::new() } else { places.map(turned).map(|place| place.min(2 * count - 1 - place)).collect() }
}
