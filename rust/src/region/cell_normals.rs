//! Normals of the points in the cells of a grid on a plane.

use nalgebra::{Matrix3, Vector3};

/// Points in and around a cell below which its normal is unknown.
const MIN_IN_BLOCK: usize = 4;

/// Number of a cell without points.
const EMPTY: u32 = u32::MAX;

/// How many points, the sum of their offsets from the first one, and of their products.
#[derive(Clone, Copy)]
struct Sums {
    count: usize,
    places: Vector3<f64>,
    products: Matrix3<f64>,
}

/// Cells of a grid, row by row, with points whose normal, taken with those of the cells around, is within an angle of the third axis, or
/// unknown for too few of them.
///
/// The normal is the direction of least spread of the points in the block of nine cells. `cells`: the row and column of each point.
/// A point without a cell of the grid is left out.
pub fn cells_along(points: &[Vector3<f64>], cells: &[[usize; 2]], shape: [usize; 2], max_angle: f64) -> Vec<bool> {
    let [rows, columns] = shape;
    let mut number = vec![EMPTY; rows * columns];
    let mut sums: Vec<([usize; 2], Sums)> = Vec::new();
    for (place, &[row, column]) in points.iter().zip(cells) {
        if row >= rows || column >= columns {
            continue;
        }
        let own = &mut number[row * columns + column];
        if *own == EMPTY {
            *own = sums.len() as u32;
            sums.push(([row, column], Sums { count: 0, places: Vector3::zeros(), products: Matrix3::zeros() }));
        }
        let (_, sum) = &mut sums[*own as usize];
        sum.count += 1;
        sum.places += place;
        sum.products += place * place.transpose();
    }
    let block = |[row, column]: [usize; 2]| {
        let around = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        let cells = around(row, rows).flat_map(|row| around(column, columns).map(move |column| row * columns + column));
        let filled = cells.filter_map(|cell| sums.get(number[cell] as usize));
        filled.fold(Sums { count: 0, places: Vector3::zeros(), products: Matrix3::zeros() }, |all, (_, sum)| Sums {
            count: all.count + sum.count,
            places: all.places + sum.places,
            products: all.products + sum.products,
        })
    };
    let mut is_along = vec![false; rows * columns];
    for &(cell, _) in &sums {
        let Sums { count, places, products } = block(cell);
        is_along[cell[0] * columns + cell[1]] = count < MIN_IN_BLOCK || {
            let mean = places / count as f64;
            let eigen = (products / count as f64 - mean * mean.transpose()).symmetric_eigen();
            eigen.eigenvectors.column(eigen.eigenvalues.imin())[2].abs() >= max_angle.cos()
        };
    }
    is_along
}
