//! How far depth steps lie on a photo's edges, at a pose and turned from it (`docs/math.md`, eq. 18.3).

use nalgebra::{Matrix2x3, Vector2, Vector3};

/// The strength of a photo's edges across some directions, one picture after the other, row by row.
#[derive(Debug, Clone, Copy)]
pub struct EdgeStrength<'a> {
    values: &'a [f32],
    rows: usize,
    columns: usize,
}

/// Where a step is seen: its pixel, how turning the camera moves that, and the picture that shows edges across it.
#[derive(Debug, Clone, Copy)]
pub struct SeenStep {
    /// x, y; the centre of the first pixel is (0, 0).
    pub pixel: Vector2<f64>,
    /// Derivatives by a rotation vector about the camera's axes, pixels a radian.
    pub moved: Matrix2x3<f64>,
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

    /// The mean strength under the steps for the camera turned by each of some rotation vectors.
    ///
    /// Steps of a direction that there is no picture of count as 0.
    pub fn means(&self, steps: &[SeenStep], turns: &[Vector3<f64>]) -> Vec<f64> {
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
