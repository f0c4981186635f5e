//! Symmetric regions with disturbed parts: every turn with the same view is an answer, and shapes without symmetry have one.

use crate::support::random::Random;
use crate::support::scene::{Layout, Ring, Scene, SpaceRing, angle_piece, regular};
use nalgebra::{Rotation3, Unit, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::search::symmetry::turned_poses;
use regionpose::{Estimate, Integration, Pose, System, WorldRegion};

/// A turn is found to a quarter of a degree and refined later.
const FOUND: f64 = 0.006;

/// Depth of a bite over the length of its edge.
const DEPTH: f64 = 0.15;

/// The ring with a bite out of the middle of the chosen edges, each after a random part of the edge.
fn bitten(random: &mut Random, ring: &SpaceRing, inward: &Vector3<f64>, edges: &[usize]) -> SpaceRing {
    let mut result = Vec::new();
    for (k, a) in ring.iter().enumerate() {
        let b = ring[(k + 1) % ring.len()];
        result.push(*a);
        if edges.contains(&k) {
            let along = b - a;
            let push = inward.cross(&along) * DEPTH;
            let first = random.uniform(0.1, 0.5);
            let at = |share: f64| a + along * share;
            result.extend([at(first), at(first) + push, at(first + 0.3) + push, at(first + 0.3)]);
        }
    }
    result
}

/// The scene with bites out of its world region alone.
fn disturbed(random: &mut Random, shape: Ring, edges: &[usize]) -> Scene {
    let layout = Layout { offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    let mut scene = Scene::of_shapes(random, vec![vec![shape]], layout);
    let ring = scene.worlds[0].rings().remove(0);
    let normal = scene.worlds[0].frame().axes()[2];
    let middle = ring.iter().sum::<Vector3<f64>>() / ring.len() as f64;
    let turns = (ring[0] - middle).cross(&(ring[1] - middle)).dot(&normal).signum();
    scene.worlds = vec![WorldRegion::from_rings(&[bitten(random, &ring, &(normal * turns), edges)]).unwrap()];
    scene
}

fn estimated(scene: &Scene) -> Estimate {
    let problem = scene.problem(System::Plane, Integration::Boundary);
    problem.estimate().unwrap()
}

/// The poses with the same view of a regular shape: its turns, as it is and turned over.
fn symmetric(scene: &Scene, ring: &SpaceRing, order: usize) -> Vec<Pose> {
    let middle = ring.iter().sum::<Vector3<f64>>() / ring.len() as f64;
    let normal = Unit::new_normalize((ring[0] - middle).cross(&(ring[1] - middle)));
    let over = Rotation3::from_axis_angle(&Unit::new_normalize(ring[0] - middle), std::f64::consts::PI);
    let step = std::f64::consts::TAU / order as f64;
    let turns = (0..order).map(|k| Rotation3::from_axis_angle(&normal, step * k as f64));
    let both = turns.flat_map(|turn| [turn, turn * over]);
    both.map(|turn| {
        let rotation = scene.pose.rotation * turn;
        Pose::new(rotation, scene.pose.transform(&middle) - rotation * middle)
    })
    .collect()
}

#[test]
fn all_turns_of_a_disturbed_hexagon_are_answers() {
    for seed in 0..8 {
        let mut random = Random::new(seed);
        let whole = {
            let layout = Layout { offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
            let scene = Scene::of_shapes(&mut Random::new(seed), vec![vec![regular(6, 1.0)]], layout);
            scene.worlds[0].rings().remove(0)
        };
        let scene = disturbed(&mut random, regular(6, 1.0), &[0, 2, 3]);
        let estimate = estimated(&scene);
        let answers: Vec<Pose> =
            std::iter::once(&estimate.best).chain(&estimate.alternatives).map(|solution| solution.pose).collect();
        for (index, pose) in symmetric(&scene, &whole, 6).iter().enumerate() {
            let nearest = answers.iter().map(|answer| answer.angle_to(pose)).fold(f64::INFINITY, f64::min);
            assert!(nearest < 5e-3, "seed {seed}, turn {index}: {nearest} rad, {} answers", answers.len());
        }
        let shared: f64 = std::iter::once(&estimate.best)
            .chain(&estimate.alternatives)
            .map(|solution| solution.mode_probability)
            .sum();
        assert!(shared <= 1.0 && estimate.best.confidence < 0.3, "{} of {shared}", estimate.best.confidence);
        assert_eq!(estimate.warnings[0].code(), "ambiguous-pose");
    }
}

#[test]
fn the_turns_of_a_hexagon_are_all_its_places_but_the_one_it_is_at() {
    let layout = Layout { offset: 0.0, axis: Some(Vector3::z()), ..Layout::default() };
    let scene = Scene::of_shapes(&mut Random::new(3), vec![vec![regular(6, 1.0)]], layout);
    let problem = scene.problem(System::Plane, Integration::Boundary);
    let turned = turned_poses(&problem, &problem.centered(&scene.pose), 1, &Budget::unlimited());
    let whole = scene.worlds[0].rings().remove(0);
    let places: Vec<Pose> = symmetric(&scene, &whole, 6).iter().map(|pose| problem.centered(pose)).collect();
    let near = |pose: &Pose| turned.iter().any(|found| found.angle_to(pose) < FOUND);
    assert!(!near(&places[0]) && places[1..].iter().all(near), "{} turns", turned.len());
}

#[test]
fn regions_of_several_planes_have_no_turns() {
    let scene = Scene::random(&mut Random::new(4), Layout { regions: 2, ..Layout::default() });
    let problem = scene.problem(System::Plane, Integration::Boundary);
    assert!(turned_poses(&problem, &problem.centered(&scene.pose), 1, &Budget::unlimited()).is_empty());
}

#[test]
fn a_disturbed_shape_without_symmetry_has_one_answer() {
    for seed in 20..28 {
        let scene = disturbed(&mut Random::new(seed), angle_piece(1.0), &[0, 1]);
        let estimate = estimated(&scene);
        assert!(scene.errors(&estimate.best.pose).0 < 5e-3, "seed {seed}");
        assert!(estimate.alternatives.is_empty(), "seed {seed}: {:?}", estimate.warnings);
        assert!(estimate.best.confidence > 0.5, "seed {seed}: {}", estimate.best.confidence);
    }
}
