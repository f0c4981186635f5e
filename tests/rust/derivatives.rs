//! Every derivative by the pose, against central differences of the values it belongs to.

use crate::support::jacobian::{assert_jacobian, jacobian_error};
use crate::support::random::Random;
use crate::support::scene::{Layout, Ring, Scene, pierced_star, placed, rendered, seen_plane, star};
use nalgebra::{DVector, Dyn, OMatrix, U6, Vector2, Vector3};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::equations::derivatives::{
    PLANE_REACH, Row, SPHERE_REACH, plane_derivative, sphere_derivative,
};
use regionpose::internals::equations::facet::SPHERE_MESH_SIZE;
use regionpose::internals::equations::residual::{Evaluation, cost, normal_equations};
use regionpose::internals::equations::system::Weighting;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::region::PlaneFrame;
use regionpose::moments::plane::planar_moments;
use regionpose::moments::sphere::spherical_moments;
use regionpose::{Integration, Pose, Problem, System, WorldRegion};

/// Error allowed of exact derivatives: that of the differences.
const DIFFERENCES: f64 = 1e-6;

/// Orders of the moments whose derivatives are checked one by one.
const PLANE_ORDER: usize = 6;
const SPHERE_ORDER: usize = 3;

const WEIGHTINGS: [Weighting; 2] = [Weighting::Uniform, Weighting::Whitened];

fn matrix(rows: &[Row]) -> OMatrix<f64, Dyn, U6> {
    OMatrix::<f64, Dyn, U6>::from_fn(rows.len(), |row, column| rows[row][column])
}

/// A pierced star 3 away around the z axis, in camera coordinates, and its plane `nu . P = 1`.
fn camera_region(random: &mut Random, front: bool) -> (Vec<Vec<Vector3<f64>>>, Vector3<f64>) {
    let (offset, tilt) = (random.direction() * 0.3, random.uniform(0.0, 1.1));
    let plane = seen_plane(random, &(Vector3::z() + offset).normalize(), 3.0, tilt, front);
    let normal: Vector3<f64> = plane.rotation * Vector3::z();
    (placed(&pierced_star(random, 9, 1.0), &plane), normal / normal.dot(&plane.translation))
}

fn moved(rings: &[Vec<Vector3<f64>>], x: &Tangent) -> Vec<Vec<Vector3<f64>>> {
    let motion = Pose::identity().retract(x);
    rings.iter().map(|ring| ring.iter().map(|p| motion.transform(p)).collect()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn plane_moments_follow_their_derivatives(seed: u64, front: bool) {
        let (rings, nu) = camera_region(&mut Random::new(seed), front);
        let moments = |x: &Tangent, order: usize| {
            let flat = |p: &Vector3<f64>| Vector2::new(p.x / p.z, p.y / p.z);
            let flat: Vec<Ring> = moved(&rings, x).iter().map(|ring| ring.iter().map(flat).collect()).collect();
            planar_moments(flat.iter().map(Vec::as_slice), order)
        };
        let here = moments(&Tangent::zeros(), PLANE_ORDER + PLANE_REACH);
        let exponents: Vec<_> = (0..=PLANE_ORDER).flat_map(|k| (0..=k).map(move |j| (k - j, j))).collect();
        let rows: Vec<Row> = exponents.iter().map(|&(i, j)| plane_derivative(&here, &nu, i, j)).collect();
        let values = |x: &Tangent| {
            let moments = moments(x, PLANE_ORDER);
            DVector::from_iterator(exponents.len(), exponents.iter().map(|&(i, j)| moments.get(i, j)))
        };
        assert_jacobian(&matrix(&rows), values, &Tangent::zeros(), 3.0, DIFFERENCES);
    }

    #[test]
    fn sphere_moments_follow_their_derivatives(seed: u64, front: bool) {
        let mut random = Random::new(seed);
        let (rings, nu) = camera_region(&mut random, front);
        let turn = random.rotation();
        let rings: Vec<Vec<_>> = rings.iter().map(|ring| ring.iter().map(|p| turn * p).collect()).collect();
        let moments = |x: &Tangent, order: usize| {
            let moved = moved(&rings, x);
            let seen: Vec<Vec<_>> = moved.iter().map(|ring| ring.iter().map(Vector3::normalize).collect()).collect();
            spherical_moments(seen.iter().map(Vec::as_slice), order)
        };
        let here = moments(&Tangent::zeros(), SPHERE_ORDER + SPHERE_REACH);
        let exponents: Vec<[usize; 3]> = (0..=SPHERE_ORDER)
            .flat_map(|k| (0..=k).flat_map(move |p| (0..=p).map(move |n| [k - p, p - n, n])))
            .collect();
        let rows: Vec<Row> = exponents.iter().map(|&e| sphere_derivative(&here, &(turn * nu), e)).collect();
        let values = |x: &Tangent| {
            let moments = moments(x, SPHERE_ORDER);
            DVector::from_iterator(exponents.len(), exponents.iter().map(|&[l, m, n]| moments.get(l, m, n)))
        };
        assert_jacobian(&matrix(&rows), values, &Tangent::zeros(), 3.0, DIFFERENCES);
    }
}

/// A planar region with a hole whose frame is given, and with it the side it shows.
fn one_sided(random: &mut Random, camera: &Pose, front: bool) -> Scene {
    let direction = random.direction();
    let (distance, tilt) = (random.uniform(3.0, 5.0), random.uniform(0.2, 1.0));
    let plane = camera.inverse().after(&seen_plane(random, &direction, distance, tilt, front));
    let shape = pierced_star(random, 9, 1.0);
    let axes = [0, 1, 2].map(|k| plane.rotation.matrix().column(k).into_owned());
    let frame = PlaneFrame::new(plane.translation, axes).unwrap();
    let world = WorldRegion::from_outline(frame, PlaneRings::polygon(shape.clone()).unwrap());
    Scene { pose: *camera, observed: vec![rendered(&placed(&shape, &plane), camera)], worlds: vec![world] }
}

/// A curved patch: a grid of `n` by `n` squares bent onto a paraboloid, each cut in two; either side shows.
fn curved(random: &mut Random, camera: &Pose, front: bool) -> Scene {
    const N: usize = 4;
    let direction = random.direction();
    let plane = camera.inverse().after(&seen_plane(random, &direction, 4.0, 0.5, front));
    let at = |k: usize| {
        let (x, y) = ((k % (N + 1)) as f64 / N as f64 - 0.5, (k / (N + 1)) as f64 / N as f64 - 0.5);
        plane.transform(&Vector3::new(1.6 * x, 1.2 * y, 0.3 * x * x + 0.2 * x * y - 0.1 * y * y))
    };
    let vertices: Vec<_> = (0..(N + 1) * (N + 1)).map(at).collect();
    let square = |k: usize| {
        let corner = k / N * (N + 1) + k % N;
        [[corner, corner + 1, corner + N + 2], [corner, corner + N + 2, corner + N + 1]]
    };
    let triangles: Vec<_> = (0..N * N).flat_map(square).collect();
    let world = WorldRegion::from_mesh(&vertices, &triangles).unwrap();
    assert!(world.surface().is_some());
    Scene { pose: *camera, observed: vec![rendered(&world.rings(), camera)], worlds: vec![world] }
}

/// Worst error of `Problem::evaluate_moved`, at the pose itself and after an increment.
fn problem_error(problem: &Problem, random: &mut Random, pose: &Pose, weighting: Weighting) -> f64 {
    let start = pose.retract(&random.tangent(0.05, 0.1));
    let values = |x: &Tangent| problem.evaluate_moved(&start, x, weighting).unwrap().residual;
    let increments = [Tangent::zeros(), random.tangent(0.1, 0.2), random.tangent(1e-5, 0.1)];
    let error = |x: &Tangent| {
        let evaluation = problem.evaluate_moved(&start, x, weighting).unwrap();
        jacobian_error(&evaluation.jacobian, values, x, 4.0)
    };
    increments.iter().map(error).fold(0.0, f64::max)
}

/// Worst error over scenes of both kinds, seen from both sides.
fn worst_error(system: System, integration: Integration, weighting: Weighting) -> f64 {
    let mut random = Random::new(11);
    let mut worst = 0.0_f64;
    for trial in 0..6 {
        let camera = random.pose(5.0);
        for build in [one_sided, curved] {
            let scene = build(&mut random, &camera, trial % 2 == 0);
            let problem = scene.problem(system, integration);
            worst = worst.max(problem_error(&problem, &mut random, &camera, weighting));
        }
    }
    worst
}

#[test]
fn boundary_jacobians_match_differences() {
    for system in [System::Plane, System::Sphere] {
        for weighting in WEIGHTINGS {
            let error = worst_error(system, Integration::Boundary, weighting);
            assert!(error < DIFFERENCES, "{system:?}, {weighting:?}: {error:.1e}");
        }
    }
}

#[test]
fn plane_mesh_jacobians_match_differences() {
    for weighting in WEIGHTINGS {
        let error = worst_error(System::Plane, Integration::Mesh { size: None }, weighting);
        assert!(error < DIFFERENCES, "{weighting:?}: {error:.1e}");
    }
}

#[test]
fn sphere_mesh_jacobians_match_differences() {
    for weighting in WEIGHTINGS {
        let error = worst_error(System::Sphere, Integration::Mesh { size: None }, weighting);
        assert!(error < DIFFERENCES, "{weighting:?}: {error:.1e}");
    }
}

#[test]
fn the_size_of_a_mesh_moves_the_sphere_alone_and_its_jacobian_follows() {
    let scene = Scene::random(&mut Random::new(8), Layout::default());
    let of = |system, size| scene.problem(system, Integration::Mesh { size }).evaluate(&scene.pose, Weighting::Uniform);
    let gap = |system, size| {
        let (default, sized) = (of(system, None).unwrap(), of(system, Some(size)).unwrap());
        (default.jacobian - sized.jacobian).amax()
    };
    assert!(gap(System::Plane, 0.3) < 1e-12);
    assert_eq!(gap(System::Sphere, SPHERE_MESH_SIZE), 0.0);
    assert!(gap(System::Sphere, 1.0) > 1e-12);
    for weighting in WEIGHTINGS {
        let error = worst_error(System::Sphere, Integration::Mesh { size: Some(0.3) }, weighting);
        assert!(error < DIFFERENCES, "{weighting:?}: {error:.1e}");
    }
}

#[test]
fn jacobians_of_several_regions_are_stacked() {
    let mut random = Random::new(5);
    let scene = Scene::random(&mut random, Layout { regions: 3, ..Layout::default() });
    let all = scene.problem(System::Plane, Integration::Boundary).evaluate(&scene.pose, Weighting::Uniform).unwrap();
    assert_eq!(all.residual.len(), 39);
    for (k, (observed, world)) in scene.observed.iter().zip(&scene.worlds).enumerate() {
        let one = Problem::new(std::slice::from_ref(observed), std::slice::from_ref(world)).unwrap();
        let one = one.evaluate(&scene.pose, Weighting::Uniform).unwrap();
        assert!((all.jacobian.rows(13 * k, 13) - one.jacobian).amax() < 1e-12);
    }
}

/// The cost and the normal equations come without the Jacobian that they follow from, whichever side of a region is seen.
#[test]
fn cost_and_normal_equations_are_those_of_residual_and_jacobian() {
    let mut random = Random::new(15);
    for trial in 0..4 {
        let camera = random.pose(5.0);
        let scene = one_sided(&mut random, &camera, trial % 2 == 0);
        let pose = camera.retract(&random.tangent(0.05, 0.1));
        let middle = scene.worlds[0].frame().origin();
        let centered = Pose::new(pose.rotation, pose.transform(middle));
        for (system, weighting) in [System::Plane, System::Sphere].into_iter().flat_map(|s| WEIGHTINGS.map(|w| (s, w)))
        {
            let problem = scene.problem(system, Integration::Boundary);
            let Evaluation { residual, jacobian } = problem.evaluate(&pose, weighting).unwrap();
            let normal = normal_equations(problem.regions(), &centered, weighting, &Budget::unlimited()).unwrap();
            let (information, gradient) = (jacobian.transpose() * &jacobian, jacobian.transpose() * &residual);
            let squared = residual.norm_squared();
            assert!((normal.cost - squared).abs() < 1e-12 * squared);
            assert!(
                (cost(problem.regions(), &centered, weighting, &Budget::unlimited()).unwrap() - squared).abs()
                    < 1e-10 * squared
            );
            assert!((normal.information - information).amax() < 1e-12 * information.amax());
            assert!((normal.gradient - gradient).amax() < 1e-11 * gradient.amax());
        }
    }
}

/// Largest difference of residuals and derivatives between boundary and mesh, relative to the largest derivative.
fn form_difference(scene: &Scene, system: System, pose: &Pose) -> f64 {
    let [boundary, mesh] = [Integration::Boundary, Integration::Mesh { size: None }]
        .map(|integration| scene.problem(system, integration).evaluate(pose, Weighting::Uniform).unwrap());
    let gap = (&boundary.residual - &mesh.residual).amax().max((&boundary.jacobian - &mesh.jacobian).amax());
    gap / boundary.jacobian.amax()
}

#[test]
fn both_forms_agree_on_planar_regions_and_surfaces() {
    let mut random = Random::new(12);
    let mut worst = [0.0_f64; 2];
    for trial in 0..10 {
        let camera = random.pose(5.0);
        for build in [one_sided, curved] {
            let scene = build(&mut random, &camera, trial % 2 == 0);
            let pose = camera.retract(&random.tangent(0.05, 0.1));
            for (worst, system) in worst.iter_mut().zip([System::Plane, System::Sphere]) {
                *worst = worst.max(form_difference(&scene, system, &pose));
            }
        }
    }
    assert!(worst[0] < 1e-12, "plane: {:.1e}", worst[0]);
    assert!(worst[1] < 1e-7, "sphere: {:.1e}", worst[1]);
}

#[test]
fn residuals_vanish_at_the_truth_from_both_sides() {
    let mut random = Random::new(13);
    for trial in 0..10 {
        let camera = random.pose(5.0);
        let scene = one_sided(&mut random, &camera, trial % 2 == 0);
        for system in [System::Plane, System::Sphere] {
            let evaluation =
                scene.problem(system, Integration::Boundary).evaluate(&camera, Weighting::Uniform).unwrap();
            assert!(evaluation.residual.amax() < 1e-12, "{system:?}: {:.1e}", evaluation.residual.amax());
        }
    }
}

#[test]
fn a_surface_that_is_cut_from_a_plane_gives_the_plane_equations() {
    let mut random = Random::new(14);
    let camera = random.pose(5.0);
    let plane = camera.inverse().after(&seen_plane(&mut random, &Vector3::z(), 4.0, 0.4, true));
    let ring = star(&mut random, 7, 1.0);
    let rings = placed(&[ring], &plane);
    let mut vertices = rings[0].clone();
    vertices.push(plane.translation);
    let triangles: Vec<_> = (0..7).map(|k| [k, (k + 1) % 7, 7]).collect();
    let observed = [rendered(&rings, &camera)];
    let pose = camera.retract(&random.tangent(0.03, 0.1));
    let flat = WorldRegion::from_rings(&rings).unwrap();
    let mesh = WorldRegion::from_mesh(&vertices, &triangles).unwrap();
    let [flat, mesh] = [flat, mesh].map(|world| {
        let problem = Problem::new(&observed, &[world]).unwrap();
        problem.evaluate(&pose, Weighting::Uniform).unwrap()
    });
    assert!((flat.residual - mesh.residual).amax() < 1e-12);
    assert!((&flat.jacobian - mesh.jacobian).amax() < 1e-11 * flat.jacobian.amax());
}
