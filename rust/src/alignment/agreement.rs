//! How far depth steps lie on a photo's edges, at a pose and turned from it (`docs/math.md`, eq. 18.3).

use std::array;

use nalgebra::{SMatrix, Vector2, Vector3};

use crate::lanes::{NullaryFnOnce, vectorized};

/// The strength of a photo's edges across some directions, one picture after the other, row by row.
#[derive(Debug, Clone, Copy)]
pub struct EdgeStrength<'a> {
    pub(super) values: &'a [f32],
    pub(super) rows: usize,
    pub(super) columns: usize,
}

/// Where a step is seen: its pixel, how a change of the pose moves that, and the picture that shows edges across it.
///
/// Of three components the change turns the camera alone, by a rotation vector about its axes, rad; of six it is a left increment,
/// a rotation vector and a translation, meters; of seven it changes the logarithm of the focal lengths, too.
#[derive(Debug, Clone, Copy)]
pub struct SeenStep<const D: usize> {
    /// x, y; the center of the first pixel is (0, 0).
    pub pixel: Vector2<f64>,
    /// Derivatives by the change, pixels a radian, a meter and by a logarithm.
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

    /// The mean strength under the steps for the camera turned by each of some rotation vectors.
    ///
    /// Steps outside the pictures count as at the nearest pixel, those of a direction that there is no picture of as 0.
    pub fn means(&self, steps: &[SeenStep<3>], turns: &[Vector3<f64>]) -> Vec<f64> {
        let mut sums = vec![0.0; turns.len()];
        let mut places = vec![0.0; turns.len()];
        let turns = array::from_fn(|axis| turns.iter().map(|turn| turn[axis]).collect());
        // Step after step: turns are small, so that a step stays within a few rows of a picture.
        for step in steps.iter().filter(|step| step.direction < self.directions()) {
            let shape = [self.columns, self.rows].map(|count| count as f64);
            vectorized(Nearest { step, turns: &turns, shape, places: &mut places });
            let picture = &self.values[step.direction * self.rows * self.columns..];
            for (sum, place) in sums.iter_mut().zip(&places) {
                *sum += f64::from(picture[*place as usize]);
            }
        }
        let count = steps.len().max(1) as f64;
        sums.into_iter().map(|sum| sum / count).collect()
    }
}

/// The places in a picture, row by row, of the pixels nearest to where a step is seen for the camera turned by rotation vectors, given
/// by axes. Whole numbers, as floats: vector instructions convert none.
struct Nearest<'a> {
    step: &'a SeenStep<3>,
    turns: &'a [Vec<f64>; 3],
    /// Number of columns and rows.
    shape: [f64; 2],
    places: &'a mut [f64],
}

impl NullaryFnOnce for Nearest<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Self { step, turns: [xs, ys, zs], shape, places } = self;
        for (((place, x), y), z) in places.iter_mut().zip(xs).zip(ys).zip(zs) {
            let moved = |axis: usize| step.moved[(axis, 0)] * x + step.moved[(axis, 1)] * y + step.moved[(axis, 2)] * z;
            // NaN counts as 0.
            let nearest = |axis: usize| (step.pixel[axis] + moved(axis) + 0.5).max(0.0).min(shape[axis] - 1.0).floor();
            *place = nearest(1) * shape[0] + nearest(0);
        }
    }
}
