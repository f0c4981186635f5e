//! Laws of rigid poses and of their increments.

use std::f64::consts::PI;

use crate::support::jacobian::assert_jacobian;
use crate::support::random::Random;
use nalgebra::{DVector, Dyn, Matrix3, Matrix6, OMatrix, Rotation3, U6, Vector3};
use proptest::prelude::*;
use regionpose::internals::geometry::pose::{Tangent, cross_matrix, increment_derivative};
use regionpose::{Error, Pose};

/// Error allowed of a few products of rotations and vectors of size 10.
const ROUNDING: f64 = 1e-13;

/// Distance of two poses: rotation entries and translation.
fn apart(a: &Pose, b: &Pose) -> f64 {
    (a.rotation.matrix() - b.rotation.matrix()).amax().max((a.translation - b.translation).amax())
}

/// `exp([w]x)` by its power series after scaling, and the square of the result as often.
fn exponential(omega: &Vector3<f64>) -> Matrix3<f64> {
    let small = cross_matrix(omega) / 256.0;
    let mut term = Matrix3::identity();
    let mut sum = Matrix3::identity();
    for k in 1..12 {
        term = term * small / k as f64;
        sum += term;
    }
    (0..8).fold(sum, |m, _| m * m)
}

/// The increment from one pose to another nearby, the sine of its angle for the angle: exact to second order.
fn increment_between(from: &Pose, to: &Pose) -> Tangent {
    let turn = to.rotation * from.rotation.inverse();
    let (m, tau) = (turn.matrix(), to.translation - turn * from.translation);
    let twice = [m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]];
    Tangent::new(twice[0] / 2.0, twice[1] / 2.0, twice[2] / 2.0, tau.x, tau.y, tau.z)
}

#[test]
fn a_quarter_turn_about_z_takes_x_to_y() {
    let pose = Pose::identity().retract(&Tangent::new(0.0, 0.0, PI / 2.0, 1.0, 2.0, 3.0));
    assert!((pose.transform(&Vector3::x()) - Vector3::new(1.0, 3.0, 3.0)).norm() < 1e-15);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_inverse_undoes_on_both_sides(seed: u64) {
        let pose = Random::new(seed).pose(10.0);
        prop_assert!(apart(&pose.after(&pose.inverse()), &Pose::identity()) < ROUNDING);
        prop_assert!(apart(&pose.inverse().after(&pose), &Pose::identity()) < ROUNDING);
        prop_assert!(apart(&pose.inverse().inverse(), &pose) < ROUNDING);
    }

    #[test]
    fn after_is_one_transform_after_the_other(seed: u64) {
        let mut random = Random::new(seed);
        let (first, second, third) = (random.pose(10.0), random.pose(10.0), random.pose(10.0));
        let point = random.direction() * 10.0;
        prop_assert!((second.after(&first).transform(&point) - second.transform(&first.transform(&point))).norm() < ROUNDING);
        prop_assert!(apart(&third.after(&second).after(&first), &third.after(&second.after(&first))) < ROUNDING);
        prop_assert!(apart(&first.after(&Pose::identity()), &first) < ROUNDING);
    }

    #[test]
    fn an_increment_acts_on_the_left(seed: u64, angle in 0.0..6.0) {
        let mut random = Random::new(seed);
        let (pose, point, x) = (random.pose(10.0), random.direction(), random.tangent(angle, 3.0));
        let (omega, tau) = (x.fixed_rows::<3>(0).into_owned(), x.fixed_rows::<3>(3).into_owned());
        let expected = exponential(&omega) * pose.transform(&point) + tau;
        prop_assert!((pose.retract(&x).transform(&point) - expected).norm() < 10.0 * ROUNDING);
    }

    #[test]
    fn the_exponential_map_is_undone_by_its_logarithm(seed: u64, angle in 0.0..3.1) {
        let mut random = Random::new(seed);
        let (pose, x) = (random.pose(10.0), random.tangent(angle, 3.0));
        let moved = pose.retract(&x);
        let turn = moved.rotation * pose.rotation.inverse();
        // The angle comes from a cosine, which is flat at zero.
        prop_assert!((turn.scaled_axis() - x.fixed_rows::<3>(0)).amax() < 1e-7);
        prop_assert!((moved.translation - turn * pose.translation - x.fixed_rows::<3>(3)).amax() < ROUNDING);
    }

    #[test]
    fn an_angle_is_found_again(seed: u64, exponent in -12.0..0.49) {
        let mut random = Random::new(seed);
        let (pose, angle) = (random.pose(10.0), 10.0_f64.powf(exponent));
        let found = pose.angle_to(&pose.retract(&random.tangent(angle, 1.0)));
        // Matrix entries near one hold 2e-16, whatever the angle; near half a turn the chord is flat.
        let allowed = 1e-15 + 1e-14 * angle / (angle / 2.0).cos();
        prop_assert!((found - angle).abs() < allowed, "{found} for {angle}");
        prop_assert!(pose.angle_to(&pose) == 0.0);
    }

    #[test]
    fn the_increment_derivative_matches_differences(seed: u64, exponent in -8.0..0.4) {
        let mut random = Random::new(seed);
        let (pose, x) = (random.pose(10.0), random.tangent(10.0_f64.powf(exponent), 2.0));
        let there = pose.retract(&x);
        let values = |y: &Tangent| DVector::from_column_slice(increment_between(&there, &pose.retract(y)).as_slice());
        let derivative = increment_derivative(&x);
        let derivative = OMatrix::<f64, Dyn, U6>::from_fn(6, |row, column| derivative[(row, column)]);
        assert_jacobian(&derivative, values, &x, 1.0, 1e-9);
    }

    #[test]
    fn wild_numbers_make_no_panic(values in proptest::array::uniform12(any::<f64>())) {
        let rotation = Matrix3::from_column_slice(&values[..9]);
        if let Ok(pose) = Pose::from_matrix(&rotation, Vector3::from_column_slice(&values[9..])) {
            prop_assert!((pose.rotation.matrix() - rotation).amax() < 1e-6);
        }
        let x = Tangent::from_column_slice(&values[..6]);
        let _ = (Pose::identity().retract(&x), increment_derivative(&x), Pose::identity().retract(&x).angle_to(&Pose::identity()));
    }

    #[test]
    fn matrices_with_overflowing_products_are_refused(signs in proptest::array::uniform9(-1.0..1.0), exponent in 100.0..308.0) {
        let rotation = Matrix3::from_column_slice(&signs) * 10.0_f64.powf(exponent);
        let refused = matches!(Pose::from_matrix(&rotation, Vector3::zeros()), Err(Error::InvalidRotation { .. }));
        prop_assert!(refused);
    }
}

/// Any two poses, and half a turn about any axis, where a matrix's skew part is no guide.
#[test]
fn the_increment_to_a_pose_retracts_to_it() {
    let mut random = Random::new(5);
    for trial in 0..200 {
        let from = random.pose(10.0);
        let half = Pose::new(Rotation3::new(random.direction() * PI), Vector3::new(1.0, -2.0, 0.5));
        let to = if trial % 2 == 0 { random.pose(10.0) } else { half.after(&from) };
        let increment = from.local_coordinates(&to);
        assert!(apart(&from.retract(&increment), &to) < 1e-12);
        let turn = increment.fixed_rows::<3>(0).norm();
        assert!(turn <= PI + 1e-12 && (turn - from.angle_to(&to)).abs() < 1e-7);
        assert!(
            (increment.fixed_rows::<3>(3).norm() - (from.inverse().translation - to.inverse().translation).norm())
                .abs()
                < 1e-12
        );
    }
}

#[test]
fn at_zero_the_increment_derivative_is_the_identity() {
    assert_eq!(increment_derivative(&Tangent::zeros()), Matrix6::identity());
}

#[test]
fn the_series_meets_the_quotients() {
    let below = increment_derivative(&Tangent::new(0.99e-4, 0.0, 0.0, 1.0, 2.0, 3.0));
    let above = increment_derivative(&Tangent::new(1.01e-4, 0.0, 0.0, 1.0, 2.0, 3.0));
    // The derivative changes by half the difference of the angles, times the translation's length.
    assert!((below - above).amax() < 1e-5 && (below - above).amax() > 1e-7);
    let at = |angle: f64| increment_derivative(&Tangent::new(angle, 0.0, 0.0, 0.0, 0.0, 0.0))[(2, 1)] / angle;
    // (1 - cos a) / a^2 at 1e-4 cancels to 8 digits.
    assert!((at(0.999_999e-4) - at(1.000_001e-4)).abs() < 1e-7);
}

#[test]
fn a_nearly_orthonormal_matrix_is_made_exact() {
    let mut random = Random::new(3);
    let exact = random.rotation();
    let blurred = exact.matrix() + Matrix3::from_fn(|_, _| random.uniform(-2e-7, 2e-7));
    let pose = Pose::from_matrix(&blurred, Vector3::x()).unwrap();
    let defect = pose.rotation.matrix().transpose() * pose.rotation.matrix() - Matrix3::identity();
    assert!(defect.amax() < 1e-15, "{:.1e}", defect.amax());
    assert!(pose.angle_to(&Pose::new(exact, Vector3::zeros())) < 1e-6);
}

#[test]
fn many_moves_stay_a_rotation() {
    let mut random = Random::new(4);
    let pose = (0..10_000).fold(random.pose(1.0), |pose, _| pose.retract(&random.tangent(0.3, 0.1)));
    let defect = pose.rotation.matrix().transpose() * pose.rotation.matrix() - Matrix3::identity();
    assert!(defect.amax() < 1e-15);
}

#[test]
fn what_is_no_rotation_is_refused() {
    let message =
        |rotation: Matrix3<f64>, translation| Pose::from_matrix(&rotation, translation).unwrap_err().to_string();
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let zero = Vector3::zeros();
    assert!(message(mirror, zero).contains("determinant -1.000"));
    assert!(message(Matrix3::identity() * 1.001, zero).contains("|R^T R - I| = 2.0e-3"));
    assert!(message(Matrix3::zeros(), zero).contains("orthonormal to 1e-6"));
    let mut broken = *Rotation3::identity().matrix();
    broken[(2, 0)] = f64::NAN;
    assert_eq!(message(broken, zero), "pose entry 2 is not finite: NaN; coordinates need to be finite numbers");
    let far = Vector3::new(0.0, f64::INFINITY, 0.0);
    assert_eq!(
        message(Matrix3::identity(), far),
        "pose entry 10 is not finite: inf; coordinates need to be finite numbers"
    );
}

#[test]
fn an_isometry_is_the_same_motion() {
    let pose = Pose::new(Rotation3::new(Vector3::new(0.3, -0.5, 1.1)), Vector3::new(0.4, -2.0, 5.0));
    let isometry = nalgebra::Isometry3::from(pose);
    let point = nalgebra::Point3::new(1.0, 2.0, -3.0);
    assert!(((isometry * point).coords - pose.transform(&point.coords)).norm() < 1e-12);
    let back = Pose::from(isometry);
    assert!(back.angle_to(&pose) < 1e-12 && (back.translation - pose.translation).norm() < 1e-12);
}
