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
    // Within a border that is reached from the beginning, all pixels have eight others around them.
    let width = columns + 2;
    let framed = |pixel: usize| (pixel / columns + 1) * width + pixel % columns + 1;
    let mut arrivals = vec![0; (levels.len() / columns + 2) * width];
    let mut is_reached = vec![true; arrivals.len()];
    for (row, values) in levels.chunks_exact(columns).enumerate() {
        let inside = framed(row * columns)..framed(row * columns) + columns;
        arrivals[inside.clone()].copy_from_slice(values);
        is_reached[inside].fill(false);
    }
    let most = usize::from(levels.iter().copied().max().unwrap_or(0));
    let mut queues: Vec<Vec<usize>> = vec![Vec::new(); most + 1];
    queues[usize::from(levels[start])].push(framed(start));
    is_reached[framed(start)] = true;
    for level in levels[start]..=most as u16 {
        while let Some(pixel) = queues[usize::from(level)].pop() {
            let first = pixel - width - 1;
            for row in [first, first + width, first + 2 * width] {
                for other in row..row + 3 {
                    if !is_reached[other] {
                        is_reached[other] = true;
                        arrivals[other] = arrivals[other].max(level);
                        queues[usize::from(arrivals[other])].push(other);
                    }
                }
            }
        }
    }
    let rows = arrivals.chunks_exact(width).skip(1).take(levels.len() / columns);
    Ok(rows.flat_map(|row| &row[1..=columns]).copied().collect())
}

/// How many steps each color (three of each pixel) lies from one, rounded up, no more than `most`.
pub fn color_levels(colors: &[f32], from: [f32; 3], step: f32, most: u16) -> Vec<u16> {
    let of = |color: &[f32]| {
        let square: f32 = (0..3).map(|k| (color[k] - from[k]).powi(2)).sum();
        let steps = (square.sqrt() / step).min(f32::from(most));
        // `ceil` is a call where the machine's instructions are those of all.
        let whole = steps as i32;
        whole as u16 + u16::from(steps > whole as f32)
    };
    colors.chunks_exact(3).map(of).collect()
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

    #[test]
    fn levels_are_steps_of_distance_rounded_up() {
        let colors = [0.0, 0.0, 0.0, 3.0, 4.0, 0.0, 0.0, 0.0, 5.1, 60.0, 0.0, 0.0];
        assert_eq!(color_levels(&colors, [0.0; 3], 1.0, 50), [0, 5, 6, 50]);
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
