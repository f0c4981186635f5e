//! Estimates from labeled samples inside and outside of regions.

use std::ops::RangeInclusive;

use crate::support::contours::all_bitten;
use crate::support::random::Random;
use crate::support::samples::{layout, sampled};
use crate::support::scene::{FOCAL, Scene, rectangle, regular, star};
use nalgebra::{Rotation3, Vector2, Vector3};
use proptest::prelude::*;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::pose::Tangent;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::math::gaussian::Gaussian;
use regionpose::internals::region::PlaneFrame;
use regionpose::internals::samples::anneal::{CoarseFit, VisitedStates, anneal, fit_coarse, noise_weights};
use regionpose::internals::samples::label_model::NoiseLevels;
use regionpose::internals::samples::posterior::Posterior;
use regionpose::{Estimate, FrameSigma, Limits, Options, Pose, PoseSigma, Prior, Problem, Warning, WorldRegion};

/// Squared distance of six components that 90 % of a normal distribution lie within.
const CHI_SQUARED_90: f64 = 10.645;

fn estimated(scene: &Scene, worlds: &[WorldRegion], prior: Prior) -> Estimate {
    let problem = Problem::new(&scene.observed, worlds).unwrap();
    let (frame_sigma, limits) = (FrameSigma::ZERO, Limits::default().with_rotation(1.0_f64.to_radians()));
    problem
        .estimate_with(&Options::default().with_prior(prior).with_frame_sigma(frame_sigma).with_limits(limits))
        .unwrap()
}

/// A posterior about the true pose, and its problem.
fn posterior(seed: u64) -> (Problem, Posterior) {
    let mut random = Random::new(seed);
    let scene = Scene::random(&mut random, layout(2));
    let problem = Problem::new(&scene.observed, &sampled(&mut random, &scene.worlds, 0.1, 1.0)).unwrap();
    let start =
        fit_coarse(problem.sampled(), &flat_prior, &problem.centered(&scene.pose), &Budget::unlimited()).unwrap();
    let found =
        anneal(problem.sampled(), &flat_prior, &[start], 50.0, &mut VisitedStates::default(), &Budget::unlimited())
            .remove(0);
    (problem, found)
}

fn flat_prior(_: &Pose) -> Gaussian {
    Gaussian::default()
}

/// One state gives one posterior: two starts at one pose, and one that comes there later.
#[test]
fn a_state_is_visited_once() {
    let mut random = Random::new(3);
    let scene = Scene::random(&mut random, layout(2));
    let problem = Problem::new(&scene.observed, &sampled(&mut random, &scene.worlds, 0.1, 1.0)).unwrap();
    let start =
        fit_coarse(problem.sampled(), &flat_prior, &problem.centered(&scene.pose), &Budget::unlimited()).unwrap();
    let mut visited = VisitedStates::default();
    let mut found = |starts: &[CoarseFit]| {
        anneal(problem.sampled(), &flat_prior, starts, 50.0, &mut visited, &Budget::unlimited()).len()
    };
    assert_eq!(found(&[start.clone(), start.clone()]), 1);
    assert_eq!(found(&[start]), 0);
}

/// A subset of labels is likelier than all of them, however wide its posterior: four rows of one region leave a pose wide open. If every
/// statistical linearization were accepted, and a level without a distribution ended its track, 16 of these 24 would be less likely, by up
/// to 150, and 2 have no posterior; if statistical linearizations might lose 10, one would be less likely by 1.
#[test]
fn few_labels_are_likelier_than_many() {
    let log_evidence = |scene: &Scene, world: WorldRegion| {
        let problem = Problem::new(&scene.observed, &[world]).unwrap();
        let start =
            fit_coarse(problem.sampled(), &flat_prior, &problem.centered(&scene.pose), &Budget::unlimited()).unwrap();
        anneal(problem.sampled(), &flat_prior, &[start], 50.0, &mut VisitedStates::default(), &Budget::unlimited())[0]
            .log_evidence()
    };
    for seed in 0..24 {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, layout(1));
        let all = sampled(&mut random, &scene.worlds, 0.1, 1.0).remove(0);
        let (few, many) = (log_evidence(&scene, rows(&all, 4)), log_evidence(&scene, all));
        assert!(few > many, "seed {seed}: {few:.1} of four rows, {many:.1} of all");
        assert!(
            few < 3.0,
            "seed {seed}: {few:.1}, where certain labels at the level of the largest prior have at most 2"
        );
    }
}

/// A region with the first rows of its samples inside, and what is outside in them.
fn rows(world: &WorldRegion, count: usize) -> WorldRegion {
    let samples = world.samples().unwrap();
    let mut heights: Vec<f64> = samples.inside().iter().map(|p| p.y).collect();
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
    let is_kept = |p: &&Vector2<f64>| heights.iter().take(count).any(|y| (p.y - y).abs() < 1e-6);
    let kept =
        |places: &[Vector2<f64>]| places.iter().filter(is_kept).map(|p| world.frame().to_world(p)).collect::<Vec<_>>();
    let start = WorldRegion::from_outline(world.frame().clone(), world.outline().clone());
    start.with_samples(&kept(samples.inside()), &kept(samples.outside())).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// A mixture of two modes has the moments of their weights, the odds of (17.11); one of equal modes is the mode itself.
    #[test]
    fn modes_are_mixed_by_their_odds(seed in 0_u64..1000) {
        let (problem, found) = posterior(seed);
        let regions = problem.sampled();
        let same = found.clone().mixed_over(&[found.clone(), found.clone()], regions);
        prop_assert!((same.covariance - found.covariance).norm() < 1e-9 * found.covariance.norm());
        let way = found.covariance.cholesky().unwrap().l().column(0) * 2.0;
        let mut other = found.clone();
        other.pose = found.pose.retract(&way);
        let squared = found.squared_sigmas_to(&other);
        prop_assert!((squared - 2.0).abs() < 1e-3, "two deviations, of which both together have the root of two: {squared}");
        let share = 1.0 / (1.0 + (0.5 * found.deviance_to(&other, regions)).exp());
        let both = found.clone().mixed_over(&[found.clone(), other], regions);
        let scattered = found.covariance + way * way.transpose() * (share * (1.0 - share));
        prop_assert!((both.covariance - scattered).norm() < 1e-6 * scattered.norm());
        prop_assert!((found.pose.local_coordinates(&both.pose) - way * share).norm() < 1e-6 * way.norm());
    }
}

proptest! {
    /// The weights of the likeliest level and of its neighbors keep the mean square of the corners' sigma under the density that
    /// interpolates their evidence by Lagrange's polynomial over the logarithm of sigma, here by Simpson's rule over sigma itself.
    #[test]
    fn levels_stand_for_their_intervals(below in 0.1_f64..20.0, above in 0.1_f64..20.0) {
        const INTERVALS: usize = 1500;
        let at = |corner: f64| NoiseLevels { label: 0.0625, dilation: 0.8, corner };
        let weights = noise_weights(&[(3.0, at(1.0)), (3.0 - below, at(0.5)), (3.0 - above, at(2.0))]);
        prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 && weights.iter().all(|&weight| weight > 0.0));
        let density = |sigma: f64| {
            let u = sigma.log2();
            (-below * u * (u - 1.0) / 2.0 - above * u * (u + 1.0) / 2.0).exp() / sigma
        };
        let [mut all, mut squares] = [0.0; 2];
        for node in 0..=INTERVALS {
            let sigma = 0.5 + 1.5 * node as f64 / INTERVALS as f64;
            let simpson = if node == 0 || node == INTERVALS { 1.0 } else { 2.0 + 2.0 * (node % 2) as f64 };
            all += simpson * density(sigma);
            squares += simpson * density(sigma) * sigma * sigma;
        }
        let mean_square = weights[0] + 0.25 * weights[1] + 4.0 * weights[2];
        prop_assert!((mean_square / (squares / all) - 1.0).abs() < 2e-3, "{mean_square} against {}", squares / all);
    }

    /// Without neighbors of the likeliest, levels count by their evidence.
    #[test]
    fn levels_count_by_their_evidence(behind in 0.1_f64..20.0) {
        let at = |dilation: f64, corner: f64| NoiseLevels { label: 0.0625, dilation, corner };
        let weights = noise_weights(&[(-5.0, at(0.8, 3.2)), (-5.0 - behind, at(0.8, 0.8)), (-5.0 - behind, at(3.2, 6.4))]);
        prop_assert!((weights[1] / weights[0] - (-behind).exp()).abs() < 1e-12 && weights[1] == weights[2]);
    }
}

/// Outlines a tenth too small put the pose off; the samples don't.
#[test]
fn samples_make_up_for_a_wrong_outline() {
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, layout(3));
        let worlds = sampled(&mut random, &scene.worlds, 0.1, 0.9);
        let estimate = estimated(&scene, &worlds, Prior::default());
        let (rotation, place) = scene.errors(&estimate.best.pose);
        assert!(rotation < 8e-3 && place < 2e-3, "seed {seed}: {rotation} rad, {place}");
        let way = estimate.best.pose.local_coordinates(&scene.pose);
        let squared = way.dot(&estimate.best.covariance.cholesky().unwrap().solve(&way));
        assert!(squared < 22.5, "seed {seed}: {squared} variances, as in 999 of 1000 cases of six");
        assert!(estimate.warnings.is_empty(), "seed {seed}: {:?}", estimate.warnings);
    }
}

/// Asserts that the number of poses in their ellipsoid of 90 % is within the bounds that hold 99 % of binomial counts, of `count` seeds.
/// Each pose is from three regions of a shape, with noise of the image's corners, pixels.
fn assert_covers(count: u64, shape: &[[f64; 2]], gap: f64, corner_sigma: f64) {
    let ring: Vec<Vector2<f64>> = shape.iter().map(|&[x, y]| Vector2::new(x, y)).collect();
    let squared_sigmas = |seed: u64| {
        let mut random = Random::new(seed);
        let mut scene = Scene::of_shapes(&mut random, vec![vec![ring.clone()]; 3], layout(3));
        let worlds = sampled(&mut random, &scene.worlds, gap, 1.0);
        for bearing in scene.observed.iter_mut().flat_map(|region| &mut region.rings).flatten() {
            *bearing += random.normals() * (corner_sigma / FOCAL);
        }
        let best = estimated(&scene, &worlds, Prior::default()).best;
        let way = best.pose.local_coordinates(&scene.pose);
        way.dot(&best.covariance.cholesky().unwrap().solve(&way))
    };
    let squares: Vec<f64> = (0..count).map(squared_sigmas).collect();
    let covered = squares.iter().filter(|square| **square < CHI_SQUARED_90).count();
    let bounds = binomial_bounds(count as usize, 0.9);
    assert!(bounds.contains(&covered), "{covered} of {count}, not in {bounds:?}: {squares:.1?}");
}

/// Numbers of successes in `count` trials, without half a percent of probability at either end.
fn binomial_bounds(count: usize, probability: f64) -> RangeInclusive<usize> {
    let odds = probability / (1.0 - probability);
    let next = |mass: &f64, k: usize| mass * odds * (count - k) as f64 / (k + 1) as f64;
    let masses: Vec<f64> = (0..count).fold(vec![(1.0 - probability).powi(count as i32)], |mut masses, k| {
        masses.push(next(&masses[k], k));
        masses
    });
    let tail = |masses: &mut dyn Iterator<Item = &f64>| {
        let sums = masses.scan(0.0, |sum, mass| {
            *sum += mass;
            Some(*sum)
        });
        sums.take_while(|sum| *sum < 0.005).count()
    };
    tail(&mut masses.iter())..=count - tail(&mut masses.iter().rev())
}

#[test]
fn binomial_bounds_are_those_of_tables() {
    assert_eq!(binomial_bounds(20, 0.5), 4..=16);
    assert_eq!(binomial_bounds(60, 0.9), 47..=59);
}

/// A hand sets the corners of quadrilaterals, with a sigma of 2 px.
#[test]
fn the_ellipsoid_covers_poses_from_corners_that_a_hand_set() {
    assert_covers(60, &[[-0.75, -0.5], [0.6, -0.7], [0.8, 0.35], [-0.5, 0.65]], 0.07, 2.0);
}

/// Rows and columns of samples along the sides of rectangles: with a label sigma of 0.25 px at least, 6 of 20 are covered.
#[test]
fn the_ellipsoid_covers_poses_from_rows_along_sides() {
    assert_covers(40, &[[-0.8, -0.6], [0.8, -0.6], [0.8, 0.6], [-0.8, 0.6]], 0.02, 0.0);
}

/// Rows and columns of samples along the sides of rectangles, in places that differ by rounding alone: about one pose.
#[test]
fn rounding_leaves_the_pose() {
    let ring = rectangle(1.6, 1.2);
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let scene = Scene::of_shapes(&mut random, vec![vec![ring.clone()]; 3], layout(3));
        let worlds = sampled(&mut random, &scene.worlds, 0.05, 1.0);
        let moved = |world: &WorldRegion| {
            let samples = world.samples().unwrap();
            let [inside, outside] = [samples.inside(), samples.outside()].map(|places| {
                let noise = |p: &Vector2<f64>| world.frame().to_world(p) + random.normals() * 1e-14;
                places.iter().map(noise).collect::<Vec<_>>()
            });
            world.clone().with_samples(&inside, &outside).unwrap()
        };
        let other: Vec<_> = worlds.iter().map(moved).collect();
        let [one, other] = [&worlds, &other].map(|worlds| estimated(&scene, worlds, Prior::default()).best);
        let way = one.pose.local_coordinates(&other.pose);
        let squared = way.dot(&one.covariance.cholesky().unwrap().solve(&way));
        let ratios = one.covariance.diagonal().component_div(&other.covariance.diagonal());
        assert!(squared < 0.04, "seed {seed}: {squared} variances");
        assert!(ratios.iter().all(|ratio| (0.9..1.1).contains(ratio)), "seed {seed}: {ratios}");
    }
}

/// An outline without holes is not compared with enclosed samples, so that windows, which a scan passes through, change nothing.
#[test]
fn windows_count_where_the_image_has_a_hole() {
    let mut random = Random::new(9);
    let scene = Scene::random(&mut random, layout(2));
    let worlds = sampled(&mut random, &scene.worlds, 0.1, 1.0);
    let windowed: Vec<_> = worlds.iter().map(|world| world.clone().with_enclosed(&inner(world)).unwrap()).collect();
    let [plain, other] = [&worlds, &windowed].map(|worlds| estimated(&scene, worlds, Prior::default()).best.pose);
    assert_eq!(plain.translation, other.translation);
    assert_eq!(windowed[0].samples().unwrap().enclosed().len(), 5);
    assert!(scene.worlds[0].clone().with_enclosed(&[]).unwrap_err().to_string().contains("a region without others"));
}

/// Some places inside a region with samples.
fn inner(world: &WorldRegion) -> Vec<Vector3<f64>> {
    world.samples().unwrap().inside().iter().take(5).map(|p| world.frame().to_world(p)).collect()
}

/// Three regions with four times as many samples: standard deviations fall with their number, not with its square root.
#[test]
fn the_uncertainty_falls_with_the_number_of_samples() {
    let deviations = |gap: f64| {
        let mut random = Random::new(11);
        let scene = Scene::random(&mut random, layout(3));
        let worlds = sampled(&mut random, &scene.worlds, gap, 1.0);
        estimated(&scene, &worlds, Prior::default()).best.covariance.diagonal().map(f64::sqrt)
    };
    let ratio = deviations(0.06).component_div(&deviations(0.12)).mean();
    assert!((0.1..0.5).contains(&ratio), "{ratio}");
}

/// A hexagon whose outline in the image has a bite: its labels are wrong together, at each turn of the hexagon others, so that chance
/// decides between its twelve poses. Of twelve numbers of one normal distribution, 54 % of those behind the largest are so by less
/// than odds of 9 to 1 leave; 211 turns of the 240 of seeds 0 to 47 are found, and 38 of these 40.
#[test]
fn most_turns_of_a_bitten_hexagon_are_answers() {
    let mut found = 0;
    for seed in 0..4 {
        let mut random = Random::new(seed);
        let mut scene = Scene::of_shapes(&mut random, vec![vec![regular(6, 1.0)]], layout(1));
        scene.observed = all_bitten(&scene, 1.0);
        let worlds = sampled(&mut random, &scene.worlds, 0.05, 1.0);
        let estimate = estimated(&scene, &worlds, Prior::default());
        let answers: Vec<Pose> =
            std::iter::once(&estimate.best).chain(&estimate.alternatives).map(|solution| solution.pose).collect();
        let (middle, normal) = (scene.middle(), scene.worlds[0].frame().axes()[2]);
        let is_answer = |turn: &u8| {
            let sixth = Rotation3::from_scaled_axis(normal * (f64::from(*turn) * std::f64::consts::PI / 3.0));
            let rotation = scene.pose.rotation * sixth;
            let turned = Pose::new(rotation, scene.pose.transform(&middle) - rotation * middle);
            answers.iter().any(|answer| answer.angle_to(&turned) < 0.02)
        };
        found += (1..6).filter(is_answer).count();
        assert_eq!(estimate.warnings[0].code(), "ambiguous-pose", "seed {seed}");
    }
    assert!(found >= 16, "{found} of 20 turns");
}

/// Chance leaves another answer to 2 of the 80 such shapes of seeds 0 to 79.
#[test]
fn a_bitten_shape_without_symmetry_mostly_has_one_answer() {
    let mut ambiguous = Vec::new();
    for seed in 0..8 {
        let mut random = Random::new(seed);
        let shape = star(&mut random, 9, 1.0);
        let mut scene = Scene::of_shapes(&mut random, vec![vec![shape]], layout(1));
        scene.observed = all_bitten(&scene, 1.0);
        let worlds = sampled(&mut random, &scene.worlds, 0.05, 1.0);
        let estimate = estimated(&scene, &worlds, Prior::default());
        let (rotation, _) = scene.errors(&estimate.best.pose);
        assert!(rotation < 0.1, "seed {seed}: {rotation} rad");
        ambiguous.extend((!estimate.alternatives.is_empty()).then_some(seed));
    }
    assert!(ambiguous.len() <= 1, "seeds {ambiguous:?}");
}

#[test]
fn outlines_and_samples_mix() {
    for seed in 20..23 {
        let mut random = Random::new(seed);
        let scene = Scene::random(&mut random, layout(3));
        let mut worlds = sampled(&mut random, &scene.worlds, 0.1, 0.9);
        worlds[0] = scene.worlds[0].clone();
        let mixed = estimated(&scene, &worlds, Prior::default());
        let (rotation, place) = scene.errors(&mixed.best.pose);
        assert!(rotation < 2e-3 && place < 2e-3, "seed {seed}: {rotation} rad, {place}");
    }
}

#[test]
fn a_region_whose_samples_lie_elsewhere_is_named() {
    let mut random = Random::new(30);
    let scene = Scene::random(&mut random, layout(4));
    let mut moved = scene.worlds.clone();
    let frame = moved[2].frame().clone();
    let shift = (frame.axes()[0] + frame.axes()[1]) * 0.5;
    let rings: Vec<Vec<_>> = moved[2].rings().iter().map(|ring| ring.iter().map(|x| x + shift).collect()).collect();
    moved[2] = WorldRegion::from_rings(&rings).unwrap();
    let estimate = estimated(&scene, &sampled(&mut random, &moved, 0.1, 1.0), Prior::default());
    let (rotation, _) = scene.errors(&estimate.best.pose);
    assert!(rotation < 5e-3, "{rotation}");
    let named = |warning: &Warning| matches!(warning, Warning::OutlierRegion { region: 2, .. });
    assert!(estimate.warnings.iter().any(named), "{:?}", estimate.warnings);
}

fn near_initial(pose: Pose) -> Prior {
    let sigma = PoseSigma { rotation: 1e-3, place: 1e-3 };
    Prior::default().with_initial(pose, Some(sigma)).unwrap()
}

#[test]
fn a_prior_holds_what_few_samples_leave_free() {
    let mut random = Random::new(41);
    let scene = Scene::random(&mut random, layout(1));
    let worlds = sampled(&mut random, &scene.worlds, 0.25, 1.0);
    let free = estimated(&scene, &worlds, Prior::default()).best.covariance.trace();
    let held = estimated(&scene, &worlds, near_initial(scene.pose));
    assert!(held.best.covariance.trace() < 0.2 * free && scene.errors(&held.best.pose).0 < 3e-3);
}

#[test]
fn a_prior_that_samples_contradict_is_left_out_and_warned_of() {
    let mut random = Random::new(42);
    let scene = Scene::random(&mut random, layout(3));
    let worlds = sampled(&mut random, &scene.worlds, 0.1, 1.0);
    let elsewhere = scene.pose.retract(&Tangent::new(0.3, -0.4, 0.2, 0.5, 0.1, 0.2));
    let estimate = estimated(&scene, &worlds, near_initial(elsewhere));
    assert!(scene.errors(&estimate.best.pose).0 < 6e-3, "{:?}", scene.errors(&estimate.best.pose));
    let warned = |warning: &Warning| matches!(warning, Warning::InitialContradicted { .. });
    assert!(estimate.warnings.iter().any(warned), "{:?}", estimate.warnings);
}

/// The samples of one of three regions on a line across it, whose plane is given wrong: the pose is that of the truth, and no
/// side counts.
#[test]
fn places_on_one_line_need_no_plane() {
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for seed in 0..5 {
        let mut random = Random::new(600 + seed);
        let scene = Scene::random(&mut random, layout(2));
        let mut worlds = sampled(&mut random, &scene.worlds, 0.1, 1.0);
        let (frame, outline) = (scene.worlds[1].frame(), scene.worlds[1].outline());
        let middle = outline.rings()[0].iter().sum::<Vector2<f64>>() / outline.rings()[0].len() as f64;
        let places = (-400..400).map(|k| middle + Vector2::new(0.01 * f64::from(k), 0.0));
        let (inside, outside): (Vec<_>, Vec<_>) = places.partition(|place| outline.contains(*place));
        let lifted = |flat: Vec<Vector2<f64>>| flat.iter().map(|place| frame.to_world(place)).collect::<Vec<_>>();
        // The line in another plane through it.
        let [u, v, n] = *frame.axes();
        let turned = [u, (v + n) / 2f64.sqrt(), (n - v) / 2f64.sqrt()];
        let other = PlaneFrame::new(frame.to_world(&middle), turned).unwrap();
        let strip = PlaneRings::polygon(vec![rectangle(1.0, 0.01)]).unwrap();
        let line =
            WorldRegion::from_outline(other, strip).with_line_samples(&lifted(inside), &lifted(outside)).unwrap();
        let line = line.seen_from(frame.origin() + u + (v - n * 2.0)).unwrap();
        let [one, other] = [-5.0, 5.0].map(|far| frame.origin() + turned[2] * far);
        assert!(line.is_line() && !line.is_behind(&one) && !line.is_behind(&other));
        worlds[1] = line;
        let errors = |count: usize| {
            let problem = Problem::new(&scene.observed[..count], &worlds[..count]).unwrap();
            let estimate = problem.estimate().unwrap();
            (scene.errors(&estimate.best.pose).0, problem.creases(&Budget::unlimited()).len())
        };
        let [(both, creases), (alone, _)] = [2, 1].map(errors);
        assert_eq!(creases, 0);
        with.push(both);
        without.push(alone);
    }
    with.sort_by(f64::total_cmp);
    without.sort_by(f64::total_cmp);
    assert!(with[2] < 0.7 * without[2], "{with:.4?} {without:.4?}");
}

#[test]
fn samples_that_cannot_be_used_are_refused() {
    let square: Vec<_> = rectangle(1.0, 1.0).iter().map(|p| p.push(0.0)).collect();
    let region = WorldRegion::from_rings(&[square]).unwrap();
    let refused = |inside: &[Vector3<f64>], outside: &[Vector3<f64>]| {
        region.clone().with_samples(inside, outside).unwrap_err().to_string()
    };
    let (near, far) = (Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0));
    assert!(refused(&[], &[far]).contains("the number of samples inside the region is 0"), "{}", refused(&[], &[far]));
    let bad = refused(&[near, Vector3::new(f64::NAN, 0.0, 0.0)], &[far]);
    assert!(bad.contains("inside sample 1"), "{bad}");
    let off = refused(&[near, far], &[Vector3::new(1.0, 0.0, 0.5)]);
    assert!(off.contains("an outside sample is number 0 at 5.000e-1 off"), "{off}");
    let [begin, end, aside] = [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.3, 0.0]].map(Vector3::from);
    let not_one_line =
        |inside: &[_], outside: &[_]| region.clone().with_line_samples(inside, outside).unwrap_err().to_string();
    let off = not_one_line(&[begin, aside, end], &[far]);
    assert!(off.contains("an inside sample is number 0 at 1.961e-1 off the line"), "{off}");
    let off = not_one_line(&[begin, end], &[far, aside]);
    assert!(off.contains("an outside sample is number 1 at 3.000e-1 off the line"), "{off}");
    let bent = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.2], [0.0, 1.0, 0.0]].map(Vector3::from);
    let surface = WorldRegion::from_mesh(&bent, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    assert!(surface.with_samples(&[near], &[far]).unwrap_err().to_string().contains("needs to be a planar region"));
}
