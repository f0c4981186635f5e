//! Whole poses: exact images are recovered, symmetric ones with all their poses, noise gives the covariance it should, and
//! no input makes a panic.

use std::f64::consts::PI;

use crate::support::random::Random;
use crate::support::scene::{FOCAL, Layout, Ring, Scene, SpaceRing, errors, placed, rectangle, regular, seen_plane};
use nalgebra::{Matrix6, Rotation3, Vector3, Vector6};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::equations::least_squares::{Termination, TerminationCriteria, minimize};
use regionpose::internals::equations::system::Weighting;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::region::{Pixels, PlaneFrame};
use regionpose::{
    Error, Estimate, FrameSigma, Integration, ObservedRegion, Options, Pose, Prior, Problem, Start, System, Warning,
    WorldRegion,
};

/// Error allowed of poses from exact images: rad, and a share of the distance.
const EXACT: f64 = 1e-9;

/// Error allowed of the sphere's equations, which are nearly dependent on a region of half a radian: whitening multiplies
/// their rounding by 1e6 (measured: 1.2e-9).
const NEARLY_DEPENDENT: f64 = 1e-8;

/// Error allowed with the sphere's quadrature, whose moments are good to nine digits.
const QUADRATURE: f64 = 1e-6;

/// Error allowed of the poses of a symmetric shape.
const SYMMETRIC: f64 = 1e-8;

/// Noisy images of the scatter's test.
const SCATTER: usize = 200;

/// Pixels next to a corner that keep their place.
const CORNER_PIXELS: usize = 5;

fn estimated(scene: &Scene, prior: &Prior) -> Estimate {
    let options = Options::default().with_prior(*prior);
    scene.problem(System::Plane, Integration::Boundary).estimate_with(&options).unwrap()
}

/// Worst error (rad, share of the distance) of poses from exact images of random scenes.
fn worst_error(layout: Layout, system: System, integration: Integration, trials: usize) -> f64 {
    let mut random = Random::new(31);
    let error = |scene: Scene| {
        let estimate = scene.problem(system, integration).estimate().unwrap();
        assert!(
            estimate.best.minimum.as_ref().is_some_and(|minimum| minimum.converged)
                && estimate.best.overlap_error < 1e-6
        );
        let (angle, place) = scene.errors(&estimate.best.pose);
        angle.max(place)
    };
    (0..trials).map(|_| error(Scene::random(&mut random, layout))).fold(0.0, f64::max)
}

#[test]
fn exact_images_are_recovered_in_any_direction_unit_and_place() {
    for regions in [1, 2, 3] {
        let meters = Layout { regions, ..Layout::default() };
        let layouts = [
            meters,
            Layout { front: false, ..meters },
            Layout { unit: 1e3, ..meters },
            Layout { unit: 1e-3, ..meters },
            Layout { vertices: 60, ..meters },
            Layout { offset: 1e6, ..meters },
        ];
        for (k, layout) in layouts.into_iter().enumerate() {
            let error = worst_error(layout, System::Plane, Integration::Boundary, 30);
            assert!(error < EXACT, "{regions} regions, layout {k}: {error:.1e}");
        }
    }
}

#[test]
fn both_systems_and_forms_recover_exact_images() {
    for (system, integration, allowed) in [
        (System::Plane, Integration::Mesh { size: None }, EXACT),
        (System::Sphere, Integration::Boundary, NEARLY_DEPENDENT),
        (System::Sphere, Integration::Mesh { size: None }, QUADRATURE),
    ] {
        let error = worst_error(Layout { regions: 2, ..Layout::default() }, system, integration, 5);
        assert!(error < allowed, "{system:?}, {integration:?}: {error:.1e}");
    }
}

#[test]
fn regions_all_around_the_camera_are_solved_together() {
    let layout = Layout { regions: 3, field: 2.5, ..Layout::default() };
    let error = worst_error(layout, System::Plane, Integration::Boundary, 30);
    assert!(error < EXACT, "{error:.1e}");
}

/// Rotations of space that bring a regular polygon (or, with two turns, a rectangle) onto itself.
fn symmetries(turns: usize) -> Vec<Rotation3<f64>> {
    let turn = |k: usize| Rotation3::from_axis_angle(&Vector3::z_axis(), 2.0 * PI * k as f64 / turns as f64);
    let flip = Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
    (0..turns).flat_map(|k| [turn(k), turn(k) * flip]).collect()
}

/// A near view of one symmetric shape, and all poses that show the same.
fn symmetric_view(random: &mut Random, ring: Ring, turns: usize, tilt: f64) -> (Scene, Vec<Pose>) {
    let world_from_plane = random.pose(5.0);
    let direction = random.direction();
    let camera_from_plane = seen_plane(random, &direction, 2.5, tilt, true);
    let plane_from_world = world_from_plane.inverse();
    let scene = Scene::of_rings(camera_from_plane.after(&plane_from_world), &[placed(&[ring], &world_from_plane)]);
    let turned =
        |turn: &Rotation3<f64>| camera_from_plane.after(&Pose::new(*turn, Vector3::zeros())).after(&plane_from_world);
    let poses = symmetries(turns).iter().map(turned).collect();
    (scene, poses)
}

fn all_poses(estimate: &Estimate) -> Vec<Pose> {
    let alternatives = estimate.alternatives.iter().map(|solution| solution.pose);
    std::iter::once(estimate.best.pose).chain(alternatives).collect()
}

#[test]
fn symmetric_shapes_return_each_of_their_poses_with_a_warning() {
    let mut random = Random::new(32);
    for (ring, turns) in [(rectangle(1.6, 1.0), 2), (regular(4, 0.8), 4), (regular(6, 0.8), 6)] {
        for _ in 0..5 {
            let (scene, poses) = symmetric_view(&mut random, ring.clone(), turns, 0.7);
            let estimate = estimated(&scene, &Prior::default());
            let found = all_poses(&estimate);
            assert_eq!(found.len(), 2 * turns);
            for expected in poses {
                let errors = found.iter().map(|pose| errors(pose, &expected, &scene.middle()));
                let error = errors.map(|(angle, place)| angle.max(place)).fold(f64::INFINITY, f64::min);
                assert!(error < SYMMETRIC, "{turns} turns: {error:.1e}");
            }
            let ambiguous = |warning: &&Warning| warning.code() == "ambiguous-pose";
            let warning = estimate.warnings.iter().find(ambiguous).unwrap();
            assert!(matches!(warning, Warning::Ambiguous { others } if others.len() == 2 * turns - 1), "{warning:?}");
        }
    }
}

#[test]
fn a_triangle_returns_the_poses_of_its_three_points() {
    let mut random = Random::new(36);
    for _ in 0..5 {
        let (scene, poses) = symmetric_view(&mut random, regular(3, 1.0), 3, 1.0);
        let estimate = estimated(&scene, &Prior::default());
        let found = all_poses(&estimate);
        // Three points in space have up to four poses for each of six labelings.
        assert!(found.len() >= 6 && found.len().is_multiple_of(6), "{} poses", found.len());
        assert!(poses.iter().all(|expected| found.iter().any(|pose| pose.angle_to(expected) < SYMMETRIC)));
        assert!(estimate.alternatives.iter().all(|solution| solution.overlap_error < 1e-6));
    }
}

#[test]
fn shapes_without_symmetry_have_one_pose_and_no_warning() {
    let scene = Scene::random(&mut Random::new(33), Layout { regions: 3, ..Layout::default() });
    let estimate = estimated(&scene, &Prior::default());
    assert!(estimate.alternatives.is_empty() && estimate.warnings.is_empty(), "{:?}", estimate.warnings);
    assert!(estimate.best.region_overlap_errors.iter().all(|&error| error < 1e-6));
}

#[test]
fn a_rough_pose_chooses_among_symmetric_ones() {
    let mut random = Random::new(34);
    for (ring, turns, start) in [
        (regular(6, 0.8), 6, Start::Global),
        (rectangle(1.6, 1.0), 2, Start::Global),
        (rectangle(1.6, 1.0), 2, Start::Paper),
    ] {
        let (scene, poses) = symmetric_view(&mut random, ring, turns, 0.7);
        for expected in poses {
            let initial = expected.retract(&random.tangent(0.2, 0.3));
            let prior = Prior::default().with_initial(initial, None).unwrap();
            let problem = scene.problem(System::Plane, Integration::Boundary);
            let estimate = problem.estimate_with(&Options::default().with_start(start).with_prior(prior)).unwrap();
            assert!(estimate.best.pose.angle_to(&expected) < SYMMETRIC, "{turns} turns, {start:?}");
        }
    }
}

#[test]
fn the_up_direction_chooses_among_symmetric_poses() {
    let mut random = Random::new(35);
    let (scene, poses) = symmetric_view(&mut random, rectangle(1.6, 1.0), 2, 0.7);
    for expected in poses {
        let up = expected.rotation.inverse() * Vector3::new(0.1, -1.0, 0.1);
        let estimate = estimated(&scene, &Prior::default().with_up(up, None).unwrap());
        assert!(estimate.best.pose.angle_to(&expected) < SYMMETRIC);
    }
}

/// The image of a scene whose boundaries are independently off by `sigma` pixels along their normals, pixel by pixel.
fn noisy(scene: &Scene, random: &mut Random, sigma: f64) -> Vec<ObservedRegion> {
    let disturbed = |region: &ObservedRegion, random: &mut Random| {
        let rings = region.rings.iter().map(|ring| noisy_ring(ring, random, sigma / FOCAL)).collect();
        ObservedRegion::new(rings, region.pixel_area)
    };
    scene.observed.iter().map(|region| disturbed(region, random)).collect()
}

/// A vertex each pixel of the ring, moved along the edge's normal; those near corners stay, so that no edges cross.
fn noisy_ring(ring: &SpaceRing, random: &mut Random, sigma: f64) -> SpaceRing {
    let mut disturbed = Vec::new();
    for (k, a) in ring.iter().enumerate() {
        let b = ring[(k + 1) % ring.len()];
        let normal = a.cross(&b).normalize();
        let count = (a.angle(&b) * FOCAL).ceil() as usize;
        disturbed.push(*a);
        for j in CORNER_PIXELS..count.saturating_sub(CORNER_PIXELS) {
            let at = (a + (b - a) * (j as f64 / count as f64)).normalize();
            disturbed.push((at + normal * (sigma * random.normal())).normalize());
        }
    }
    disturbed
}

/// Pose error as a left increment of the truth, translations at the regions' middle.
fn increment(pose: &Pose, truth: &Pose) -> Vector6<f64> {
    let turn = pose.rotation * truth.rotation.inverse();
    let (omega, tau) = (turn.scaled_axis(), pose.translation - turn * truth.translation);
    Vector6::new(omega.x, omega.y, omega.z, tau.x, tau.y, tau.z)
}

#[test]
fn the_covariance_agrees_with_the_scatter_of_noisy_images() {
    let mut random = Random::new(37);
    let layout = Layout { regions: 3, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    let scene = Scene::random(&mut random, layout);
    let (mut scatter, mut predicted, mut distance, mut noise) = (Matrix6::zeros(), Matrix6::zeros(), 0.0, 0.0);
    for _ in 0..SCATTER {
        let observed = noisy(&scene, &mut random, 1.0);
        let problem = Problem::new(&observed, &scene.worlds).unwrap();
        let exact = Options::default().with_frame_sigma(FrameSigma::ZERO);
        let estimate = problem.estimate_with(&exact).unwrap();
        let error = increment(&estimate.best.pose, &scene.pose);
        scatter += error * error.transpose() / SCATTER as f64;
        predicted += estimate.best.covariance / SCATTER as f64;
        distance += (error.transpose() * estimate.best.covariance.try_inverse().unwrap() * error)[0] / SCATTER as f64;
        noise += estimate.boundary_noise / SCATTER as f64;
    }
    assert!(noise > 0.7 && noise < 1.4, "boundary noise {noise}");
    for k in 0..6 {
        let ratio = scatter[(k, k)] / predicted[(k, k)];
        assert!(ratio > 0.5 && ratio < 2.0, "variance {k}: {ratio}");
    }
    // Six degrees of freedom.
    assert!(distance > 3.0 && distance < 12.0, "mean squared distance {distance}");
}

#[test]
fn covariances_are_symmetric_and_positive() {
    let mut random = Random::new(38);
    for regions in [1, 2, 3] {
        let scene = Scene::random(&mut random, Layout { regions, ..Layout::default() });
        let covariance = estimated(&scene, &Prior::default()).best.covariance;
        let scale = Matrix6::from_diagonal(&covariance.diagonal().map(|variance| variance.sqrt().recip()));
        let correlation = scale * covariance * scale;
        assert!((correlation - correlation.transpose()).amax() < 1e-9);
        assert!(correlation.symmetric_eigenvalues().min() > 0.0);
    }
}

/// The message of a problem that is refused.
fn refusal(observed: &[ObservedRegion], worlds: &[WorldRegion], system: System, integration: Integration) -> String {
    Problem::with(observed, worlds, system, integration).unwrap_err().to_string()
}

#[test]
fn regions_that_do_not_pair_up_are_refused() {
    let scene = Scene::random(&mut Random::new(51), Layout { regions: 2, ..Layout::default() });
    let message = |observed: usize, worlds: usize| {
        refusal(&scene.observed[..observed], &scene.worlds[..worlds], System::Plane, Integration::Boundary)
    };
    let needed = "world regions; there need to be as many of each, at least 1";
    assert_eq!(message(2, 1), format!("there are 2 observed and 1 {needed}"));
    assert_eq!(message(0, 0), format!("there are 0 observed and 0 {needed}"));
}

#[test]
fn a_refused_region_is_named_by_its_index() {
    let scene = Scene::random(&mut Random::new(52), Layout { regions: 3, ..Layout::default() });
    let message = |change: fn(&mut ObservedRegion), system, integration| {
        let mut observed = scene.observed.clone();
        change(&mut observed[1]);
        refusal(&observed, &scene.worlds, system, integration)
    };
    let boundary = |change| message(change, System::Plane, Integration::Boundary);
    let finite = "coordinates need to be finite numbers";
    assert_eq!(
        boundary(|region| region.rings[0][2].y = f64::NAN),
        format!("region 1: ring 0 bearing 2 is not finite: NaN; {finite}")
    );
    assert_eq!(
        boundary(|region| region.rings[0].truncate(2)),
        "region 1: ring 0 has 2 distinct vertices; a region ring needs at least 3"
    );
    assert_eq!(boundary(|region| region.rings.clear()), "region 1: the region has no rings; it needs at least 1");
    assert!(boundary(|region| region.rings[0].swap(1, 4)).starts_with("region 1: edge "));
    assert_eq!(
        boundary(|region| region.pixel_area = 0.0),
        "region 1: the observed region's area in pixels is 0; it needs to be a positive number"
    );
    assert_eq!(
        message(|region| region.pixels = None, System::Sphere, Integration::Pixels),
        "region 0: the observed region holds no pixels; integration over pixels needs a region made from a mask"
    );
    assert!(message(|_| (), System::Plane, Integration::Pixels).contains("sums over pixels need the sphere system"));
}

#[test]
fn pixels_without_as_many_solid_angles_are_refused() {
    let scene = Scene::random(&mut Random::new(53), Layout::default());
    let mut observed = scene.observed.clone();
    observed[0].pixels = Some(Pixels { bearings: vec![Vector3::z(); 3], solid_angles: vec![1e-6; 2] });
    let message = refusal(&observed, &scene.worlds, System::Sphere, Integration::Pixels);
    assert!(message.starts_with("region 0: "), "{message}");
}

#[test]
fn a_start_out_of_view_ends_unconverged() {
    let scene = Scene::random(&mut Random::new(54), Layout { regions: 2, ..Layout::default() });
    let away = Pose::new(Rotation3::from_axis_angle(&Vector3::x_axis(), PI), Vector3::zeros());
    for start in [away.after(&scene.pose), Pose::new(scene.pose.rotation, scene.pose.translation * f64::NAN)] {
        let problem = scene.problem(System::Plane, Integration::Boundary);
        assert!(problem.evaluate(&start, Weighting::Uniform).is_none());
        let search = problem.search(&Options::default());
        let minimum = search.solve_from(&start);
        assert!(!minimum.converged && minimum.cost == f64::INFINITY, "{minimum:?}");
        assert_eq!(minimum.termination, Termination::OutOfView);
        assert_eq!(search.assess(vec![minimum]).err(), Some(Error::NoPose));
    }
}

#[test]
fn a_single_evaluation_is_distinguished_from_convergence() {
    let scene = Scene::random(&mut Random::new(55), Layout::default());
    let problem = scene.problem(System::Plane, Integration::Boundary);
    let start = scene.pose.retract(&Random::new(1).tangent(0.2, 0.2));
    let minimum = minimize(
        problem.regions(),
        &start,
        Weighting::Uniform,
        TerminationCriteria { tolerance: 1e-12, evaluations: 1 },
        &Budget::unlimited(),
    );
    assert!(!minimum.converged && minimum.termination == Termination::EvaluationLimit, "{minimum:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_region_that_leaves_the_view_makes_no_panic(seed: u64, angle in 0.8..1.6) {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, Layout { regions: 2, ..Layout::default() });
        let problem = scene.problem(System::Plane, Integration::Boundary);
        let start = scene.pose.retract(&random.tangent(angle, 2.0));
        for weighting in [Weighting::Uniform, Weighting::Whitened] {
            let criteria = TerminationCriteria { tolerance: 1e-10, evaluations: 140 };
            let minimum = minimize(problem.regions(), &start, weighting, criteria, &Budget::unlimited());
            prop_assert!(minimum.converged <= minimum.cost.is_finite());
            prop_assert!(minimum.evaluations <= 200);
        }
    }

    #[test]
    fn a_pose_is_a_pose_whatever_the_prior(seed: u64, wild in proptest::array::uniform6(any::<f64>())) {
        let scene = Scene::random(&mut Random::new(seed), Layout::default());
        let up = Vector3::from_column_slice(&wild[..3]);
        let initial = Pose::new(scene.pose.rotation, Vector3::from_column_slice(&wild[3..]));
        let problem = scene.problem(System::Plane, Integration::Boundary);
        let length = up.norm();
        let Ok(upright) = Prior::default().with_up(up, None) else {
            prop_assert!(length == 0.0 || length == f64::INFINITY);
            return Ok(());
        };
        let prior = upright.with_initial(initial, None).unwrap();
        let estimate = problem.estimate_with(&Options::default().with_prior(prior)).unwrap();
        prop_assert!(scene.errors(&estimate.best.pose).0 < EXACT);
        for start in [Start::Global, Start::Paper] {
            let prior = upright;
            let _ = problem.estimate_with(&Options::default().with_start(start).with_prior(prior));
        }
    }
}

/// Numbers that break arithmetic.
const WILD: [f64; 10] = [f64::NAN, f64::INFINITY, f64::MIN, 1e300, -1e150, 1e60, 1e-60, 1e-300, 5e-324, 0.0];

/// A scene with some numbers replaced, scaled or repeated; `None` where a world region is refused.
fn wild_scene(random: &mut Random) -> Option<(Vec<ObservedRegion>, Vec<WorldRegion>)> {
    let regions = 1 + random.index(2);
    let vertices = 4 + random.index(5);
    let scene = Scene::random(random, Layout { regions, vertices, ..Layout::default() });
    let mut observed = scene.observed.clone();
    let mut rings: Vec<Vec<SpaceRing>> = scene.worlds.iter().map(WorldRegion::rings).collect();
    let factor = [1.0, 1.0, 1e-150, 1e150, 1e-9, 1e20, 1e307][random.index(7)];
    rings.iter_mut().flatten().flatten().for_each(|x| *x *= factor);
    for _ in 0..random.index(3) {
        let target = if random.index(2) == 0 { &mut rings[0] } else { &mut observed[0].rings };
        let vertex = random.index(4);
        target[0][vertex][random.index(3)] *= WILD[random.index(WILD.len())];
    }
    if random.index(4) == 0 {
        observed[0].pixel_area = WILD[random.index(WILD.len())];
    }
    let mut worlds = rings.iter().map(|rings| WorldRegion::from_rings(rings).ok()).collect::<Option<Vec<_>>>()?;
    if random.index(4) == 0 {
        let (mut origin, mut axes) = (*worlds[0].frame().origin(), *worlds[0].frame().axes());
        origin[random.index(3)] = WILD[random.index(WILD.len())];
        axes[random.index(3)] *= WILD[random.index(WILD.len())];
        let outline = PlaneRings::polygon(vec![regular(5, 1.0)]).unwrap();
        worlds[0] = WorldRegion::from_outline(PlaneFrame::new(origin, axes).ok()?, outline);
    }
    Some((observed, worlds))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 250, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn wild_numbers_are_refused_or_end_without_a_panic(seed: u64, sphere: bool, mesh: bool, paper: bool) {
        let mut random = Random::new(seed);
        let Some((observed, worlds)) = wild_scene(&mut random) else { return Ok(()) };
        let system = if sphere { System::Sphere } else { System::Plane };
        let integration = if mesh && !sphere { Integration::Mesh { size: None } } else { Integration::Boundary };
        let start = if paper { Start::Paper } else { Start::Global };
        match Problem::with(&observed, &worlds, system, integration) {
            Err(error) => prop_assert!(matches!(error, Error::InRegion { .. }), "{error}"),
            Ok(problem) => {
                if let Ok(estimate) = problem.estimate_with(&Options::default().with_start(start)) {
                    prop_assert!(estimate.best.pose.translation.iter().all(|x| x.is_finite()));
                }
            }
        }
    }
}
