//! How likely a normal rotation is within the limit: closed forms, and an average over directions.

use std::f64::consts::{PI, SQRT_2};

use nalgebra::{Matrix3, Matrix6, Rotation3, Vector3};
use proptest::prelude::*;
use regionpose::internals::verdict::nearness::nearness;

/// A covariance with these deviations of the rotation, degrees, about turned axes, and some translation.
fn covariance(sigmas: [f64; 3], axes: &Rotation3<f64>) -> Matrix6<f64> {
    let deviations = Vector3::from(sigmas).map(f64::to_radians);
    let deviations = axes.matrix() * Matrix3::from_diagonal(&deviations);
    let mut covariance = Matrix6::identity();
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&(deviations * deviations.transpose()));
    covariance
}

/// Probability that a normal vector of three equal deviations of 1 is no longer than `radius`.
fn chi_3(radius: f64) -> f64 {
    libm::erf(radius / SQRT_2) - (2.0 / PI).sqrt() * radius * (-0.5 * radius * radius).exp()
}

/// The mean over all directions of how likely the vector ends within the limit in each.
fn over_directions(sigmas: [f64; 3]) -> f64 {
    // The mean over the angle, of a period, is exact by few steps; that over z is off by the square of its own.
    const HEIGHTS: usize = 4000;
    const ANGLES: usize = 100;
    let at = |index: usize, steps: usize| (index as f64 + 0.5) / steps as f64;
    let mut sum = 0.0;
    for z in (0..HEIGHTS).map(|index| at(index, HEIGHTS)) {
        for angle in (0..ANGLES).map(|index| at(index, ANGLES) * PI / 2.0) {
            let flat = (1.0 - z * z).sqrt();
            let direction = Vector3::new(flat * angle.cos(), flat * angle.sin(), z);
            sum += chi_3(5.0 / direction.component_mul(&Vector3::from(sigmas)).norm());
        }
    }
    sum / (HEIGHTS * ANGLES) as f64
}

#[test]
fn equal_deviations_and_such_about_fewer_axes_have_closed_forms() {
    let axes = Rotation3::new(Vector3::new(0.3, -0.8, 0.5));
    for sigma in [0.01, 0.5, 2.0, 5.0, 12.0, 60.0] {
        let ratio: f64 = 5.0 / sigma;
        let needed = [libm::erf(ratio / SQRT_2), -(-0.5 * ratio * ratio).exp_m1(), chi_3(ratio)];
        // A deviation of nothing counts as a thousandth of a degree.
        let cases = [([0.0, sigma, 0.0], 1e-6), ([sigma, 0.0, sigma], 1e-6), ([sigma; 3], 1e-8)];
        for (needed, (sigmas, error)) in needed.into_iter().zip(cases) {
            let found = nearness(&covariance(sigmas, &axes));
            assert!((found - needed).abs() < error, "{found} for {needed}, {sigmas:?} degrees");
        }
    }
}

#[test]
fn a_pose_without_a_covariance_is_hardly_near() {
    for unknown in [f64::INFINITY, f64::NAN] {
        assert!((0.0..1e-3).contains(&nearness(&Matrix6::repeat(unknown))));
    }
}

#[test]
fn very_unequal_deviations_are_the_mean_over_directions() {
    for sigmas in [[20.0, 20.0, 1.0], [20.0, 1.0, 1.0], [1.0, 1.0, 1.0], [17.34, 16.64, 2.46]] {
        let found = nearness(&covariance(sigmas, &Rotation3::identity()));
        assert!((found - over_directions(sigmas)).abs() < 1e-5, "{found} for {}", over_directions(sigmas));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20))]

    #[test]
    fn it_is_the_mean_over_directions(
        sigmas in [1.0..20.0_f64, 1.0..20.0_f64, 1.0..20.0_f64], turn in [-2.0..2.0_f64, -2.0..2.0_f64, -2.0..2.0_f64],
    ) {
        let found = nearness(&covariance(sigmas, &Rotation3::new(turn.into())));
        prop_assert!((found - over_directions(sigmas)).abs() < 1e-5);
    }
}
