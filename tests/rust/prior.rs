//! A prior resolves ambiguities and free directions of the regions, never more, and each warning is raised where it should be and
//! nowhere else.

use crate::support::jacobian::{assert_jacobian, differences};
use crate::support::random::Random;
use crate::support::scene::{Layout, Ring, Scene, angle_piece, placed, rectangle, regular, seen_plane};
use nalgebra::{DMatrix, DVector, Dyn, Matrix6, OMatrix, Rotation3, U6, Vector3};
use regionpose::internals::equations::least_squares::{Minimum, Termination};
use regionpose::internals::geometry::pose::{Tangent, increment_derivative};
use regionpose::internals::verdict::warning::Cause;
use regionpose::{Error, Estimate, Integration, Limits, Options, Pose, PoseSigma, Prior, System, Warning, WorldRegion};

/// Error allowed of the poses of a symmetric shape: rad, and a share of the distance.
const SYMMETRIC: f64 = 1e-8;

/// A few degrees and a few decimeters.
const ROUGH: PoseSigma = PoseSigma { rotation: 0.1, place: 0.2 };

fn estimated(scene: &Scene, prior: &Prior) -> Estimate {
    // Poses of a single plane are trusted farther here.
    let limits = Limits::default().with_rotation(1.5_f64.to_radians());
    let options = Options::default().with_prior(*prior).with_limits(limits);
    scene.problem(System::Plane, Integration::Boundary).estimate_with(&options).unwrap()
}

fn codes(estimate: &Estimate) -> Vec<&'static str> {
    estimate.warnings.iter().map(Warning::code).collect()
}

/// One shape 2.5 m away, its normal `tilt` off the ray, in a world of its own.
fn view(random: &mut Random, ring: Ring, tilt: f64) -> Scene {
    view_of(random, &[ring], 2.5, tilt)
}

/// Shapes of one plane that is seen at a distance.
fn view_of(random: &mut Random, rings: &[Ring], distance: f64, tilt: f64) -> Scene {
    let world_from_plane = random.pose(5.0);
    let direction = random.direction();
    let camera_from_plane = seen_plane(random, &direction, distance, tilt, true);
    let regions: Vec<_> = rings.iter().map(|ring| placed(std::slice::from_ref(ring), &world_from_plane)).collect();
    Scene::of_rings(camera_from_plane.after(&world_from_plane.inverse()), &regions)
}

/// A prior around the truth, in error by its standard deviations.
fn rough(random: &mut Random, truth: &Pose) -> Prior {
    let [a, b, c, x, y, z] = [0; 6].map(|_| random.normal());
    let turn = Rotation3::new(Vector3::new(a, b, c) * ROUGH.rotation);
    let translation = turn * truth.translation + Vector3::new(x, y, z) * ROUGH.place;
    Prior::default().with_initial(Pose::new(turn * truth.rotation, translation), Some(ROUGH)).unwrap()
}

/// The world direction that is up in the image of a camera.
fn up_of(truth: &Pose) -> Prior {
    Prior::default().with_up(truth.rotation.inverse() * -Vector3::y(), None).unwrap()
}

fn seen_from_the_camera(scene: &mut Scene) {
    let camera = scene.pose.inverse().translation;
    scene.worlds = scene.worlds.drain(..).map(|world| world.seen_from(camera).unwrap()).collect();
}

#[test]
fn a_rough_pose_with_its_uncertainty_leaves_one_pose_of_a_symmetric_shape() {
    let mut random = Random::new(61);
    for ring in [rectangle(1.6, 1.0), regular(4, 0.8), regular(6, 0.8)] {
        for _ in 0..5 {
            let scene = view(&mut random, ring.clone(), 0.7);
            let prior = rough(&mut random, &scene.pose);
            let start = Prior::default().with_initial(prior.initial().unwrap().0, None).unwrap();
            assert_eq!(codes(&estimated(&scene, &start)), ["ambiguous-pose"]);
            let estimate = estimated(&scene, &prior);
            assert!(estimate.alternatives.is_empty() && estimate.warnings.is_empty(), "{:?}", estimate.warnings);
            let (angle, place) = scene.errors(&estimate.best.pose);
            assert!(angle.max(place) < SYMMETRIC, "{angle:.1e} rad, {place:.1e}");
        }
    }
}

/// A poster on a wall, seen a little from above: of its four poses two are upright, one of them from behind.
#[test]
fn up_and_the_visible_side_together_leave_one_pose_of_a_rectangle() {
    let mut random = Random::new(62);
    for _ in 0..10 {
        let mut scene = view(&mut random, rectangle(1.6, 1.0), 0.5);
        let up = up_of(&scene.pose);
        let upright = estimated(&scene, &up);
        assert!(upright.alternatives.len() <= 1, "{} upright alternatives", upright.alternatives.len());
        seen_from_the_camera(&mut scene);
        assert_eq!(estimated(&scene, &Prior::default()).alternatives.len(), 1, "half of four see its front");
        let estimate = estimated(&scene, &up);
        assert!(estimate.warnings.is_empty(), "{:?}", estimate.warnings);
        assert!(scene.errors(&estimate.best.pose).0 < SYMMETRIC);
    }
}

/// The pose is that of the regions to the last digit: a prior of a few degrees weighs nothing against them.
#[test]
fn a_rough_prior_does_not_move_a_pose_that_is_held() {
    let mut random = Random::new(63);
    for regions in [1, 2] {
        let scene = Scene::random(&mut random, Layout { regions, ..Layout::default() });
        let free = estimated(&scene, &Prior::default());
        for prior in [rough(&mut random, &scene.pose), up_of(&scene.pose)] {
            let with_prior = estimated(&scene, &prior);
            assert!(with_prior.best.pose.angle_to(&free.best.pose) < 1e-9);
            assert_eq!(with_prior.warnings, free.warnings);
        }
    }
}

/// A prior with all its terms, each about another pose.
fn everything(random: &mut Random, initial: &Pose, upright: &Pose, place: &Pose) -> Prior {
    let [initial, up, near] = terms(random, initial, upright, place);
    let ((pose, sigma), (up, up_sigma), (near, near_sigma)) =
        (initial.initial().unwrap(), up.up().unwrap(), near.place().unwrap());
    let all = Prior::default().with_initial(pose, sigma).and_then(|prior| prior.with_up(up, Some(up_sigma)));
    all.and_then(|prior| prior.with_near(near, Some(near_sigma))).unwrap()
}

/// The terms of such a prior, each alone.
fn terms(random: &mut Random, initial: &Pose, upright: &Pose, place: &Pose) -> [Prior; 3] {
    let sigma = PoseSigma { rotation: random.uniform(0.05, 0.5), place: random.uniform(0.1, 2.0) };
    let up = upright.rotation.inverse() * Vector3::y() * -random.uniform(0.5, 20.0);
    let up = Prior::default().with_up(up, Some(random.uniform(0.05, 0.5)));
    let near = Prior::default().with_near(place.inverse().translation, Some(random.uniform(0.1, 2.0)));
    [Prior::default().with_initial(*initial, Some(sigma)), up, near].map(Result::unwrap)
}

/// Minus the log density of a pose moved by an increment, without the bound on what a wrong prior counts.
fn energy(prior: &Prior, pose: &Pose, by: &Tangent) -> f64 {
    let (moved, exact) = (pose.retract(by), Matrix6::zeros());
    let initial = prior.initial_deviation(&moved, &exact).and_then(|from| from.sigmas);
    let up = prior.up_deviation(&moved, &exact).map(|from| from.sigmas);
    let near = prior.place_deviation(&moved, &exact).map(|from| from.sigmas);
    [initial, up, near].into_iter().flatten().map(|sigmas| 0.5 * sigmas * sigmas).sum()
}

/// The vector of the factor is the slope of the log density wherever the pose is, up to a radian and meters away.
#[test]
fn a_priors_gaussian_has_the_slope_of_its_density() {
    let mut random = Random::new(71);
    for _ in 0..20 {
        let pose = random.pose(5.0);
        let mut away = || pose.retract(&random.tangent(1.0, 3.0));
        let others = [away(), away(), away()];
        let prior = everything(&mut random, &others[0], &others[1], &others[2]);
        let slope = OMatrix::<f64, Dyn, U6>::from_rows(&[-prior.gaussian(&pose).information_vector.transpose()]);
        let value = |by: &Tangent| DVector::from_element(1, energy(&prior, &pose, by));
        assert_jacobian(&slope, value, &Tangent::zeros(), 1.0, 1e-8);
    }
}

/// Where pose and prior agree, its information is the curvature of the density: of all terms, and of each alone.
#[test]
fn a_priors_gaussian_has_the_curvature_of_its_density_where_they_agree() {
    let mut random = Random::new(72);
    for _ in 0..20 {
        let pose = random.pose(5.0);
        let all = everything(&mut random, &pose, &pose, &pose);
        for prior in [all].into_iter().chain(terms(&mut random, &pose, &pose, &pose)) {
            // The slope at the moved pose, by the further increment, back to the first (`docs/math.md`, eq. 1.5).
            let slope = |by: &Tangent| {
                let vector =
                    increment_derivative(by).transpose() * -prior.gaussian(&pose.retract(by)).information_vector;
                DVector::from_column_slice(vector.as_slice())
            };
            let information = prior.gaussian(&pose).information;
            let rows = OMatrix::<f64, Dyn, U6>::from_fn(6, |row, column| information[(row, column)]);
            let curvature = differences(&slope, &Tangent::zeros(), 1.0);
            assert!((DMatrix::from_fn(6, 6, |r, c| rows[(r, c)]) - &curvature).amax() < 1e-8 * curvature.amax());
        }
    }
}

/// From anywhere: each term's own mean is one Newton step away, and stays put.
#[test]
fn one_step_by_a_priors_gaussian_ends_at_its_mean() {
    let mut random = Random::new(73);
    for _ in 0..20 {
        let (pose, mean) = (random.pose(5.0), random.pose(5.0));
        let [rough, upright, near] = terms(&mut random, &mean, &mean, &mean);
        let factor = rough.gaussian(&pose);
        let reached = pose.retract(&(factor.information.try_inverse().unwrap() * factor.information_vector));
        assert!(reached.angle_to(&mean) < 1e-9);
        let place = near.gaussian(&pose);
        let tau = place.information_vector.fixed_rows::<3>(3) / place.information[(3, 3)];
        let carried = Pose::new(pose.rotation, pose.translation + tau);
        assert!((carried.inverse().translation - mean.inverse().translation).norm() < 1e-9);
        let up = upright.gaussian(&pose);
        let (direction, sigma) = upright.up().unwrap();
        let turn = Rotation3::new(up.information_vector.fixed_rows::<3>(0) * (sigma * sigma));
        assert!((turn * pose.rotation * direction.normalize() + Vector3::y()).norm() < 1e-9);
        // It has no information on a turn about up.
        assert!((up.information.fixed_view::<3, 3>(0, 0) * (pose.rotation * direction)).norm() < 1e-9);
    }
    assert!(Prior::default().gaussian(&random.pose(5.0)).information == Matrix6::zeros());
}

/// A prior of the camera's place chooses one of a rectangle's poses, from four sides, and moves none.
#[test]
fn a_place_the_camera_is_near_leaves_one_pose_of_a_rectangle() {
    let mut random = Random::new(74);
    for _ in 0..10 {
        let scene = view(&mut random, rectangle(1.6, 1.0), 0.7);
        let near = scene.pose.inverse().translation + random.direction() * 0.3;
        let prior = Prior::default().with_near(near, Some(0.2)).unwrap();
        let estimate = estimated(&scene, &prior);
        assert!(estimate.alternatives.is_empty() && estimate.warnings.is_empty(), "{:?}", estimate.warnings);
        let (angle, place) = scene.errors(&estimate.best.pose);
        assert!(angle.max(place) < SYMMETRIC, "{angle:.1e} rad, {place:.1e}");
    }
}

#[test]
fn a_camera_elsewhere_than_the_place_it_should_be_near_is_warned_of_and_stands() {
    let scene = Scene::random(&mut Random::new(75), Layout { regions: 2, ..Layout::default() });
    let near = scene.pose.inverse().translation + Vector3::new(0.0, 12.0, 0.0);
    let prior = Prior::default().with_near(near, None).unwrap();
    let estimate = estimated(&scene, &prior);
    assert!(scene.errors(&estimate.best.pose).0 < 1e-9);
    assert_eq!(codes(&estimate), ["camera-position-conflict"]);
    let Warning::PlaceContradicted { shift, sigmas } = estimate.warnings[0] else { panic!("{:?}", estimate.warnings) };
    assert!((shift - 12.0).abs() < 1e-4 && (sigmas - 6.0).abs() < 0.05, "{shift} m, {sigmas} sigmas");
    assert!(codes(&estimated(&scene, &prior.with_near(near, Some(3.0)).unwrap())).is_empty());
}

#[test]
fn a_pose_elsewhere_than_the_initial_one_is_warned_of_and_stands() {
    let mut random = Random::new(64);
    let scene = Scene::random(&mut random, Layout { regions: 2, ..Layout::default() });
    let true_center = scene.pose.inverse().translation;
    let away = Pose::new(scene.pose.rotation, -(scene.pose.rotation * (true_center + Vector3::new(3.0, 0.0, 0.0))));
    let prior = Prior::default().with_initial(away, Some(ROUGH)).unwrap();
    let estimate = estimated(&scene, &prior);
    assert!(scene.errors(&estimate.best.pose).0 < 1e-9);
    assert_eq!(codes(&estimate), ["initial-pose-conflict"]);
    let Warning::InitialContradicted { degrees, shift, sigmas: Some(sigmas) } = estimate.warnings[0] else {
        panic!("{:?}", estimate.warnings)
    };
    assert!(degrees < 5e-3 && (shift - 3.0).abs() < 1e-4 && (sigmas - 15.0).abs() < 0.05, "{degrees} {shift} {sigmas}");
    // Without an uncertainty a meter is as good as any, half a turn is not.
    assert!(codes(&estimated(&scene, &prior.with_initial(away, None).unwrap())).is_empty());
    let turned = Pose::new(Rotation3::new(Vector3::y() * 1.5), Vector3::zeros()).after(&scene.pose);
    let turned = estimated(&scene, &Prior::default().with_initial(turned, None).unwrap());
    assert_eq!(codes(&turned), ["initial-pose-conflict"]);
    let Warning::InitialContradicted { degrees, .. } = turned.warnings[0] else { panic!("{:?}", turned.warnings) };
    assert!((degrees - 1.5_f64.to_degrees()).abs() < 5e-3, "{degrees}");
}

#[test]
fn an_up_direction_or_a_side_that_no_pose_shows_is_warned_of() {
    let mut random = Random::new(65);
    let mut scene = Scene::random(&mut random, Layout { regions: 2, ..Layout::default() });
    let down = Prior::default().with_up(-up_of(&scene.pose).up().unwrap().0, None).unwrap();
    let estimate = estimated(&scene, &down);
    assert_eq!(codes(&estimate), ["up-direction-conflict"]);
    let Warning::UpContradicted { degrees, sigmas } = estimate.warnings[0] else { panic!("{:?}", estimate.warnings) };
    assert!((degrees - 180.0).abs() < 0.05 && (sigmas - 12.0).abs() < 0.05, "{degrees} deg, {sigmas} sigmas");
    assert!(codes(&estimated(&scene, &up_of(&scene.pose))).is_empty());

    let camera = scene.pose.inverse().translation;
    let mirrored = |world: &WorldRegion| {
        let frame = world.frame();
        camera - frame.axes()[2] * (2.0 * frame.height(&camera))
    };
    scene.worlds[1] = scene.worlds[1].clone().seen_from(mirrored(&scene.worlds[1])).unwrap();
    let estimate = estimated(&scene, &Prior::default());
    assert!(scene.errors(&estimate.best.pose).0 < 1e-9);
    assert_eq!(codes(&estimate), ["viewpoint-conflict"]);
    assert_eq!(estimate.warnings[0].region(), Some(1));
    seen_from_the_camera(&mut scene);
    assert!(codes(&estimated(&scene, &Prior::default())).is_empty());
}

#[test]
fn a_viewpoint_in_the_plane_is_refused() {
    let world = WorldRegion::from_rings(&placed(&[rectangle(1.0, 1.0)], &Pose::identity())).unwrap();
    let message = world.clone().seen_from(Vector3::new(5.0, 0.0, 0.004)).unwrap_err().to_string();
    assert!(message.contains("4.000e-3 off the region's plane"), "{message}");
    assert!(world.clone().seen_from(Vector3::new(f64::NAN, 0.0, 1.0)).is_err());
    let seen = world.clone().seen_from(Vector3::new(5.0, 0.0, 0.01)).unwrap();
    assert!(seen.is_behind(&Vector3::new(0.0, 0.0, -1.0)) && !seen.is_behind(&Vector3::new(9.0, 0.0, 1e-6)));
    assert!(!world.is_behind(&Vector3::new(0.0, 0.0, -1.0)) && world.viewpoint().is_none());
}

/// Half a turn about the normal, and about each side: 180 degrees all three, the camera across the poster and behind it.
#[test]
fn an_ambiguous_pose_has_the_distances_of_the_others() {
    let scene = view(&mut Random::new(66), rectangle(1.6, 1.0), 0.5);
    let estimate = estimated(&scene, &Prior::default());
    let Some(Warning::Ambiguous { others }) = estimate.warnings.first() else { panic!("{:?}", estimate.warnings) };
    assert_eq!(others.len(), 3);
    let best = estimate.best.pose;
    for way in others {
        assert!((way.degrees - 180.0).abs() < 1e-5 && (way.axis.norm() - 1.0).abs() < 1e-9);
        let turned = Rotation3::new(way.axis * way.degrees.to_radians()) * best.rotation;
        // Half turns lie within round-off of one another: each way is some alternative's.
        let leads_to = |pose: &Pose| {
            let shift = (pose.inverse().translation - best.inverse().translation).norm();
            (turned.matrix() - pose.rotation.matrix()).amax() < 1e-6 && (way.shift - shift).abs() < 1e-6
        };
        assert!(estimate.alternatives.iter().any(|other| leads_to(&other.pose)), "{way:?}");
    }
    let hexagon = view(&mut Random::new(66), regular(6, 0.8), 0.5);
    let warnings = estimated(&hexagon, &Prior::default()).warnings;
    assert!(matches!(&warnings[0], Warning::Ambiguous { others } if others.len() == 11), "{warnings:?}");
}

fn weakness(scene: &Scene) -> Option<(f64, f64, Vec<Cause>)> {
    estimated(scene, &Prior::default()).warnings.into_iter().find_map(|warning| {
        let Warning::WeakGeometry { degrees, shift, causes, .. } = warning else { return None };
        Some((degrees, shift, causes))
    })
}

/// A shape of 28 px seen frontally is weak; one of 42 px tilted by 50 degrees is not.
#[test]
fn a_small_plane_that_faces_the_camera_is_weak_for_that() {
    let mut random = Random::new(67);
    let seen = |random: &mut Random, distance: f64, tilt: f64| view_of(random, &[angle_piece(1.0)], distance, tilt);
    let (degrees, shift, causes) = weakness(&seen(&mut random, 30.0, 0.02)).unwrap();
    assert!(degrees > 1.0 && shift > 0.0);
    assert!(matches!(causes[..], [Cause::Frontal { degrees }] if degrees < 3.0), "{causes:?}");
    let tilted = weakness(&seen(&mut random, 20.0, 0.9));
    assert!(tilted.is_none(), "{tilted:?}");
}

#[test]
fn a_region_of_few_pixels_is_weak_for_that() {
    let mut random = Random::new(68);
    let (_, _, causes) = weakness(&view_of(&mut random, &[angle_piece(1.0)], 250.0, 0.9)).unwrap();
    assert!(matches!(causes[..], [Cause::Tiny { pixels }] if pixels > 1.0 && pixels < 5.0), "{causes:?}");
}

/// Two plates side by side on a wall that faces the camera; the wall tilted, or two planes.
#[test]
fn regions_of_one_plane_are_weak_for_that() {
    let mut random = Random::new(69);
    let aside = |ring: Ring, by: f64| ring.into_iter().map(|p| p + nalgebra::Vector2::new(by, 0.0)).collect::<Ring>();
    let plates = [aside(angle_piece(1.0), -0.7), aside(angle_piece(1.0), 0.7)];
    let (_, _, causes) = weakness(&view_of(&mut random, &plates, 40.0, 0.02)).unwrap();
    assert!(matches!(causes[..], [Cause::Coplanar, Cause::Frontal { .. }]), "{causes:?}");
    assert!(weakness(&view_of(&mut random, &plates, 40.0, 0.9)).is_none());
    let corner = Scene::random(&mut random, Layout { regions: 2, ..Layout::default() });
    assert!(weakness(&corner).is_none());
}

#[test]
fn a_least_squares_that_did_not_converge_is_warned_of() {
    let scene = Scene::random(&mut Random::new(70), Layout { regions: 2, ..Layout::default() });
    let problem = scene.problem(System::Plane, Integration::Boundary);
    let ended = |converged: bool| Minimum {
        pose: scene.pose,
        cost: 0.0,
        converged,
        termination: Termination::EvaluationLimit,
        evaluations: 140,
    };
    let judged = |converged: bool| problem.search(&Options::default()).assess(vec![ended(converged)]).unwrap().warnings;
    assert!(judged(true).is_empty());
    let Warning::NotConverged { termination } = &judged(false)[0] else { panic!("{:?}", judged(false)) };
    assert_eq!(*termination, Termination::EvaluationLimit);
}

/// What no pose can be compared with is refused by its name, and is not left out without a word.
#[test]
fn a_prior_of_anything_but_numbers_is_refused() {
    let pose = Random::new(31).pose(5.0);
    let item = |prior: Result<Prior, Error>| match prior.unwrap_err() {
        Error::NotFinite { item, index, .. } => format!("{item} {index}"),
        Error::InvalidPrior { item, .. } | Error::InvalidRotation { item, .. } => item.to_owned(),
        other => panic!("{other:?}"),
    };
    let none = Prior::default();
    let nan = Vector3::new(0.0, f64::NAN, 1.0);
    assert_eq!(item(none.with_near(nan, None)), "near entry 1");
    assert_eq!(item(none.with_up(nan, None)), "up entry 1");
    assert_eq!(item(none.with_up(Vector3::zeros(), None)), "up");
    assert_eq!(item(none.with_initial(Pose::new(pose.rotation, nan), None)), "pose entry 10");
    let scaled = Rotation3::from_matrix_unchecked(pose.rotation.matrix() * 1.1);
    assert_eq!(item(none.with_initial(Pose::new(scaled, Vector3::z()), None)), "rotation");
    for sigma in [f64::NAN, f64::INFINITY, 0.0, -0.1] {
        assert_eq!(item(none.with_up(Vector3::y(), Some(sigma))), "up_sigma");
        assert_eq!(item(none.with_near(Vector3::zeros(), Some(sigma))), "near_sigma");
        let rough = |rotation, place| none.with_initial(pose, Some(PoseSigma { rotation, place }));
        assert_eq!(item(rough(sigma, 0.1)), "initial_sigma.rotation");
        assert_eq!(item(rough(0.1, sigma)), "initial_sigma.place");
    }
}
