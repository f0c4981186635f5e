//! Regions that the border of the image cuts: what two outlines share, cut predictions and their derivatives, poses.

use crate::support::contours::distances;
use crate::support::jacobian::assert_jacobian;
use crate::support::random::Random;
use crate::support::scene::{FOCAL, Ring, SpaceRing, placed, rectangle, rendered, seen_plane};
use nalgebra::{DVector, Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::equations::system::Weighting;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::internals::verdict::coverage::region_overlap;
use regionpose::{Error, Integration, ObservedRegion, Options, Pose, Problem, Refinement, System, WorldRegion};

/// Sums over the same outlines in another order differ by rounding.
const ROUNDING: f64 = 1e-12;

/// Error allowed of exact derivatives: that of the differences.
const DIFFERENCES: f64 = 1e-6;

/// The same on the whitened scale, which magnifies the rounding of moments that hardly differ.
const WHITENED_DIFFERENCES: f64 = 1e-5;

/// Rotation error (rad) of a pose from exact outlines: by moments, and on contours whose pieces round the corners.
const EXACT: f64 = 1e-6;
const ROUNDED: f64 = 1e-3;

/// A convex shape without symmetry.
fn shape() -> Ring {
    [[-0.7, -0.4], [0.5, -0.5], [0.8, 0.3], [0.1, 0.65], [-0.5, 0.35]].map(|[x, y]| Vector2::new(x, y)).to_vec()
}

/// A region cut along the great circle of a normal, with the border of the image there.
fn cut(rings: &[SpaceRing], pose: &Pose, normal: &Vector3<f64>) -> ObservedRegion {
    let mut kept = Vec::new();
    let ring = &rings[0];
    for (k, x) in ring.iter().enumerate() {
        let (a, b) = (pose.transform(x), pose.transform(&ring[(k + 1) % ring.len()]));
        let (inside, after) = (a.dot(normal), b.dot(normal));
        if inside > 0.0 {
            kept.push(a);
        }
        if (inside > 0.0) != (after > 0.0) {
            kept.push(a.lerp(&b, inside / (inside - after)));
        }
    }
    let mut region = rendered(&[kept.iter().map(|p| pose.inverse().transform(p)).collect()], pose);
    let middle = kept.iter().sum::<Vector3<f64>>().normalize();
    let along = normal.cross(&middle).normalize();
    let foot = (middle - normal * middle.dot(normal)).normalize();
    region.borders = vec![[-1.2_f64, 1.2].map(|angle| foot * angle.cos() + along * angle.sin()).to_vec()];
    region
}

struct Cut {
    pose: Pose,
    rings: Vec<SpaceRing>,
    observed: ObservedRegion,
}

impl Cut {
    /// A region 4 away, from the front or from behind, of which a line cuts a part off.
    fn random(seed: u64, front: bool) -> Self {
        let random = &mut Random::new(seed);
        let pose = random.pose(3.0);
        let camera_from_plane = seen_plane(random, &Vector3::z(), 4.0, 0.5, front);
        let rings = placed(&[shape()], &pose.inverse().after(&camera_from_plane));
        let turn = random.uniform(0.0, std::f64::consts::TAU);
        let (sine, cosine) = turn.sin_cos();
        let normal = Vector3::new(cosine, sine, random.uniform(0.03, 0.08)).normalize();
        let observed = cut(&rings, &pose, &normal);
        Self { pose, rings, observed }
    }

    fn problem(&self, world: WorldRegion, system: System) -> Problem {
        Problem::with(std::slice::from_ref(&self.observed), &[world], system, Integration::Boundary).unwrap()
    }
}

#[test]
fn at_the_true_pose_the_cut_prediction_is_what_was_observed() {
    for seed in 0..12 {
        for system in [System::Plane, System::Sphere] {
            let scene = Cut::random(seed, seed % 2 == 0);
            let world = WorldRegion::from_rings(&scene.rings).unwrap();
            let problem = scene.problem(world.clone(), system);
            let residual = problem.evaluate(&scene.pose, Weighting::Uniform).unwrap().residual;
            assert!(residual.amax() < 1e-10, "seed {seed}: {}", residual.amax());
            let overlap = region_overlap(&problem.regions()[0], &world, &scene.pose, &Budget::unlimited());
            assert!(overlap.error() < 1e-10, "seed {seed}: {overlap:?}");
            // The whole prediction is another region altogether.
            let whole = ObservedRegion { borders: Vec::new(), ..scene.observed.clone() };
            let problem = Problem::with(&[whole], &[world], system, Integration::Boundary).unwrap();
            assert!(problem.evaluate(&scene.pose, Weighting::Uniform).unwrap().residual.amax() > 0.1);
        }
    }
}

#[test]
fn derivatives_of_cut_moments_agree_with_differences() {
    for seed in 0..6 {
        for system in [System::Plane, System::Sphere] {
            for weighting in [Weighting::Uniform, Weighting::Whitened] {
                let scene = Cut::random(seed, seed % 2 == 0);
                let world = WorldRegion::from_rings(&scene.rings).unwrap();
                let problem = scene.problem(world, system);
                let at = Random::new(seed + 100).tangent(0.02, 0.05);
                let evaluated = |x: &Tangent| problem.evaluate_moved(&scene.pose, x, weighting).unwrap();
                let values = |x: &Tangent| -> DVector<f64> { evaluated(x).residual };
                let allowed = if weighting == Weighting::Uniform { DIFFERENCES } else { WHITENED_DIFFERENCES };
                assert_jacobian(&evaluated(&at).jacobian, values, &at, 4.0, allowed);
            }
        }
    }
}

#[test]
fn derivatives_of_a_cut_surface_agree_with_differences() {
    let random = &mut Random::new(3);
    let pose = Pose::new(random.rotation(), Vector3::new(0.2, -0.1, 4.0));
    let side = |k: usize| k as f64 / 4.0 - 0.5;
    let lift = |i: usize, j: usize| Vector3::new(side(i), side(j), 0.1 * (3.0 * side(i)).sin());
    let vertices: Vec<_> = (0..25).map(|k| pose.rotation.inverse() * lift(k / 5, k % 5)).collect();
    let cell = |k: usize| {
        let a = 5 * (k / 4) + k % 4;
        [[a, a + 5, a + 6], [a, a + 6, a + 1]]
    };
    let triangles: Vec<_> = (0..16).flat_map(cell).collect();
    let world = WorldRegion::from_mesh(&vertices, &triangles).unwrap();
    let observed = cut(&world.rings(), &pose, &Vector3::new(1.0, 0.3, 0.0).normalize());
    let problem = Problem::new(&[observed], &[world]).unwrap();
    let evaluated = |x: &Tangent| problem.evaluate_moved(&pose, x, Weighting::Uniform).unwrap();
    assert!(evaluated(&Tangent::zeros()).residual.amax() < 0.02, "the surface is cut where it was seen cut");
    let at = random.tangent(0.01, 0.02);
    assert_jacobian(&evaluated(&at).jacobian, |x| evaluated(x).residual, &at, 4.0, DIFFERENCES);
}

#[test]
fn a_cut_region_alone_gives_its_pose() {
    for seed in 0..12 {
        for refinement in [Refinement::Off, Refinement::Contour] {
            let scene = Cut::random(seed, true);
            let world = WorldRegion::from_rings(&scene.rings).unwrap();
            let problem = scene.problem(world, System::Plane);
            let estimate = problem.estimate_with(&Options::default().with_refinement(refinement)).unwrap();
            let found = std::iter::once(&estimate.best).chain(&estimate.alternatives);
            let error = found.map(|s| s.pose.angle_to(&scene.pose)).fold(f64::INFINITY, f64::min);
            let allowed = if refinement == Refinement::Off { EXACT } else { ROUNDED };
            assert!(error < allowed, "seed {seed}, {refinement:?}: {error} rad");
            assert!(estimate.best.overlap_error < 1e-4, "seed {seed}: {}", estimate.best.overlap_error);
        }
    }
}

#[test]
fn pieces_along_the_border_are_left_out() {
    let scene = Cut::random(1, true);
    let world = WorldRegion::from_rings(&scene.rings).unwrap();
    let cut = distances(&scene.problem(world.clone(), System::Plane), &scene.pose);
    let whole = ObservedRegion { borders: Vec::new(), ..scene.observed.clone() };
    let problem = Problem::new(&[whole], &[world]).unwrap();
    let all = distances(&problem, &scene.pose);
    let farthest = |distances: &[f64]| distances.iter().fold(0.0_f64, |far, distance| far.max(distance.abs()));
    assert!(cut.len() < all.len() && farthest(&cut) < 1.5, "{} of {}, {}", cut.len(), all.len(), farthest(&cut));
    assert!(farthest(&all) > 10.0, "the border lies far from the boundary");
}

#[test]
fn a_region_that_reaches_behind_the_camera_is_cut_before_it() {
    // A floor 1.5 below the camera, from 20 before it to 5 behind: what the image shows of it ends at its lower border.
    let floor: SpaceRing =
        [[-3.0, -5.0], [3.0, -5.0], [4.0, 20.0], [-3.5, 16.0]].map(|[x, z]| Vector3::new(x, 1.5, z)).to_vec();
    let normal = Vector3::new(0.0, -1.0, 0.5).normalize();
    let observed = cut(std::slice::from_ref(&floor), &Pose::identity(), &normal);
    let world = WorldRegion::from_rings(&[floor]).unwrap();
    let problem = Problem::new(&[observed], &[world]).unwrap();
    let residual = problem.evaluate(&Pose::identity(), Weighting::Uniform).unwrap().residual;
    assert!(residual.amax() < 1e-9, "{}", residual.amax());
    assert!(distances(&problem, &Pose::identity()).iter().all(|distance| distance.abs() < 1.5));
}

#[test]
fn the_side_of_the_border_is_that_of_the_region_whichever_way_it_runs() {
    let scene = Cut::random(4, true);
    let world = WorldRegion::from_rings(&scene.rings).unwrap();
    let mut turned = scene.observed.clone();
    turned.borders[0].reverse();
    let residual = |observed: ObservedRegion| {
        let problem = Problem::new(&[observed], std::slice::from_ref(&world)).unwrap();
        problem.evaluate(&scene.pose, Weighting::Uniform).unwrap().residual
    };
    assert!((residual(turned) - residual(scene.observed.clone())).amax() < ROUNDING);
}

#[test]
fn a_line_of_no_bearings_is_refused_by_its_number() {
    let scene = Cut::random(5, true);
    let world = WorldRegion::from_rings(&scene.rings).unwrap();
    for (line, found) in [(vec![], 0), (vec![scene.observed.borders[0][0]], 1)] {
        let mut observed = scene.observed.clone();
        observed.borders.push(line);
        let message = Problem::new(&[observed], std::slice::from_ref(&world)).unwrap_err().to_string();
        assert_eq!(message, format!("region 0: border line 1 has {found} bearings; a line needs at least 2"));
    }
}

/// A line goes on beyond its ends: twice the same bearing there adds no direction, and gives the same line.
#[test]
fn a_bearing_given_twice_changes_no_line() {
    let scene = Cut::random(5, true);
    let world = WorldRegion::from_rings(&scene.rings).unwrap();
    let problem = |borders: Vec<SpaceRing>| {
        Problem::new(&[ObservedRegion { borders, ..scene.observed.clone() }], std::slice::from_ref(&world))
    };
    let [line] = scene.observed.borders.as_slice() else { panic!("one side of the image cuts it") };
    let twice = line.iter().flat_map(|bearing| [*bearing, *bearing]).collect();
    let residuals = [vec![line.clone()], vec![twice]]
        .map(|borders| problem(borders).unwrap().evaluate(&scene.pose, Weighting::Uniform).unwrap().residual);
    assert_eq!(residuals[0], residuals[1]);
    let message = problem(vec![vec![line[0]; 3]]).unwrap_err().to_string();
    assert_eq!(message, "region 0: border line 0 has 1 bearings; a line needs at least 2");
}

#[test]
fn an_outline_that_lies_on_the_border_is_refused() {
    let ring: SpaceRing = rectangle(0.4, 0.3).iter().map(|p| Vector3::new(p.x, p.y, 1.0)).collect();
    let mut observed = ObservedRegion::new(vec![ring.clone()], 0.12 * FOCAL * FOCAL);
    observed.borders = vec![ring.iter().chain(&ring[..1]).copied().collect()];
    let world = WorldRegion::from_rings(&[ring]).unwrap();
    let error = Problem::new(&[observed], &[world]).unwrap_err();
    assert!(matches!(error, Error::InRegion { .. }) && error.to_string().contains("0.0 %"), "{error}");
}
