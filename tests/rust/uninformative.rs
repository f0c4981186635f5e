//! Uninformative samples: outlines determine the directions that samples leave free.

use std::f64::consts::TAU;

use crate::support::contours::all_bitten;
use crate::support::random::Random;
use crate::support::samples::{layout, sampled};
use crate::support::scene::{Scene, rectangle};
use nalgebra::{Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::{Estimate, ObservedRegion, Options, Pose, PoseSigma, Prior, Problem, WorldRegion};

/// How far from all edges a sample is deep inside, units of the regions' size.
const DEEP: f64 = 0.15;

fn estimated(observed: &[ObservedRegion], worlds: &[WorldRegion], prior: Prior) -> Estimate {
    Problem::new(observed, worlds).unwrap().estimate_with(&Options::default().with_prior(prior)).unwrap()
}

/// So many random places of a region's plane around which there are no edges.
fn deep(random: &mut Random, world: &WorldRegion, count: usize) -> Vec<Vector3<f64>> {
    let (low, high) = world.outline().bounds();
    let around = |p: Vector2<f64>| {
        (0..32).map(move |k| p + DEEP * Vector2::new((TAU / 32.0 * k as f64).cos(), (TAU / 32.0 * k as f64).sin()))
    };
    let mut places = Vec::new();
    while places.len() < count {
        let place = Vector2::new(random.uniform(low.x, high.x), random.uniform(low.y, high.y));
        if world.outline().contains(place) && around(place).all(|beside| world.outline().contains(beside)) {
            places.push(world.frame().to_world(&place));
        }
    }
    places
}

/// Places of a region's plane some units away from it, all around.
fn far(world: &WorldRegion, count: usize) -> Vec<Vector3<f64>> {
    let place =
        |k: usize| 2.5 * Vector2::new((TAU * k as f64 / count as f64).cos(), (TAU * k as f64 / count as f64).sin());
    (0..count).map(|k| world.frame().to_world(&place(k))).collect()
}

/// The region with samples deep inside, far outside, or both.
fn uninformative(random: &mut Random, world: &WorldRegion, inside: usize, outside: usize) -> WorldRegion {
    world.clone().with_samples(&deep(random, world, inside), &far(world, outside)).unwrap()
}

fn assert_same(with: &Estimate, without: &Estimate, what: &str) {
    let way = with.best.pose.angle_to(&without.best.pose);
    assert!(way < 1e-9, "{what}: {way} rad");
    assert_eq!(with.best.confidence, without.best.confidence, "{what}");
    assert_eq!(with.best.covariance, without.best.covariance, "{what}");
    assert_eq!(with.warnings, without.warnings, "{what}");
    assert_eq!(with.alternatives.len(), without.alternatives.len(), "{what}");
    assert!(with.best.posterior.is_none(), "{what}");
}

/// Two L of 1 Mpx with three samples deep inside each, with 90, with some far outside, and all of it with a prior.
#[test]
fn exact_outlines_stay_exact() {
    let ring: Vec<Vector2<f64>> =
        [[0.0, 0.0], [1.2, 0.0], [1.2, 0.5], [0.5, 0.5], [0.5, 1.4], [0.0, 1.4]].map(Vector2::from).to_vec();
    let lifted =
        |k: usize| move |p: &Vector2<f64>| Vector3::new(p.x + 1.6 * k as f64, p.y, 0.4 * p.y + 0.5 * k as f64 * p.x);
    let truth = Pose::new(Pose::identity().rotation, Vector3::new(-1.2, -0.6, 4.0));
    let rings: Vec<Vec<Vector3<f64>>> = (0..2).map(|k| ring.iter().map(lifted(k)).collect()).collect();
    let seen = |ring: &Vec<Vector3<f64>>| ring.iter().map(|x| truth.transform(x)).collect();
    let outside = [[3.0, 3.0], [-3.0, -2.0], [3.0, -2.5], [-2.5, 3.0]].map(Vector2::from).to_vec();
    let few = [[0.2, 0.25], [0.25, 0.25], [0.25, 0.3]].map(Vector2::from).to_vec();
    let many: Vec<Vector2<f64>> =
        (0..90).map(|k| Vector2::new(0.17 + 0.002 * f64::from(k), 0.2 + 0.011 * f64::from(k))).collect();
    let sigma = PoseSigma { rotation: 0.02, place: 0.05 };
    let initial = Prior::default().with_initial(truth, Some(sigma)).unwrap();
    for area in [1e4, 1e6] {
        let observed: Vec<_> = rings.iter().map(|ring| ObservedRegion::new(vec![seen(ring)], area)).collect();
        for (inside, outside) in [(&few, &vec![]), (&many, &vec![]), (&few, &outside), (&many, &outside)] {
            let at = |k: usize, flat: &[Vector2<f64>]| flat.iter().map(lifted(k)).collect::<Vec<_>>();
            let world = |k: usize| WorldRegion::from_rings(&rings[k..=k]).unwrap();
            let worlds: Vec<_> =
                (0..2).map(|k| world(k).with_samples(&at(k, inside), &at(k, outside)).unwrap()).collect();
            for prior in [Prior::default(), initial] {
                let estimate = estimated(&observed, &worlds, prior);
                let error = estimate.best.pose.angle_to(&truth).to_degrees();
                let what = format!("{area} px, {} inside, {} outside", inside.len(), outside.len());
                assert!(error < 1e-3, "{what}: {error} deg");
                assert!(
                    estimate.best.confidence > 0.99 && estimate.warnings.is_empty(),
                    "{what}: {:?}",
                    estimate.warnings
                );
            }
        }
    }
}

/// Of clean contours and of bitten ones, of one region and of several.
#[test]
fn uninformative_samples_change_nothing() {
    for seed in 0..24 {
        let mut random = Random::new(700 + seed);
        let scene = Scene::random(&mut random, layout(1 + seed as usize % 3));
        let observed = if seed % 2 == 0 { scene.observed.clone() } else { all_bitten(&scene, 0.1) };
        let counts = [(3, 0), (40, 0), (3, 12), (40, 12)][seed as usize % 4];
        let mut changed: Vec<_> =
            scene.worlds.iter().map(|world| uninformative(&mut random, world, counts.0, counts.1)).collect();
        let without = estimated(&observed, &scene.worlds, Prior::default());
        assert_same(&estimated(&observed, &changed, Prior::default()), &without, &format!("seed {seed}"));
        // Of one region alone, too.
        changed[1..].clone_from_slice(&scene.worlds[1..]);
        assert_same(&estimated(&observed, &changed, Prior::default()), &without, &format!("seed {seed}, one"));
    }
}

/// The samples of one region are informative, those of the other are not: its outline counts.
#[test]
fn a_region_with_uninformative_samples_counts_by_its_outline() {
    for seed in 0..4 {
        let mut random = Random::new(740 + seed);
        let scene = Scene::random(&mut random, layout(2));
        let mut worlds = sampled(&mut random, &scene.worlds, 0.1, 0.9);
        worlds[1] = scene.worlds[1].clone();
        let outlined = estimated(&scene.observed, &worlds, Prior::default());
        worlds[1] = uninformative(&mut random, &scene.worlds[1], 20, 8);
        let both = estimated(&scene.observed, &worlds, Prior::default());
        let way = both.best.pose.angle_to(&outlined.best.pose);
        assert!(way < 4e-3, "seed {seed}: {way} rad");
        assert!((both.best.confidence - outlined.best.confidence).abs() < 0.01, "seed {seed}");
        assert!(scene.errors(&both.best.pose).0 < 5e-3, "seed {seed}: {:?}", scene.errors(&both.best.pose));
    }
}

/// The samples on one half of each region's plane alone, and an outline that is some hundredths too large: a pose by the half is the
/// outlines', as far as these are good.
#[test]
fn what_one_sided_samples_leave_open_is_the_outlines() {
    for seed in 0..6 {
        let mut random = Random::new(760 + seed);
        let scene = Scene::random(&mut random, layout(3));
        let one_sided = |world: &WorldRegion| {
            let samples = world.samples().unwrap();
            let lifted = |p: &Vector2<f64>| world.frame().to_world(p);
            let inside: Vec<_> = samples.inside().iter().map(lifted).collect();
            let outside: Vec<_> = samples.outside().iter().filter(|p| p.x < -0.25).map(lifted).collect();
            WorldRegion::from_outline(world.frame().clone(), world.outline().clone())
                .with_samples(&inside, &outside)
                .unwrap()
        };
        let worlds: Vec<_> = sampled(&mut random, &scene.worlds, 0.1, 1.02).iter().map(one_sided).collect();
        let estimate = estimated(&scene.observed, &worlds, Prior::default());
        let (rotation, place) = scene.errors(&estimate.best.pose);
        assert!(rotation < 1.2e-2 && place < 0.02, "seed {seed}: {rotation} rad, {place}");
        let way = estimate.best.pose.local_coordinates(&scene.pose);
        let squared = way.dot(&estimate.best.covariance.cholesky().unwrap().solve(&way));
        assert!(squared < 22.5, "seed {seed}: {squared} variances, as in 999 of 1000 cases of six");
    }
}

/// A start that the exhausted budget leaves unrefined has the outlines' answer, with a warning; wrong outlines have warnings as those
/// of any other region.
#[test]
fn an_answer_of_the_outlines_has_a_warning() {
    let mut random = Random::new(780);
    let scene = Scene::random(&mut random, layout(2));
    // With informative samples, and outlines of another shape.
    let wrong = |world: &WorldRegion| {
        let lifted = |places: &[Vector2<f64>]| places.iter().map(|p| world.frame().to_world(p)).collect::<Vec<_>>();
        let square = rectangle(1.1, 0.8).iter().map(|p| world.frame().to_world(p)).collect();
        let samples = world.samples().unwrap();
        WorldRegion::from_rings(&[square])
            .unwrap()
            .with_samples(&lifted(samples.inside()), &lifted(samples.outside()))
            .unwrap()
    };
    let worlds: Vec<_> = sampled(&mut random, &scene.worlds, 0.1, 1.0).iter().map(wrong).collect();
    let problem = Problem::new(&scene.observed, &worlds).unwrap();
    let search = problem.search(&Options::default());
    let minima: Vec<_> = search.candidates().iter().map(|pose| search.solve_from(pose)).collect();
    let sampled_answer = search.clone().assess(minima.clone()).unwrap();
    assert!(
        sampled_answer.best.posterior.is_some()
            && sampled_answer.warnings.iter().all(|warning| warning.code() != "samples-unused")
    );
    let (outline_answer, _) = Budget::unlimited().limited(0, |budget| search.assess_within(minima, budget).unwrap());
    let codes: Vec<_> = outline_answer.warnings.iter().map(|warning| warning.code()).collect();
    assert!(outline_answer.best.posterior.is_none() && codes.contains(&"samples-unused"), "{codes:?}");
    assert!(codes.contains(&"poor-overlap") || codes.contains(&"outlier-region"), "{codes:?}");
    let way = outline_answer.best.pose.retract(&Tangent::zeros()).angle_to(&scene.pose);
    assert!(way > 0.01, "the outlines are wrong, and so is their pose: {way} rad");
}
