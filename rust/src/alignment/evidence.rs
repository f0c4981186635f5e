//! What pictures of a photo hold where steps are seen, at increments of the pose (`docs/math.md`, eq. 18.6 and 18.8).

use std::array;

use nalgebra::SVector;

use super::agreement::{EdgeStrength, SeenStep};
use crate::lanes::{LANES, Lanes, NullaryFnOnce, vectorized};

/// Steps as they are seen, put together for many sums over them.
#[derive(Debug, Clone)]
pub struct SeenSteps<const D: usize>(Vec<StepGroup<D>>);

/// A lane group of steps.
#[derive(Debug, Clone)]
struct StepGroup<const D: usize> {
    /// x, y.
    pixel: [Lanes; 2],
    /// Derivatives of both.
    moved: [[Lanes; D]; 2],
    /// A whole number, as a float: vector instructions convert none.
    direction: Lanes,
}

impl<const D: usize> SeenSteps<D> {
    /// Steps without those whose derivatives are not finite: no increment, not even none, leads them to a place.
    pub fn new(steps: &[SeenStep<D>]) -> Self {
        let is_finite = |step: &&SeenStep<D>| step.pixel.iter().chain(&step.moved).all(|value| value.is_finite());
        let steps: Vec<&SeenStep<D>> = steps.iter().filter(is_finite).collect();
        Self(steps.chunks(LANES).map(StepGroup::new).collect())
    }
}

impl<const D: usize> StepGroup<D> {
    /// Up to a lane group of steps; what fills it up lies outside.
    fn new(steps: &[&SeenStep<D>]) -> Self {
        let lanes = |value: &dyn Fn(&SeenStep<D>) -> f64, none: f64| {
            Lanes(array::from_fn(|lane| steps.get(lane).map_or(none, |step| value(step))))
        };
        Self {
            pixel: array::from_fn(|axis| lanes(&|step| step.pixel[axis], -1.0)),
            moved: array::from_fn(|axis| array::from_fn(|way| lanes(&|step| step.moved[(axis, way)], 0.0))),
            direction: lanes(&|step| step.direction as f64, 0.0),
        }
    }

    /// The pixels' x or y after an increment.
    #[inline(always)]
    fn moved_by(&self, axis: usize, increment: &SVector<f64, D>) -> Lanes {
        let mut moved = Lanes::ZERO;
        for way in 0..D {
            moved += self.moved[axis][way] * Lanes::splat(increment[way]);
        }
        self.pixel[axis] + moved
    }
}

impl EdgeStrength<'_> {
    /// The sums of values under the steps at some increments of the pose, and of the focal lengths where these have seven
    /// components, and their derivatives.
    ///
    /// Values between pixels follow from the four about them; steps outside the pictures count as 0.
    pub fn sums<const D: usize>(
        &self,
        steps: &SeenSteps<D>,
        increments: &[SVector<f64, D>],
    ) -> Vec<(f64, SVector<f64, D>)> {
        vectorized(Sums { pictures: *self, groups: &steps.0, increments })
    }

    /// Adds what steps tell at an increment of the pose.
    #[inline(always)]
    fn add<const D: usize>(&self, steps: &StepGroup<D>, increment: &SVector<f64, D>, sum: &mut Sum<D>) {
        let (in_columns, [column, across]) = within(steps.moved_by(0, increment), self.columns as f64);
        let (in_rows, [row, down]) = within(steps.moved_by(1, increment), self.rows as f64);
        let directions = self.directions() as f64;
        let shown = steps.direction.map(|direction| if direction < directions { 1.0 } else { 0.0 });
        let seen = in_columns * in_rows * shown;
        if seen.max() == 0.0 {
            return;
        }
        let picture = steps.direction * shown * Lanes::splat(self.rows as f64);
        let place = (picture + row) * Lanes::splat(self.columns as f64) + column;
        let mut about = [Lanes::ZERO; 4];
        for lane in 0..LANES {
            let top = &self.values[place.0[lane] as usize..];
            let bottom = &top[self.columns..];
            for (corner, value) in [top[0], top[1], bottom[0], bottom[1]].into_iter().enumerate() {
                about[corner].0[lane] = f64::from(value);
            }
        }
        let [a, b, c, d] = about.map(|values| values * seen);
        let (top, bottom) = (a + (b - a) * across, c + (d - c) * across);
        let (by_x, by_y) = ((b - a) * (Lanes::splat(1.0) - down) + (d - c) * down, bottom - top);
        sum.value += top + by_y * down;
        for way in 0..D {
            sum.slope[way] += steps.moved[0][way] * by_x + steps.moved[1][way] * by_y;
        }
    }
}

/// The sums of values under steps at increments of the pose, and their derivatives.
struct Sums<'a, const D: usize> {
    pictures: EdgeStrength<'a>,
    groups: &'a [StepGroup<D>],
    increments: &'a [SVector<f64, D>],
}

#[derive(Clone, Copy)]
struct Sum<const D: usize> {
    value: Lanes,
    slope: [Lanes; D],
}

impl<const D: usize> NullaryFnOnce for Sums<'_, D> {
    type Output = Vec<(f64, SVector<f64, D>)>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        let mut sums = vec![Sum { value: Lanes::ZERO, slope: [Lanes::ZERO; D] }; self.increments.len()];
        // Between four pixels is nothing where there are no four.
        if self.pictures.rows > 1 && self.pictures.columns > 1 {
            // Steps after steps: increments are small, so that a step stays within a few rows of a picture.
            for group in self.groups {
                for (sum, increment) in sums.iter_mut().zip(self.increments) {
                    self.pictures.add(group, increment, sum);
                }
            }
        }
        sums.into_iter().map(|sum| (sum.value.sum(), SVector::from(sum.slope.map(Lanes::sum)))).collect()
    }
}

/// Which places along an axis of so many pixels, two or more, lie between two of them (1, else 0), and the number of the first of these
/// with how far the places lie beyond it, of those outside the nearest.
#[inline(always)]
fn within(places: Lanes, count: f64) -> (Lanes, [Lanes; 2]) {
    let inside = places.map(|place| if place >= 0.0 && place < count - 1.0 { 1.0 } else { 0.0 });
    let nearest = places.upper(Lanes::ZERO).lower(Lanes::splat(count - 1.0));
    let first = nearest.map(f64::floor).lower(Lanes::splat(count - 2.0));
    (inside, [first, nearest - first])
}
