//! Poses from directions: exact where the camera stands at the place, off by the parallax where it stands near it.

use crate::support::random::Random;
use crate::support::scene::{Layout, Ring, Scene, angle_piece, placed, rendered, seen_plane};
use nalgebra::{Rotation3, Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::contour::fit::refined;
use regionpose::internals::search::directions::direction_poses;
use regionpose::{Integration, Pose, Prior, Problem, System, WorldRegion};

/// Every piece of the contours.
const ALL: usize = 1;

fn problem(scene: &Scene) -> Problem {
    scene.problem(System::Plane, Integration::Boundary)
}

fn near(place: Vector3<f64>) -> Prior {
    Prior::default().with_near(place, None).unwrap()
}

/// The direction poses as `camera_from_world`.
fn found(scene: &Scene, prior: &Prior) -> Vec<Pose> {
    let problem = problem(scene);
    // The pose about the problem's origin of the world's own.
    let origin = problem.centered(&Pose::identity()).translation;
    let uncentered = |pose: Pose| Pose::new(pose.rotation, pose.translation - pose.rotation * origin);
    direction_poses(&problem, prior, ALL, &Budget::unlimited()).into_iter().map(uncentered).collect()
}

fn asymmetric(random: &mut Random, regions: usize, field: f64) -> Scene {
    let shapes = vec![vec![angle_piece(1.0)]; regions];
    let front = random.index(2) == 0;
    Scene::of_shapes(random, shapes, Layout { regions, field, front, ..Layout::default() })
}

#[test]
fn directions_of_several_regions_give_the_pose_of_a_camera_at_the_place() {
    let mut random = Random::new(81);
    for regions in [2, 3, 5] {
        for _ in 0..20 {
            let scene = Scene::random(&mut random, Layout { regions, field: 0.8, ..Layout::default() });
            let poses = found(&scene, &near(scene.pose.inverse().translation));
            let (angle, place) = scene.errors(&poses[0]);
            assert!(angle.max(place) < 1e-9, "{angle:.1e} rad, {place:.1e}");
        }
    }
}

/// The rotation is off by no more than the place over the distance, and by half where the place is off by half.
#[test]
fn a_place_that_errs_turns_the_pose_by_its_parallax() {
    let mut random = Random::new(82);
    for _ in 0..40 {
        let scene = Scene::random(&mut random, Layout { regions: 3, field: 0.8, ..Layout::default() });
        let away = random.direction();
        let camera = scene.pose.inverse().translation;
        let error = |by: f64| {
            let poses = found(&scene, &near(camera + away * by));
            assert!((poses[0].inverse().translation - camera - away * by).norm() < 1e-9);
            poses[0].angle_to(&scene.pose)
        };
        let (whole, half) = (error(0.1), error(0.05));
        // Nearest region 3 m away; about the regions' own axis three directions 45 degrees off hold a turn less.
        assert!(whole < 2.0 * 0.1 / 3.0, "{whole:.3} rad");
        assert!((whole / half - 2.0).abs() < 0.2, "{whole:.2e} rad and {half:.2e} rad");
    }
}

/// The up direction or else the contours determine the turn that directions leave free: an L alone, from either side, and two
/// close by.
#[test]
fn a_turn_that_directions_leave_free_is_that_of_up_or_of_the_contours() {
    let mut random = Random::new(83);
    for (regions, field) in [(1, 0.5), (2, 0.02)] {
        for _ in 0..20 {
            let scene = asymmetric(&mut random, regions, field);
            let free = near(scene.pose.inverse().translation);
            let poses = found(&scene, &free);
            assert!(poses.len() >= 2 && poses.len() <= 5, "{} poses", poses.len());
            // To half a step of 5 degrees, the nearest to the contours first of those that are turned.
            let angle = poses[1].angle_to(&scene.pose);
            assert!(angle < 2.51_f64.to_radians(), "{:.2} deg, {regions} regions", angle.to_degrees());
            let up = scene.pose.rotation.inverse() * -Vector3::y();
            let angle = found(&scene, &free.with_up(up, None).unwrap())[0].angle_to(&scene.pose);
            assert!(angle < 1e-9, "{angle:.1e} rad");
        }
    }
}

/// A turn that the directions constrain to 10 degrees needs no other start: the contours converge from there.
#[test]
fn the_contours_converge_from_a_turn_that_does_not_count_as_free() {
    let mut random = Random::new(84);
    for regions in [1, 2, 3] {
        for _ in 0..20 {
            let scene = asymmetric(&mut random, regions, 0.5);
            let problem = problem(&scene);
            let centered = problem.centered(&scene.pose);
            let ray = scene.pose.transform(&scene.middle()).normalize();
            let turn = Rotation3::new(ray * 10.0_f64.to_radians());
            let start = Pose::new(turn * centered.rotation, turn * centered.translation);
            let fit = refined(problem.contours(), &start, ALL, &Budget::unlimited()).unwrap();
            assert!(fit.pose.angle_to(&centered) < 1e-3, "{:.2e} rad", fit.pose.angle_to(&centered));
        }
    }
}

/// A region seen from a point of its own plane has no direction; without any there is no pose.
#[test]
fn a_place_in_a_regions_plane_or_no_place_gives_no_pose() {
    let scene = asymmetric(&mut Random::new(85), 1, 0.5);
    let frame = scene.worlds[0].frame();
    assert!(found(&scene, &near(frame.origin() + frame.axes()[0] * 5.0)).is_empty());
    assert!(found(&scene, &Prior::default()).is_empty());
}

/// Walls of which either side has lost another third, about 5 m away: no outline matches, and still each start is
/// within a few degrees, a share of what the walls subtend.
#[test]
fn walls_cut_on_both_sides_are_seen_in_their_directions() {
    let mut random = Random::new(86);
    let wall = |from: f64, to: f64| vec![[from, -0.4], [to, -0.4], [to, 0.4], [from, 0.4]];
    let ring = |corners: Vec<[f64; 2]>| corners.into_iter().map(Vector2::from).collect::<Ring>();
    for _ in 0..20 {
        let pose = random.pose(5.0);
        let mut scene = Scene { pose, observed: Vec::new(), worlds: Vec::new() };
        for spoke in 0..3 {
            let away = Rotation3::from_axis_angle(&Vector3::z_axis(), 2.1 * f64::from(spoke)) * Vector3::x();
            let direction = (Vector3::z() + away * 0.7).normalize();
            let plane = pose.inverse().after(&seen_plane(&mut random, &direction, 5.0, 0.5, true));
            scene.observed.push(rendered(&placed(&[ring(wall(-0.6, 0.3))], &plane), &pose));
            scene.worlds.push(WorldRegion::from_rings(&placed(&[ring(wall(-0.3, 0.6))], &plane)).unwrap());
        }
        let angle = found(&scene, &near(pose.inverse().translation))[0].angle_to(&pose).to_degrees();
        assert!(angle < 8.0, "{angle:.1} deg");
    }
}
