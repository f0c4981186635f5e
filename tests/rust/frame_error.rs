//! What errors of a whole exposure add to a covariance, and the limits of a trusted pose (`docs/math.md`, section 10).

use crate::support::random::Random;
use crate::support::samples::{layout, sampled};
use crate::support::scene::{FOCAL, Scene};
use nalgebra::{Matrix6, Rotation3, Vector2, Vector3, Vector6};
use regionpose::{Estimate, FrameSigma, Limits, ObservedRegion, Options, Problem, Warning, WorldRegion};

fn estimated(observed: &[ObservedRegion], worlds: &[WorldRegion], frame_sigma: FrameSigma) -> Estimate {
    let problem = Problem::new(observed, worlds).unwrap();
    problem.estimate_with(&Options::default().with_frame_sigma(frame_sigma)).unwrap()
}

/// What the scene's camera sees of its regions, each bearing changed by its region's number.
fn seen(scene: &Scene, change: impl Fn(usize, Vector3<f64>) -> Vector3<f64>) -> Vec<ObservedRegion> {
    let region = |(number, (world, observed)): (usize, (&WorldRegion, &ObservedRegion))| {
        let bearing = |x: &Vector3<f64>| change(number, scene.pose.transform(x)).normalize();
        let rings = world.rings().iter().map(|ring| ring.iter().map(bearing).collect()).collect();
        ObservedRegion::new(rings, observed.pixel_area)
    };
    scene.worlds.iter().zip(&scene.observed).enumerate().map(region).collect()
}

#[test]
fn the_error_of_an_exposure_adds_to_the_covariance() {
    let scene = Scene::random(&mut Random::new(4), layout(3));
    let sigma = FrameSigma::ZERO.with_rotation(0.002).with_place(0.05).with_focal(0.01).with_center(2.0);
    let Estimate { best: alone, pixel_angle, .. } = estimated(&scene.observed, &scene.worlds, FrameSigma::ZERO);
    let whole = estimated(&scene.observed, &scene.worlds, sigma).best;
    assert!((pixel_angle * FOCAL - 1.0).abs() < 0.02, "{pixel_angle}");
    let turn = sigma.rotation.powi(2) + (sigma.center * pixel_angle).powi(2);
    // Of exact outlines the place has no error of its own.
    let added = Matrix6::from_diagonal(&Vector6::new(turn, turn, turn, 0.0, 0.0, 0.0))
        + alone.focal_shift * alone.focal_shift.transpose() * (sigma.focal * sigma.focal);
    assert!((whole.covariance - alone.covariance - added).amax() < 1e-12);
    assert_eq!((whole.confidence, whole.mode_probability), (alone.confidence, alone.mode_probability));
}

/// The derivative by the focal lengths, from the factor of each region as a whole, against poses of photos by a lens whose angles are a
/// thousandth larger and smaller: 4 % off in the median, 7 % at most.
#[test]
fn focal_lengths_move_a_pose_as_stated() {
    let mut errors: Vec<f64> = (0..20)
        .map(|seed| {
            let scene = Scene::random(&mut Random::new(seed), layout(3));
            let zoomed = |factor: f64| {
                let wider = |x: Vector3<f64>| {
                    let angle = x.xy().norm().atan2(x.z) * factor;
                    let across = x.xy().normalize() * angle.sin();
                    Vector3::new(across.x, across.y, angle.cos())
                };
                let observed = seen(&scene, |_, x| wider(x));
                estimated(&observed, &scene.worlds, FrameSigma::ZERO).best
            };
            let (step, given) = (1e-3_f64, zoomed(1.0));
            let moved = zoomed(step.exp()).pose.local_coordinates(&zoomed((-step).exp()).pose) / (2.0 * step);
            (moved - given.focal_shift).norm() / moved.norm()
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    assert!(errors[10] < 0.06 && errors[19] < 0.1, "{errors:.3?}");
}

/// The turn of poses of photos by a lens that keeps areas, whose center is a pixel beside, against the angle of a pixel.
#[test]
fn a_center_beside_its_place_turns_a_pose_by_its_angle() {
    let turn = |seed: u64, along: Vector2<f64>| {
        let scene = Scene::random(&mut Random::new(seed), layout(3));
        let seen_from = |center: Vector2<f64>| {
            let beside = |x: Vector3<f64>| {
                let pixel = x.xy().normalize() * (2.0 * FOCAL * (0.5 * x.xy().norm().atan2(x.z)).sin()) - center;
                let angle = 2.0 * (0.5 * pixel.norm() / FOCAL).asin();
                (pixel.normalize() * angle.sin()).push(angle.cos())
            };
            estimated(&seen(&scene, |_, x| beside(x)), &scene.worlds, FrameSigma::ZERO)
        };
        let [before, after] = [-0.5, 0.5].map(|share| seen_from(along * share));
        before.best.pose.local_coordinates(&after.best.pose).fixed_rows::<3>(0).norm() / before.pixel_angle
    };
    let both = |seed| [turn(seed, Vector2::x()), turn(seed, Vector2::y())];
    let mut turns: Vec<f64> = (0..20).flat_map(both).collect();
    turns.sort_by(f64::total_cmp);
    assert!((turns[19] - 1.0).abs() < 0.1 && turns[0] > 0.7 && turns[39] < 1.2, "{turns:.3?}");
}

/// A region that is seen half a degree beside its place moves the pose by several of the deviations that noise leaves; how far the regions
/// contradict one another makes up for that.
#[test]
fn regions_of_a_scan_that_contradict_one_another_widen_the_covariance() {
    let (mut beyond, mut by_noise) = (0, 0);
    for seed in 0..12 {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, layout(3));
        let worlds = sampled(&mut random, &scene.worlds, 0.1, 1.0);
        let turn = Rotation3::new(random.direction() * 0.5_f64.to_radians());
        let off = seen(&scene, |number, x| if number == 0 { turn * x } else { x });
        let sigmas = |frame_sigma: FrameSigma| {
            let best = estimated(&off, &worlds, frame_sigma).best;
            let increment = best.pose.local_coordinates(&scene.pose);
            increment.dot(&best.covariance.cholesky().unwrap().solve(&increment)).sqrt()
        };
        by_noise += usize::from(sigmas(FrameSigma::ZERO) > 4.5);
        beyond += usize::from(sigmas(FrameSigma::default()) > 4.5);
    }
    assert!(by_noise >= 4 && beyond == 0, "{by_noise} by noise alone, {beyond}");
}

#[test]
fn a_pose_beyond_the_limits_has_a_warning_that_names_them() {
    let scene = Scene::random(&mut Random::new(5), layout(3));
    let warned = |limits: Limits| {
        let options = Options::default().with_limits(limits);
        let estimate = Problem::new(&scene.observed, &scene.worlds).unwrap().estimate_with(&options).unwrap();
        let weak = estimate.warnings.iter().find_map(|warning| match warning {
            Warning::WeakGeometry { degrees, shift, most_degrees, most_shift, .. } => {
                Some([*degrees, *shift, *most_degrees, *most_shift])
            }
            _ => None,
        });
        (estimate.distance, weak)
    };
    let (distance, none) = warned(Limits::default());
    assert_eq!(none, None);
    let [degrees, shift, ..] = warned(Limits::default().with_rotation(0.0).with_translation(0.0)).1.unwrap();
    let (rotation, translation) = (degrees.to_radians(), shift / distance);
    let above = Limits::default().with_rotation(rotation * 1.01).with_translation(translation * 1.01);
    assert_eq!(warned(above).1, None);
    let turned = above.with_rotation(rotation * 0.99);
    let [.., most, _] = warned(turned).1.unwrap();
    assert!((most - 0.99 * degrees).abs() < 1e-9);
    let moved = above.with_translation(translation * 0.99);
    let [.., most] = warned(moved).1.unwrap();
    assert!((most - 0.99 * shift).abs() < 1e-9);
}
