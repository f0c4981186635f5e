//! The outlines of a region that grows: how much of them each level draws, and the contrast across.

use crate::error::{Error, Result};

/// Of the outlines of all regions {arrival <= k}, k from zero to below `count`: the sums over pixel edges of the contrast across, and
/// the numbers of edges.
///
/// `arrivals` as of [`flood_levels`](super::flood_levels), row by row; `colors`: three of each pixel. An edge lies on the outlines from
/// the smaller arrival beside it to below the larger; its contrast is the distance of the colors a pixel beyond its own two, so that
/// pixels that mix both sides don't weaken it.
///
/// # Errors
/// For a picture without whole rows, and other numbers of colors than three of each pixel.
pub fn outline_sums(arrivals: &[u16], colors: &[f32], columns: usize, count: usize) -> Result<(Vec<f64>, Vec<f64>)> {
    if columns == 0 || !arrivals.len().is_multiple_of(columns) || colors.len() != 3 * arrivals.len() {
        return Err(Error::InvalidObservation {
            item: "the picture of a region's outlines",
            found: format!("{} pixels in rows of {columns}, {} color values", arrivals.len(), colors.len()),
            needed: "whole rows, and three color values of each pixel".into(),
        });
    }
    let rows = arrivals.len() / columns;
    let (mut contrasts, mut lengths) = (vec![0.0; count + 1], vec![0.0; count + 1]);
    let mut add = |[before, first, second, beyond]: [usize; 4]| {
        let (inner, outer) = (arrivals[first].min(arrivals[second]), arrivals[first].max(arrivals[second]));
        if inner < outer {
            let square: f32 = (0..3).map(|k| (colors[3 * beyond + k] - colors[3 * before + k]).powi(2)).sum();
            let (from, to) = (usize::from(inner).min(count), usize::from(outer).min(count));
            let contrast = f64::from(square.sqrt());
            contrasts[from] += contrast;
            contrasts[to] -= contrast;
            lengths[from] += 1.0;
            lengths[to] -= 1.0;
        }
    };
    for row in 0..rows {
        let start = row * columns;
        for column in 1..columns {
            let beyond = (column + 1).min(columns - 1);
            add([column.saturating_sub(2), column - 1, column, beyond].map(|column| start + column));
        }
        if row > 0 {
            let [before, above, below, beyond] =
                [row.saturating_sub(2), row - 1, row, (row + 1).min(rows - 1)].map(|row| row * columns);
            for column in 0..columns {
                add([before + column, above + column, below + column, beyond + column]);
            }
        }
    }
    Ok((summed(contrasts, count), summed(lengths, count)))
}

/// The sums of the first ones up to each.
fn summed(mut values: Vec<f64>, count: usize) -> Vec<f64> {
    for level in 1..values.len() {
        values[level] += values[level - 1];
    }
    values.truncate(count);
    values
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn each_region_has_the_edges_of_its_own_outline(
            arrivals in prop::collection::vec(0_u16..8, 1..60), columns in 1_usize..9, count in 1_usize..9, seed in 0_usize..97,
        ) {
            let rows = arrivals.len() / columns;
            prop_assume!(rows > 0);
            let arrivals = &arrivals[..rows * columns];
            let colors: Vec<f32> = (0..3 * arrivals.len()).map(|k| ((k + seed) * (k + 3 * seed) % 101) as f32).collect();
            let (contrasts, lengths) = outline_sums(arrivals, &colors, columns, count).unwrap();
            for level in 0..count {
                let is_in = |pixel: usize| usize::from(arrivals[pixel]) <= level;
                let clamped = |row: isize, column: isize| {
                    row.clamp(0, rows as isize - 1) as usize * columns + column.clamp(0, columns as isize - 1) as usize
                };
                let (mut contrast, mut length) = (0.0, 0.0);
                for (down, right) in [(0, 1), (1, 0)] {
                    for (row, column) in (0..rows as isize - down).flat_map(|row| (0..columns as isize - right).map(move |column| (row, column))) {
                        if is_in(clamped(row, column)) != is_in(clamped(row + down, column + right)) {
                            let ends = [clamped(row - down, column - right), clamped(row + 2 * down, column + 2 * right)];
                            let of = |k: usize| f64::from(colors[3 * ends[1] + k]) - f64::from(colors[3 * ends[0] + k]);
                            contrast += (of(0).powi(2) + of(1).powi(2) + of(2).powi(2)).sqrt();
                            length += 1.0;
                        }
                    }
                }
                prop_assert!((contrasts[level] - contrast).abs() <= 1e-5 * (1.0 + contrast));
                prop_assert_eq!(lengths[level], length);
            }
        }
    }

    #[test]
    fn pictures_without_whole_rows_or_colors_are_refused() {
        for (pixels, colors, columns) in [(3, 9, 2), (2, 5, 2), (1, 3, 0)] {
            let sums = outline_sums(&vec![0; pixels], &vec![0.0; colors], columns, 4);
            assert!(matches!(sums, Err(Error::InvalidObservation { .. })));
        }
    }
}
