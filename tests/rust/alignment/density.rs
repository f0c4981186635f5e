//! Densities of poses: what they integrate to, their slopes, and draws of them.

use std::f64::consts::{PI, TAU};

use nalgebra::{DVector, Dyn, Matrix6, OMatrix, Rotation3, SVector, U6, Vector3, Vector6};
use regionpose::internals::alignment::density::{PoseDensity, Sampler};
use regionpose::internals::geometry::pose::Tangent;
use regionpose::{Pose, PoseSigma, Prior};

use crate::support::jacobian::assert_jacobian;
use crate::support::random::Random;

const DEGREE: f64 = PI / 180.0;

/// Standard errors of a mean beyond which it is off.
const ERRORS: f64 = 4.5;

fn near(sigma: f64) -> Prior {
    Prior::default().with_near(Vector3::new(3.0, -2.0, 1.5), Some(sigma)).unwrap()
}

fn with_up(prior: Prior, degrees: f64) -> Prior {
    prior.with_up(Vector3::new(0.3, -0.4, 2.0), Some(degrees * DEGREE)).unwrap()
}

fn near_and_up(degrees: f64) -> Prior {
    with_up(near(0.4), degrees)
}

/// An initial pose that is level and stands near, but for a deviation or so.
fn initial(prior: Prior, rotation: f64, place: f64) -> Prior {
    let sigma = PoseSigma { rotation, place };
    prior.with_initial(initial_pose(&prior, rotation), Some(sigma)).unwrap()
}

fn initial_pose(prior: &Prior, rotation: f64) -> Pose {
    let level = prior
        .up()
        .map_or(Random::new(4).rotation(), |(up, _)| Rotation3::rotation_between(&up, &-Vector3::y()).unwrap());
    let turn =
        Rotation3::new(Vector3::new(0.7, 1.0, -0.6) * rotation) * Rotation3::from_axis_angle(&Vector3::y_axis(), 2.0);
    let (rotation_, center) = (turn * level, Vector3::new(3.1, -2.0, 1.4));
    Pose::new(rotation_, -(rotation_ * center))
}

/// A pose of a camera that stands somewhere.
fn standing(rotation: Rotation3<f64>, center: &Vector3<f64>) -> Pose {
    Pose::new(rotation, -(rotation * center))
}

/// The density of independent normal numbers of such a deviation.
fn bell(numbers: &[f64], sigma: f64) -> f64 {
    let squares: f64 = numbers.iter().map(|number| (number / sigma).powi(2)).sum();
    (-0.5 * squares).exp() / (sigma * TAU.sqrt()).powi(numbers.len() as i32)
}

/// The mean of importance weights, and its standard error.
fn mean(weights: &[f64]) -> (f64, f64) {
    let count = weights.len() as f64;
    let mean = weights.iter().sum::<f64>() / count;
    let squares: f64 = weights.iter().map(|weight| (weight - mean).powi(2)).sum();
    (mean, squares.sqrt() / count)
}

fn assert_is_one(weights: &[f64], allowed: f64) {
    let (mean, error) = mean(weights);
    assert!(error < 0.02, "{error} is too large for this test");
    assert!((mean - 1.0).abs() < ERRORS * error + allowed, "{mean} +- {error}, allowed {allowed}");
}

/// How much larger a volume of rotations is in the rotation vector than on the group: less than one of space.
fn rotations_of(angle: f64) -> f64 {
    if angle < 1e-6 { 1.0 } else { 2.0 * (1.0 - angle.cos()) / (angle * angle) }
}

/// Over the sphere of tilts, the headings and space. The volume is that of a flat bell, of which a sphere's lacks a third of the variance.
#[test]
fn a_prior_of_up_and_place_integrates_to_one_over_all_headings() {
    let mut random = Random::new(11);
    for degrees in [3.0, 10.0] {
        let prior = near_and_up(degrees);
        let density = PoseDensity::of_prior(&prior).unwrap();
        let level = Rotation3::rotation_between(&prior.up().unwrap().0, &-Vector3::y()).unwrap();
        let sigma = degrees * DEGREE;
        let weight = |_| {
            let heading = Rotation3::from_axis_angle(&Vector3::y_axis(), random.uniform(0.0, TAU));
            let [x, z] = [0; 2].map(|_| 1.2 * sigma * random.normal());
            let way = random.normals() * 0.5;
            let rotation = Rotation3::new(Vector3::new(x, 0.0, z)) * heading * level;
            let value = density.at(&standing(rotation, &(prior.place().unwrap().0 + way))).value;
            let angle = x.hypot(z);
            let drawn = bell(&[x, z], 1.2 * sigma) / TAU * bell(way.as_slice(), 0.5);
            value.exp() * (angle.sin() / angle) / drawn
        };
        let weights: Vec<f64> = (0..20_000).map(weight).collect();
        assert_is_one(&weights, sigma * sigma / 3.0);
    }
}

#[test]
fn a_prior_of_a_place_alone_integrates_to_one_over_all_rotations() {
    let mut random = Random::new(12);
    let prior = near(0.3);
    let density = PoseDensity::of_prior(&prior).unwrap();
    let weight = |_| {
        let way = random.normals() * 0.4;
        let value = density.at(&standing(random.rotation(), &(prior.place().unwrap().0 + way))).value;
        value.exp() * 8.0 * PI * PI / bell(way.as_slice(), 0.4)
    };
    let weights: Vec<f64> = (0..20_000).map(weight).collect();
    assert_is_one(&weights, 0.0);
}

/// With and without up, and with a place that contradicts the initial one by a deviation or two. Bells are taken for flat here as well.
#[test]
fn a_prior_about_a_pose_integrates_to_one() {
    let mut random = Random::new(13);
    let alone = initial(Prior::default(), 0.1, 0.3);
    let elsewhere = alone.with_near(Vector3::new(2.6, -2.0, 1.5), Some(0.25)).unwrap();
    let priors = [
        (alone, 0.0),
        (elsewhere, 0.0),
        (initial(near(0.4), 0.3, 0.5), 0.0),
        (initial(near_and_up(3.0), 0.15, 0.3), 0.01),
        (initial(near_and_up(10.0), 0.15, 0.3), 0.01),
    ];
    for (prior, further) in priors {
        let density = PoseDensity::of_prior(&prior).unwrap();
        let (initial, sigma) = prior.initial().map(|(pose, sigma)| (pose, sigma.unwrap())).unwrap();
        let center = initial.inverse().translation;
        let weight = |_| {
            let turn = random.normals() * (1.05 * sigma.rotation);
            let way = random.normals() * (1.05 * sigma.place);
            let pose = standing(Rotation3::new(turn) * initial.rotation, &(center + way));
            let drawn = bell(turn.as_slice(), 1.05 * sigma.rotation) * bell(way.as_slice(), 1.05 * sigma.place);
            density.at(&pose).value.exp() * rotations_of(turn.norm()) / drawn
        };
        let weights: Vec<f64> = (0..40_000).map(weight).collect();
        assert_is_one(&weights, sigma.rotation.powi(2) / 4.0 + further);
    }
}

#[test]
fn a_prior_without_the_cameras_place_has_no_density() {
    let up = with_up(Prior::default(), 3.0);
    let start = up.with_initial(initial_pose(&up, 0.1), None).unwrap();
    for prior in [Prior::default(), up, start] {
        assert!(PoseDensity::of_prior(&prior).is_none());
    }
    assert!(PoseDensity::of_prior(&start.with_near(Vector3::zeros(), None).unwrap()).is_some());
}

/// A covariance of a camera that turns about a place before it: rotation and place go together.
fn covariance(rotation: f64, place: f64) -> Matrix6<f64> {
    let mut random = Random::new(3);
    let mut root = Matrix6::from_fn(|_, _| 0.3 * random.normal()) + Matrix6::identity();
    for (row, scale) in [rotation, rotation, rotation, place, place, place].into_iter().enumerate() {
        root.row_mut(row).scale_mut(scale);
    }
    root * root.transpose()
}

fn student(rotation: f64, place: f64) -> (PoseDensity, Pose, Matrix6<f64>) {
    let (pose, covariance) = (Random::new(5).pose(7.0), covariance(rotation, place));
    (PoseDensity::student(pose, &covariance).unwrap(), pose, covariance)
}

/// Draws of it as a normal vector over the root of a gamma-distributed number, twice as wide.
#[test]
fn students_density_integrates_to_one_and_has_its_height_in_the_middle() {
    let mut random = Random::new(14);
    let (density, pose, covariance) = student(2e-3, 0.05);
    let height = 24.0_f64.ln() - 3.0 * (4.0 * PI).ln() - 0.5 * covariance.determinant().ln();
    assert!((density.at(&pose).value - height).abs() < 1e-9);
    // At a deviation along any direction it is (1 + 1/4)^-5 of that.
    let root = covariance.cholesky().unwrap().l();
    for axis in 0..6 {
        let value = density.at(&pose.retract(&root.column(axis).into_owned())).value;
        assert!((value - height + 5.0 * 1.25_f64.ln()).abs() < 1e-6);
    }
    // Of the heavier tails of two degrees of freedom: (2 pi)^-3 Gamma(4) / Gamma(1) (1 + q / 2)^-4.
    let weight = |_| {
        let normals = Vector6::from_fn(|_, _| random.normal());
        let squares = -2.0 * (1.0 - random.uniform(0.0, 1.0)).ln();
        let drawn = normals / (squares / 2.0).sqrt();
        let tails = 6.0 / TAU.powi(3) * (1.0 + 0.5 * drawn.norm_squared()).powi(-4);
        let value = density.at(&pose.retract(&(root * drawn))).value;
        value.exp() * covariance.determinant().sqrt() / tails
    };
    let weights: Vec<f64> = (0..40_000).map(weight).collect();
    assert_is_one(&weights, 0.0);
}

#[test]
fn what_is_no_covariance_has_no_density() {
    let mut negative = Matrix6::identity();
    negative[(4, 4)] = -1.0;
    for covariance in [negative, Matrix6::zeros(), Matrix6::repeat(f64::NAN)] {
        assert!(PoseDensity::student(Pose::identity(), &covariance).is_none());
    }
}

/// Near the middle and far from it, up to two radians and tens of deviations.
#[test]
fn the_slope_is_the_derivative_by_a_left_increment() {
    let mut random = Random::new(15);
    let densities = [near(0.5), near_and_up(3.0), near_and_up(10.0), initial(near_and_up(10.0), 0.2, 0.3)]
        .map(|prior| (PoseDensity::of_prior(&prior).unwrap(), initial(prior, 0.1, 0.1).initial().unwrap().0));
    let students = [(2e-3, 0.05), (0.3, 0.5)].map(|(rotation, place)| {
        let (density, pose, _) = student(rotation, place);
        (density, pose)
    });
    for (density, middle) in densities.iter().chain(&students) {
        for (angle, length) in [(0.0, 0.0), (0.02, 0.05), (0.5, 1.0), (2.0, 8.0)] {
            let pose = middle.retract(&random.tangent(angle, length));
            let found = density.at(&pose);
            if found.slope.amax() < 1e-6 {
                assert!(angle == 0.0, "none in the middle alone");
                continue;
            }
            let slope = OMatrix::<f64, Dyn, U6>::from_rows(&[found.slope.transpose()]);
            let value = |by: &Tangent| DVector::from_element(1, density.at(&pose.retract(by)).value);
            assert_jacobian(&slope, value, &Tangent::zeros(), 1.0, 1e-6);
        }
    }
}

/// As much as the inverse covariance in the middle, and less far off; a prior's is that of its Gaussian anywhere.
#[test]
fn the_information_is_that_of_the_covariance_and_no_more_far_off() {
    let (density, pose, covariance) = student(2e-3, 0.05);
    let error = |information: Matrix6<f64>, share: f64| (information * covariance - Matrix6::identity() * share).amax();
    assert!(error(density.at(&pose).information, 1.0) < 1e-9);
    let six = covariance.cholesky().unwrap().l().column(2) * 6.0;
    assert!(error(density.at(&pose.retract(&six)).information, 10.0 / 40.0) < 1e-6);
}

const DRAWS: usize = 20_000;

fn draws(density: PoseDensity, seed: u64) -> Vec<Pose> {
    let (sampler, mut random) = (Sampler::new(density), Random::new(seed));
    let draw = |_| {
        let uniform = [0; 3].map(|_| random.uniform(0.0, 1.0));
        sampler.pose(&uniform, &[0; 6].map(|_| random.normal()))
    };
    (0..DRAWS).map(draw).collect()
}

fn moments<const D: usize>(values: &[SVector<f64, D>]) -> (SVector<f64, D>, nalgebra::SMatrix<f64, D, D>) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<SVector<f64, D>>() / count;
    let squares: nalgebra::SMatrix<f64, D, D> =
        values.iter().map(|value| (value - mean) * (value - mean).transpose()).sum();
    (mean, squares / count)
}

/// Standard error of variances and covariances of so many draws, in variances, with a margin.
fn spread() -> f64 {
    ERRORS * (2.0 / DRAWS as f64).sqrt()
}

#[test]
fn draws_have_the_tilt_and_place_of_a_prior_and_any_heading() {
    let prior = near_and_up(3.0);
    let drawn = draws(PoseDensity::of_prior(&prior).unwrap(), 21);
    let (up, sigma) = (prior.up().unwrap().0.normalize(), 3.0 * DEGREE);
    let tilts: Vec<_> = drawn.iter().map(|pose| (pose.rotation * up).xz()).collect();
    let (mean, squares) = moments(&tilts);
    assert!(mean.amax() < ERRORS * sigma / (DRAWS as f64).sqrt(), "{mean}");
    // Sines of angles are shorter than these by the angle's square.
    let error = (squares / (sigma * sigma) - nalgebra::Matrix2::identity()).amax();
    assert!(error < spread() + 2.0 * sigma * sigma, "{error}");
    let centers: Vec<_> = drawn.iter().map(|pose| pose.inverse().translation - prior.place().unwrap().0).collect();
    let (mean, squares) = moments(&centers);
    assert!(mean.amax() < ERRORS * 0.4 / (DRAWS as f64).sqrt(), "{mean}");
    assert!((squares / 0.16 - nalgebra::Matrix3::identity()).amax() < spread());
    // Headings: where the camera's axis points about up.
    let level = Rotation3::rotation_between(&up, &Vector3::z()).unwrap();
    let mut bins = [0.0_f64; 24];
    for pose in &drawn {
        let axis = level * (pose.rotation.inverse() * Vector3::z());
        bins[((axis.y.atan2(axis.x) / TAU).rem_euclid(1.0) * 24.0) as usize % 24] += 1.0;
    }
    let expected = DRAWS as f64 / 24.0;
    let squares: f64 = bins.iter().map(|count| (count - expected).powi(2) / expected).sum();
    // Of 23 degrees of freedom: beyond 60 in one of 40,000 cases.
    assert!(squares < 60.0, "{squares}");
}

#[test]
fn draws_of_a_prior_without_rotation_are_uniform_over_rotations() {
    let drawn = draws(PoseDensity::of_prior(&near(0.4)).unwrap(), 22);
    let entries: Vec<SVector<f64, 9>> =
        drawn.iter().map(|pose| SVector::from_iterator(pose.rotation.matrix().iter().copied())).collect();
    let (mean, squares) = moments(&entries);
    let allowed = ERRORS / (DRAWS as f64).sqrt();
    // Entries are square to one another in the mean, and each has a third for its square.
    let error = (squares - nalgebra::SMatrix::<f64, 9, 9>::identity() / 3.0).amax();
    assert!(mean.amax() < allowed && error < allowed, "{mean} {error}");
    // That of the angle: a trace of 1 + 2 cos a has the mean 0, the square 1 and the fourth power 3.
    for (power, expected) in [(1, 0.0), (2, 1.0), (3, 1.0), (4, 3.0)] {
        let moments: Vec<f64> = drawn.iter().map(|pose| pose.rotation.matrix().trace().powi(power)).collect();
        let (found, error) = self::mean(&moments);
        assert!((found - expected).abs() < ERRORS * error, "{power}: {found}");
    }
}

/// Of Gaussians of the initial pose, up and the place together, which contradict one another: both means at the weighted one.
#[test]
fn draws_about_a_pose_are_those_of_the_whole_prior() {
    let prior = initial(near_and_up(3.0), 0.1, 0.3);
    let drawn = draws(PoseDensity::of_prior(&prior).unwrap(), 23);
    let base = prior.initial().unwrap().0;
    let factor = prior.gaussian(&base);
    let covariance = factor.information.try_inverse().unwrap();
    let (mean, squares) = moments(&drawn.iter().map(|pose| base.local_coordinates(pose)).collect::<Vec<_>>());
    let root = covariance.cholesky().unwrap().l();
    let off = root.solve_lower_triangular(&(mean - covariance * factor.information_vector)).unwrap();
    assert!(off.amax() < ERRORS / (DRAWS as f64).sqrt(), "{off}");
    let inverse = root.try_inverse().unwrap();
    assert!((inverse * squares * inverse.transpose() - Matrix6::identity()).amax() < spread());
}

#[test]
fn draws_about_a_pose_with_a_rough_covariance_are_students() {
    let (density, pose, covariance) = student(2e-3, 0.05);
    let information = covariance.try_inverse().unwrap();
    let ways: Vec<_> = draws(density, 24).iter().map(|drawn| pose.local_coordinates(drawn)).collect();
    // Squares over the covariance are six times those of Fisher's distribution of 6 and 4 degrees of freedom.
    for (share, most) in [(0.25, 3.3673), (0.5, 6.3730), (0.9, 24.0588)] {
        let within = ways.iter().filter(|way| way.dot(&(information * **way)) < most).count() as f64 / DRAWS as f64;
        assert!((within - share).abs() < ERRORS * (share * (1.0 - share) / DRAWS as f64).sqrt(), "{share}: {within}");
    }
    for axis in 0..6 {
        let above = ways.iter().filter(|way| way[axis] > 0.0).count() as f64 / DRAWS as f64;
        assert!((above - 0.5).abs() < ERRORS * 0.5 / (DRAWS as f64).sqrt(), "{axis}: {above}");
    }
}

/// Against means over draws, of likelihoods from none to ones that are far narrower and lie off the middle.
#[test]
fn integrals_of_students_density_and_a_likelihood_are_those_of_draws() {
    let (density, pose, covariance) = student(2e-3, 0.05);
    let root = covariance.cholesky().unwrap().l();
    let ways: Vec<_> = draws(density.clone(), 25).iter().map(|drawn| pose.local_coordinates(drawn)).collect();
    for (narrow, off) in [(0.0, 0.0), (0.3, 0.0), (0.5, 0.4), (2.0, 0.5), (1.0, 1.0)] {
        // The likelihood's exponent about its own middle; both together are highest where their slopes cancel.
        let middle = root * Vector6::repeat(off);
        let inverse = root.try_inverse().unwrap();
        let curvature = inverse.transpose() * inverse * narrow;
        let exponent = |way: &Vector6<f64>| -0.5 * (way - middle).dot(&(curvature * (way - middle)));
        // By symmetry on the way to the middle.
        let along = |t: f64| root * Vector6::repeat(off * t);
        let value = |t: f64| density.at(&pose.retract(&along(t))).value + exponent(&along(t));
        let best = (0..=4000).map(|k| f64::from(k) / 4000.0).max_by(|a, b| value(*a).total_cmp(&value(*b))).unwrap();
        let at = pose.retract(&along(best));
        let squares = 6.0 * (off * best).powi(2);
        let pull = 10.0 / (4.0 + squares);
        let white = inverse * along(best);
        let own = (Matrix6::identity() - white * white.transpose() * (2.0 / (4.0 + squares))) * pull;
        let whole = curvature + inverse.transpose() * own * inverse;
        let found = density.log_integral(&at, &whole).unwrap() + exponent(&along(best));
        let (expected, error) = mean(&ways.iter().map(|way| exponent(way).exp()).collect::<Vec<_>>());
        let allowed = ERRORS * error / expected + 0.02;
        assert!((found - expected.ln()).abs() < allowed, "{narrow} {off}: {found} for {}", expected.ln());
    }
    assert!(PoseDensity::of_prior(&near(0.4)).unwrap().log_integral(&pose, &Matrix6::identity()).is_none());
}

/// Where the likelihood is not seen to end, as by slopes of noise, the mass stays about the height.
#[test]
fn integrals_stay_bounded_where_a_likelihood_is_flat_beside_the_middle() {
    let (density, pose, covariance) = student(2e-3, 0.05);
    let root = covariance.cholesky().unwrap().l();
    let inverse = root.try_inverse().unwrap();
    for off in [0.3, 1.0, 2.0, 4.0] {
        let white = Vector6::new(off, 0.0, 0.0, 0.0, 0.0, 0.0);
        let pull = 10.0 / (4.0 + off * off);
        let own = (Matrix6::identity() - white * white.transpose() * (2.0 / (4.0 + off * off))) * pull;
        let found =
            density.log_integral(&pose.retract(&(root * white)), &(inverse.transpose() * own * inverse)).unwrap();
        assert!(found < 1.0, "{off}: {found}");
    }
}
