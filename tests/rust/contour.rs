//! Poses on observed contours: distances and their derivatives, bites out of regions, and what stays as it was.

mod support;

use nalgebra::{Rotation3, Unit, Vector3};
use proptest::prelude::*;
use regionpose::equations::facet::Integration;
use regionpose::equations::system::System;
use regionpose::geometry::pose::{Pose, Tangent};
use regionpose::prior::Prior;
use regionpose::region::ObservedRegion;
use regionpose::search::candidates::{Problem, Start};
use regionpose::verdict::estimate::{Estimate, Refinement};
use regionpose::verdict::warning::Warning;
use support::jacobian::differences;
use support::random::Random;
use support::scene::{FOCAL, Layout, Scene, SpaceRing};

/// Error allowed of exact derivatives: that of the differences.
const DIFFERENCES: f64 = 1e-6;

/// Differences of two lengths agree this well where the distance is smooth.
const SMOOTH: f64 = 1e-7;

fn layout(regions: usize) -> Layout {
    Layout { regions, offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() }
}

fn problem(scene: &Scene, observed: &[ObservedRegion]) -> Problem {
    Problem::new(observed, scene.worlds.clone(), System::Plane, Integration::Boundary).unwrap()
}

fn estimated(scene: &Scene, observed: &[ObservedRegion], refinement: Refinement) -> Estimate {
    problem(scene, observed).estimate(Start::Global, &Prior::default(), refinement).unwrap()
}

/// The ring with a part of its longest edge pushed by a tenth of that edge, inwards or outwards, as a segmenter's mistake.
fn bitten(ring: &SpaceRing, side: f64) -> SpaceRing {
    let lengths: Vec<f64> = (0..ring.len()).map(|k| (ring[(k + 1) % ring.len()] - ring[k]).norm()).collect();
    let longest = (0..ring.len()).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b])).unwrap();
    let (a, b) = (ring[longest], ring[(longest + 1) % ring.len()]);
    let push = a.cross(&b).normalize() * (0.1 * lengths[longest] * side);
    let along = |share: f64| a.lerp(&b, share);
    let bite = [along(0.4), along(0.4) + push, along(0.6) + push, along(0.6)].map(|p| p.normalize());
    let mut result = ring[..=longest].to_vec();
    result.extend(bite);
    result.extend(&ring[longest + 1..]);
    result
}

/// The observed regions with a bite out of the outline of each.
fn all_bitten(scene: &Scene, side: f64) -> Vec<ObservedRegion> {
    let disturb = |region: &ObservedRegion| {
        let mut rings = region.rings.clone();
        rings[0] = bitten(&rings[0], side);
        ObservedRegion::new(rings, region.pixel_area)
    };
    scene.observed.iter().map(disturb).collect()
}

#[test]
fn at_the_true_pose_all_distances_vanish_but_for_corners() {
    let scene = Scene::random(&mut Random::new(1), layout(2));
    let distances = problem(&scene, &scene.observed).contour_distances(&scene.pose).unwrap().residual;
    // A piece that holds a corner has its mean inside it.
    let near = distances.iter().filter(|distance| distance.abs() < 1e-6).count();
    assert!(near as f64 > 0.9 * distances.len() as f64, "{near} of {}", distances.len());
    assert!(distances.amax() < 1.5, "{}", distances.amax());
}

#[test]
fn distances_are_in_pixels() {
    // Seen from twice as far, a region shrinks to half its size: its outline moves by half the radius.
    let square: SpaceRing =
        [(-0.1, -0.1), (0.1, -0.1), (0.1, 0.1), (-0.1, 0.1)].map(|(x, y)| Vector3::new(x, y, 4.0)).to_vec();
    let scene = Scene::of_rings(Pose::identity(), &[vec![square.clone()]]);
    let further = Pose::new(Pose::identity().rotation, Vector3::new(0.0, 0.0, 4.0));
    let distances = problem(&scene, &scene.observed).contour_distances(&further).unwrap().residual;
    let middle = FOCAL * 0.1 * (1.0 / 4.0 - 1.0 / 8.0);
    let beside = distances.iter().filter(|distance| (distance.abs() / middle - 1.0).abs() < 1e-3).count();
    assert!(beside as f64 > 0.4 * distances.len() as f64, "{beside} of {} are {middle} off", distances.len());
}

#[test]
fn bites_out_of_regions_hardly_move_the_pose() {
    for seed in 0..12 {
        let scene = Scene::random(&mut Random::new(seed), layout(3));
        for side in [-1.0, 1.0] {
            let observed = all_bitten(&scene, side);
            let moments = estimated(&scene, &observed, Refinement::Off);
            let refined = estimated(&scene, &observed, Refinement::Contour);
            let (by_moments, by_contour) =
                (scene.errors(&moments.best.minimum.pose).0, scene.errors(&refined.best.minimum.pose).0);
            assert!(by_contour < 5e-4, "seed {seed}: {by_contour} rad, {by_moments} by moments");
            assert!(by_contour < 0.2 * by_moments, "seed {seed}: {by_contour} against {by_moments}");
            assert!(refined.best.contour.is_some_and(|fit| fit.mixture.disturbed > 0.005));
        }
    }
}

#[test]
fn a_region_that_does_not_belong_is_named_and_leaves_the_pose_alone() {
    for seed in 60..70 {
        let scene = Scene::random(&mut Random::new(seed), layout(4));
        let wrong = seed as usize % 4;
        let mut observed = scene.observed.clone();
        // Turned about its own line of sight.
        let middle = observed[wrong].rings[0].iter().sum::<Vector3<f64>>().normalize();
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(middle), 1.0);
        let rings = observed[wrong].rings.iter().map(|ring| ring.iter().map(|r| turn * r).collect()).collect();
        observed[wrong] = ObservedRegion::new(rings, observed[wrong].pixel_area);
        let estimate = estimated(&scene, &observed, Refinement::Contour);
        let error = scene.errors(&estimate.best.minimum.pose).0;
        assert!(error < 1e-3, "seed {seed}: {error} rad");
        let named: Vec<usize> = estimate
            .warnings
            .iter()
            .filter_map(
                |warning| if let Warning::OutlierRegion { region, .. } = warning { Some(*region) } else { None },
            )
            .collect();
        assert_eq!(named, [wrong], "seed {seed}");
    }
}

#[test]
fn of_two_regions_that_disagree_neither_is_certain() {
    for seed in 90..94 {
        let scene = Scene::random(&mut Random::new(seed), layout(2));
        let mut observed = scene.observed.clone();
        let middle = observed[1].rings[0].iter().sum::<Vector3<f64>>().normalize();
        let turn = Rotation3::from_axis_angle(&Unit::new_normalize(middle), 1.0);
        let rings = observed[1].rings.iter().map(|ring| ring.iter().map(|r| turn * r).collect()).collect();
        observed[1] = ObservedRegion::new(rings, observed[1].pixel_area);
        let estimate = estimated(&scene, &observed, Refinement::Contour);
        assert!(!estimate.warnings.is_empty(), "seed {seed}");
        assert!(estimate.best.confidence <= 0.85, "seed {seed}: {}", estimate.best.confidence);
    }
}

#[test]
fn bitten_regions_are_not_called_badly_covered() {
    let scene = Scene::random(&mut Random::new(80), layout(3));
    let estimate = estimated(&scene, &all_bitten(&scene, 1.0), Refinement::Contour);
    assert!(estimate.warnings.iter().all(|warning| warning.code() != "poor-overlap"), "{:?}", estimate.warnings);
}

#[test]
fn clean_contours_leave_the_moments_pose_as_it_is() {
    for seed in 20..26 {
        let scene = Scene::random(&mut Random::new(seed), layout(2));
        let moments = estimated(&scene, &scene.observed, Refinement::Off);
        let refined = estimated(&scene, &scene.observed, Refinement::Contour);
        assert_eq!(moments.best.minimum.pose, refined.best.minimum.pose);
        assert!(refined.best.contour.is_none());
    }
}

#[test]
fn a_refined_pose_is_likelier_than_its_start() {
    for seed in 40..46 {
        let scene = Scene::random(&mut Random::new(seed), layout(2));
        let observed = all_bitten(&scene, 1.0);
        let squares = |pose: &Pose| {
            let distances = problem(&scene, &observed).contour_distances(pose).unwrap().residual;
            // A robust sum: distances count up to two pixels.
            distances.iter().map(|distance| distance.abs().min(2.0)).sum::<f64>()
        };
        let moments = estimated(&scene, &observed, Refinement::Off).best.minimum.pose;
        let refined = estimated(&scene, &observed, Refinement::Contour).best.minimum.pose;
        assert!(squares(&refined) < squares(&moments));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn distances_follow_their_derivatives(seed: u64) {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, layout(1));
        let problem = problem(&scene, &scene.observed);
        let pose = scene.pose.moved(&random.tangent(0.01, 0.02));
        let values = |x: &Tangent| problem.contour_distances(&pose.moved(x)).unwrap().residual;
        let jacobian = problem.contour_distances(&pose).unwrap().jacobian;
        // Where a piece's nearest edge changes within the step, differences of two lengths disagree.
        let wide = differences(&values, &Tangent::zeros(), 1.0);
        let narrow = differences(&|x: &Tangent| values(&(x * 0.5)), &Tangent::zeros(), 1.0) * 2.0;
        let smooth: Vec<usize> = (0..wide.nrows())
            .filter(|&row| (wide.row(row) - narrow.row(row)).amax() < SMOOTH * wide.row(row).amax())
            .collect();
        prop_assert!(smooth.len() as f64 > 0.85 * wide.nrows() as f64, "{} of {}", smooth.len(), wide.nrows());
        for row in smooth {
            let error = (jacobian.row(row) - narrow.row(row)).amax() / narrow.row(row).amax();
            prop_assert!(error < DIFFERENCES, "row {row}: {error:.1e}");
        }
    }
}
