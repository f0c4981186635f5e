//! Descents reach minima of any scale, bear kinks, and end.

use std::cell::Cell;

use nalgebra::{SMatrix, SVector, Vector2, Vector6};
use proptest::prelude::*;
use regionpose::internals::alignment::descent::{Ends, minimum};

use crate::support::random::Random;

/// Ends of a descent to the last digits.
const EXACT: Ends = Ends { flat: 1e-9, gain: 0.0, tries: 60, steps: 400 };

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Axes that are up to a million times as long as others, in any units.
    #[test]
    fn a_bowl_of_any_scaling_has_its_minimum_found(
        seed in 0..1000_u64,
        longest in 0.0..6.0_f64,
        unit in -4.0..4.0_f64,
    ) {
        let mut random = Random::new(seed);
        let turned = SMatrix::<f64, 6, 6>::from_fn(|_, _| random.normal()).qr().q();
        let lengths = Vector6::from_fn(|axis, _| 10.0_f64.powf(unit + longest * axis as f64 / 10.0));
        let bowl = turned * SMatrix::from_diagonal(&lengths.map(|length| length.powi(-2))) * turned.transpose();
        let middle = turned * lengths.map(|length| length * random.normal());
        let cost = |x: &Vector6<f64>| {
            let way = x - middle;
            (0.5 * way.dot(&(bowl * way)) + 3.0, bowl * way)
        };
        let ends = Ends { flat: 0.0, ..EXACT };
        let (found, value) = minimum(cost, Vector6::zeros(), &ends);
        prop_assert!(value - 3.0 < 1e-9, "{value} {found}");
    }

    /// Where costs are not finite, or fall forever, what is found is no worse than the start, and little was tried.
    #[test]
    fn costs_that_are_no_numbers_end_within_the_tries(seed in 0..1000_u64, kind in 0..7_usize, steps in 0..30_usize) {
        let mut random = Random::new(seed);
        let start = Vector2::new(random.normal(), random.normal()) * 3.0;
        let tried = Cell::new(0);
        let cost = |x: &Vector2<f64>| {
            tried.set(tried.get() + 1);
            let bowl = (x.norm_squared(), x * 2.0);
            let is_there = x.norm() < 2.0;
            match kind {
                0 => (f64::NAN, Vector2::repeat(f64::NAN)),
                1 => (f64::INFINITY, Vector2::zeros()),
                2 if is_there => (f64::NAN, bowl.1),
                3 if is_there => (f64::INFINITY, Vector2::repeat(f64::NAN)),
                4 if is_there => (f64::NEG_INFINITY, Vector2::repeat(f64::INFINITY)),
                5 if is_there => (bowl.0, Vector2::repeat(f64::NAN)),
                // Down a slope without an end.
                6 => (-x.x, Vector2::new(-1.0, 0.0)),
                _ => bowl,
            }
        };
        let ends = Ends { flat: 1e-3, gain: 1e-6, tries: 10, steps };
        let (found, value) = minimum(cost, start, &ends);
        prop_assert!(tried.get() <= 1 + ends.steps * ends.tries);
        let before = cost(&start).0;
        prop_assert!(value <= before || before.is_nan());
        prop_assert!(kind == 0 || found.iter().all(|entry| entry.is_finite()));
        let again = cost(&found).0;
        prop_assert!(again == value || (again.is_nan() && value.is_nan()), "{again} {value}");
    }
}

#[test]
fn the_minimum_of_rosenbrocks_valley_is_found() {
    let tried = Cell::new(0);
    let cost = |x: &Vector2<f64>| {
        tried.set(tried.get() + 1);
        let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
        (a * a + 100.0 * b * b, Vector2::new(-2.0 * a - 400.0 * x[0] * b, 200.0 * b))
    };
    let (found, value) = minimum(cost, Vector2::new(-1.2, 1.0), &EXACT);
    assert!((found - Vector2::new(1.0, 1.0)).norm() < 1e-6 && value < 1e-12, "{found}");
    assert!(tried.get() < 150, "{}", tried.get());
}

/// A sum of distances and of absolute values, whose slopes jump at the minimum itself.
#[test]
fn kinks_do_no_harm() {
    for seed in 0..20 {
        let mut random = Random::new(seed);
        let ways = SMatrix::<f64, 6, 6>::from_fn(|_, _| random.normal());
        let start = SVector::<f64, 6>::from_fn(|_, _| random.normal());
        let cost = |x: &Vector6<f64>| {
            let along = ways * x;
            let steep = Vector6::from_fn(|axis, _| (axis + 1) as f64);
            (along.abs().dot(&steep), ways.tr_mul(&along.map(f64::signum).component_mul(&steep)))
        };
        let (found, value) = minimum(cost, start, &EXACT);
        assert!(value < 1e-4 * cost(&start).0, "{seed}: {value} {found}");
    }
}

#[test]
fn a_start_at_the_minimum_stays_there() {
    let tried = Cell::new(0);
    let cost = |x: &Vector2<f64>| {
        tried.set(tried.get() + 1);
        (x.norm_squared(), x * 2.0)
    };
    assert_eq!(minimum(cost, Vector2::zeros(), &EXACT), (Vector2::zeros(), 0.0));
    assert_eq!(tried.get(), 1);
}

/// Where the photo's edges lie: the first step is no longer than a spread, however steep the slope.
#[test]
fn the_first_step_goes_a_unit_at_most() {
    let farthest = Cell::new(0.0_f64);
    let cost = |x: &Vector2<f64>| {
        farthest.set(farthest.get().max(x.norm()));
        (1e6 * x.x, Vector2::new(1e6, 0.0))
    };
    minimum(cost, Vector2::zeros(), &Ends { tries: 1, steps: 1, ..EXACT });
    assert!((farthest.get() - 1.0).abs() < 1e-12);
}
