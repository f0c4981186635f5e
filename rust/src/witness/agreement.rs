//! How far depth steps lie on a photo's edges, at a pose and turned from it (`docs/math.md`, eq. 18.3).

use std::array;

use nalgebra::{SMatrix, SVector, Vector2, Vector3};

use crate::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

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

    /// The sums of values under the steps at some increments of the pose, and of the focal lengths where these have seven
    /// components, and their derivatives.
    ///
    /// Values between pixels follow from the four about them; steps outside the pictures count as 0.
    pub fn sums<const D: usize>(
        &self,
        steps: &[SeenStep<D>],
        increments: &[SVector<f64, D>],
    ) -> Vec<(f64, SVector<f64, D>)> {
        // What fills up the last group lies outside, where there is nothing to read.
        let of_axis =
            |chunk: &[SVector<f64, D>], axis: usize| lanes(|lane| chunk.get(lane).map_or(f64::NAN, |held| held[axis]));
        let groups = increments.chunks(LANES).map(|chunk| array::from_fn(|axis| of_axis(chunk, axis))).collect();
        let sums = vectorized(Sums { pictures: *self, steps, increments: groups });
        let of_lane =
            |lane: usize, sum: &Sum<D>| (sum.value.0[lane], SVector::from_fn(|axis, _| sum.slope[axis].0[lane]));
        (0..increments.len()).map(|number| of_lane(number % LANES, &sums[number / LANES])).collect()
    }

    /// The four values about a place of a picture, row by row, and how far it lies beyond the first; `None` outside.
    #[inline(always)]
    fn about(&self, direction: usize, x: f64, y: f64) -> Option<([f64; 4], [f64; 2])> {
        if !(x >= 0.0 && y >= 0.0 && x < self.columns as f64 - 1.0 && y < self.rows as f64 - 1.0) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let start = (direction * self.rows + row) * self.columns + column;
        let (top, bottom) = (&self.values[start..start + 2], &self.values[start + self.columns..][..2]);
        let [a, b, c, d] = [top[0], top[1], bottom[0], bottom[1]];
        let about = [f64::from(a), f64::from(b), f64::from(c), f64::from(d)];
        Some((about, [x - column as f64, y - row as f64]))
    }

    /// Adds what a step tells at increments of the pose.
    #[inline(always)]
    fn add<const D: usize>(&self, step: &SeenStep<D>, increment: &[Lanes; D], sum: &mut Sum<D>) {
        let (x, y) = (step.moved_by(0, increment), step.moved_by(1, increment));
        let mut values = [Lanes::ZERO; 4];
        let (mut across, mut down, mut is_seen) = (Lanes::ZERO, Lanes::ZERO, false);
        for lane in 0..LANES {
            if let Some((about, beyond)) = self.about(step.direction, x.0[lane], y.0[lane]) {
                for corner in 0..4 {
                    values[corner].0[lane] = about[corner];
                }
                [across.0[lane], down.0[lane]] = beyond;
                is_seen = true;
            }
        }
        if !is_seen {
            // Such as where the derivatives are not finite.
            return;
        }
        let [a, b, c, d] = values;
        let (top, bottom) = (a + (b - a) * across, c + (d - c) * across);
        let (by_x, by_y) = ((b - a) * (Lanes::splat(1.0) - down) + (d - c) * down, bottom - top);
        sum.value += top + by_y * down;
        for way in 0..D {
            sum.slope[way] += Lanes::splat(step.moved[(0, way)]) * by_x + Lanes::splat(step.moved[(1, way)]) * by_y;
        }
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

/// The sums of values under steps at increments of the pose, and their derivatives; those of a lane group at a time, by axes.
struct Sums<'a, const D: usize> {
    pictures: EdgeStrength<'a>,
    steps: &'a [SeenStep<D>],
    increments: Vec<[Lanes; D]>,
}

#[derive(Clone, Copy)]
struct Sum<const D: usize> {
    value: Lanes,
    slope: [Lanes; D],
}

impl<const D: usize> NullaryFnOnce for Sums<'_, D> {
    type Output = Vec<Sum<D>>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let mut sums = vec![Sum { value: Lanes::ZERO, slope: [Lanes::ZERO; D] }; self.increments.len()];
        // Step after step, as in the means.
        for step in self.steps.iter().filter(|step| step.direction < self.pictures.directions()) {
            for (sum, increment) in sums.iter_mut().zip(&self.increments) {
                self.pictures.add(step, increment, sum);
            }
        }
        sums
    }
}

impl<const D: usize> SeenStep<D> {
    /// The pixels' x or y after increments.
    #[inline(always)]
    fn moved_by(&self, axis: usize, increment: &[Lanes; D]) -> Lanes {
        let mut moved = Lanes::ZERO;
        for (way, change) in increment.iter().enumerate() {
            moved += Lanes::splat(self.moved[(axis, way)]) * *change;
        }
        Lanes::splat(self.pixel[axis]) + moved
    }
}

fn lanes(value: impl Fn(usize) -> f64) -> Lanes {
    Lanes(array::from_fn(value))
}
