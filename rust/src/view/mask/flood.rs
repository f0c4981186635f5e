//! Growth of a region over a picture: the least level at which a flood from a pixel arrives at each other one.

use crate::error::{Error, Result};

/// For each pixel of a picture, the least level at which it is connected with a start through pixels of that level at the most, over
/// sides and corners: the largest level on the best path. A morphological reconstruction by erosion whose marker is the start.
///
/// `levels`: row by row; `start`: the index of a pixel. Linear in pixels and levels: a queue for each level, as of Prim's spanning tree
/// with integer weights.
///
/// # Errors
/// For a picture without whole rows, and a start outside it.
pub fn flood_levels(levels: &[u16], columns: usize, start: usize) -> Result<Vec<u16>> {
    if columns == 0 || !levels.len().is_multiple_of(columns) || start >= levels.len() {
        return Err(Error::InvalidObservation {
            item: "the picture to flood",
            found: format!("{} pixels in rows of {columns}, flooded from pixel {start}", levels.len()),
            needed: "whole rows that hold it".into(),
        });
    }
    let rows = levels.len() / columns;
    let most = usize::from(levels.iter().copied().max().unwrap_or(0));
    let (mut arrivals, mut is_reached) = (levels.to_vec(), vec![false; levels.len()]);
    let mut queues: Vec<Vec<usize>> = vec![Vec::new(); most + 1];
    queues[usize::from(levels[start])].push(start);
    is_reached[start] = true;
    for level in levels[start]..=most as u16 {
        while let Some(pixel) = queues[usize::from(level)].pop() {
            let (row, column) = (pixel / columns, pixel % columns);
            for row in row.saturating_sub(1)..(row + 2).min(rows) {
                for column in column.saturating_sub(1)..(column + 2).min(columns) {
                    let other = row * columns + column;
                    if !is_reached[other] {
                        is_reached[other] = true;
                        arrivals[other] = levels[other].max(level);
                        queues[usize::from(arrivals[other])].push(other);
                    }
                }
            }
        }
    }
    Ok(arrivals)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The same by relaxation until nothing changes.
    fn relaxed(levels: &[u16], columns: usize, start: usize) -> Vec<u16> {
        let mut arrivals = vec![u16::MAX; levels.len()];
        arrivals[start] = levels[start];
        loop {
            let before = arrivals.clone();
            for (pixel, level) in levels.iter().enumerate() {
                let near = |&other: &usize| {
                    (pixel / columns).abs_diff(other / columns) <= 1 && (pixel % columns).abs_diff(other % columns) <= 1
                };
                let least = (0..levels.len()).filter(near).map(|other| arrivals[other]).min().unwrap_or(u16::MAX);
                arrivals[pixel] = arrivals[pixel].min(least.max(*level));
            }
            if arrivals == before {
                return arrivals;
            }
        }
    }

    proptest! {
        #[test]
        fn a_flood_arrives_at_the_largest_level_of_the_best_path(
            levels in prop::collection::vec(0_u16..12, 1..60), columns in 1_usize..9, start in 0_usize..60,
        ) {
            let whole = levels.len() / columns * columns;
            prop_assume!(whole > 0);
            let (levels, start) = (&levels[..whole], start % whole);
            prop_assert_eq!(flood_levels(levels, columns, start).unwrap(), relaxed(levels, columns, start));
        }
    }

    #[test]
    fn the_highest_levels_are_reached() {
        let arrivals = flood_levels(&[3, u16::MAX, 1, 0], 4, 0).unwrap();
        assert_eq!(arrivals, [3, u16::MAX, u16::MAX, u16::MAX]);
    }

    #[test]
    fn pictures_without_whole_rows_or_the_start_are_refused() {
        for (levels, columns, start) in [(&[0, 1, 2][..], 2, 0), (&[0, 1][..], 2, 2), (&[][..], 0, 0), (&[][..], 1, 0)]
        {
            assert!(matches!(flood_levels(levels, columns, start), Err(Error::InvalidObservation { .. })));
        }
    }
}
