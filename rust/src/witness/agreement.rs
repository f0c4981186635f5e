//! How far depth steps lie on a photo's edges, at a pose and turned from it (`docs/math.md`, eq. 18.3).

use nalgebra::{SMatrix, Vector2, Vector3, Vector6};

/// The strength of a photo's edges across some directions, one picture after the other, row by row.
#[derive(Debug, Clone, Copy)]
pub struct EdgeStrength<'a> {
    values: &'a [f32],
    rows: usize,
    columns: usize,
}

/// Where a step is seen: its pixel, how a change of the pose moves that, and the picture that shows edges across it.
///
/// Of three components the change turns the camera alone, by a rotation vector about its axes, rad; of six it is a left increment,
/// a rotation vector and a translation, meters.
#[derive(Debug, Clone, Copy)]
pub struct SeenStep<const D: usize> {
    /// x, y; the center of the first pixel is (0, 0).
    pub pixel: Vector2<f64>,
    /// Derivatives by the change, pixels a radian and pixels a meter.
    pub moved: SMatrix<f64, 2, D>,
    /// Number of the direction.
    pub direction: usize,
}

impl<'a> EdgeStrength<'a> {
    /// Pictures of so many rows and columns each; `None` where the values do not fill them, or there are none.
    pub fn new(values: &'a [f32], rows: usize, columns: usize) -> Option<Self> {
        let size = rows.checked_mul(columns)?;
        (size > 0 && !values.is_empty() && values.len().is_multiple_of(size)).then_some(Self { values, rows, columns })
    }

    /// Number of directions.
    pub fn directions(&self) -> usize {
        self.values.len() / (self.rows * self.columns)
    }

    /// The strength at a pixel; at the nearest one of the photo where it lies outside.
    fn at(&self, direction: usize, x: f64, y: f64) -> f64 {
        // The cast of a float saturates, and takes NaN for 0.
        let column = ((x + 0.5) as usize).min(self.columns - 1);
        let row = ((y + 0.5) as usize).min(self.rows - 1);
        f64::from(self.values[(direction * self.rows + row) * self.columns + column])
    }

    /// The sum of values under the steps at an increment of the pose, and its derivatives.
    ///
    /// Values between pixels follow from the four about them; steps outside the pictures count as 0.
    pub fn sum(&self, steps: &[SeenStep<6>], increment: &Vector6<f64>) -> (f64, Vector6<f64>) {
        let (mut sum, mut slope) = (0.0, Vector6::zeros());
        for step in steps.iter().filter(|step| step.direction < self.directions()) {
            if let Some((value, by_pixel)) = self.between(step.direction, step.pixel + step.moved * increment) {
                sum += value;
                slope += step.moved.tr_mul(&by_pixel);
            }
        }
        (sum, slope)
    }

    /// The value between pixels and its derivatives; `None` outside.
    fn between(&self, direction: usize, place: Vector2<f64>) -> Option<(f64, Vector2<f64>)> {
        let last = Vector2::new(self.columns as f64 - 1.0, self.rows as f64 - 1.0);
        if !(place.x >= 0.0 && place.y >= 0.0 && place.x < last.x && place.y < last.y) {
            return None;
        }
        let (column, row) = (place.x as usize, place.y as usize);
        let (across, down) = (place.x - column as f64, place.y - row as f64);
        let start = (direction * self.rows + row) * self.columns + column;
        let [a, b] = [0, 1].map(|side| f64::from(self.values[start + side]));
        let [c, d] = [0, 1].map(|side| f64::from(self.values[start + self.columns + side]));
        let (top, bottom) = (a + (b - a) * across, c + (d - c) * across);
        let by_x = (b - a) * (1.0 - down) + (d - c) * down;
        Some((top + (bottom - top) * down, Vector2::new(by_x, bottom - top)))
    }

    /// The mean strength under the steps for the camera turned by each of some rotation vectors.
    ///
    /// Steps of a direction that there is no picture of count as 0.
    pub fn means(&self, steps: &[SeenStep<3>], turns: &[Vector3<f64>]) -> Vec<f64> {
        let mut sums = vec![0.0; turns.len()];
        // Step after step: turns are small, so that a step stays within a few rows of a picture.
        for step in steps.iter().filter(|step| step.direction < self.directions()) {
            for (sum, turn) in sums.iter_mut().zip(turns) {
                let place = step.pixel + step.moved * turn;
                *sum += self.at(step.direction, place.x, place.y);
            }
        }
        let count = steps.len().max(1) as f64;
        sums.into_iter().map(|sum| sum / count).collect()
    }
}
