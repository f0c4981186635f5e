//! Twice as many vertices, holes, samples or regions take about twice the work, counted and not timed.

use std::f64::consts::TAU;

use crate::support::random::Random;
use crate::support::scene::{Layout, Ring, Scene, SpaceRing, placed, rectangle, rendered};
use nalgebra::{Rotation2, Rotation3, Vector2, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::overlap::overlap_areas;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::internals::geometry::simplified::simplified;
use regionpose::internals::search::centroids::centroid_poses;
use regionpose::{ObservedRegion, Options, Pose, Problem, WorldRegion};

/// Times as much work as half as many take, at most: trees add logarithms, and the square would be four times.
const DOUBLE: f64 = 2.6;

/// Asserts how the work of `work` grows from a number to twice and four times as many.
fn assert_growth(what: &str, count: usize, work: impl Fn(usize) -> u64) {
    let [one, two, four] = [1, 2, 4].map(|times| work(times * count) as f64);
    assert!(one > 0.0 && two > one && four > two, "{what}: nothing is counted: {one}, {two}, {four}");
    assert!(two < DOUBLE * one && four < DOUBLE * two, "{what}: {one}, {two}, {four}");
}

/// A comb of so many teeth, seen at an angle and turned: its sides run beside each other and meet far away.
fn comb(teeth: usize) -> Ring {
    let mut ring = Vec::new();
    for tooth in 0..teeth {
        let corners = [[0.02, 0.0], [1.0, 0.1], [1.0, 0.4], [0.02, 0.5]];
        ring.extend(corners.map(|[x, y]| Vector2::new(x, (tooth as f64 + y) / teeth as f64)));
    }
    ring.extend([[0.02, 1.0], [0.0, 1.0], [0.0, 0.0]].map(Vector2::from));
    let seen = |p: Vector2<f64>| Rotation2::new(0.6) * (p - Vector2::repeat(0.5)) / (1.0 + 0.2 * p.x + 0.1 * p.y);
    ring.into_iter().map(seen).collect()
}

/// A square with so many rows of as many holes.
fn sieve(rows: usize) -> Vec<Ring> {
    let at = |k: usize| 1.8 * ((k as f64 + 0.5) / rows as f64 - 0.5);
    let hole = rectangle(0.7 / rows as f64, 0.6 / rows as f64);
    let places = (0..rows * rows).map(|k| Vector2::new(at(k / rows), at(k % rows)));
    [rectangle(2.0, 2.0)].into_iter().chain(places.map(|place| hole.iter().map(|p| p + place).collect())).collect()
}

/// A wavy disc, every second vertex of which is farther out.
fn wavy(vertices: usize) -> Ring {
    let vertex = |k: usize| {
        let (angle, side) = (TAU * k as f64 / vertices as f64, if k.is_multiple_of(2) { 1.0 } else { -1.0 });
        let radius = 1.0 + 0.5 * side * TAU / vertices as f64;
        radius * Vector2::new(angle.cos(), angle.sin())
    };
    (0..vertices).map(vertex).collect()
}

/// What the overlap of a region with itself, a little farther, counts.
fn overlap_work(rings: Vec<Ring>) -> u64 {
    let other = rings.iter().map(|ring| ring.iter().map(|p| p + Vector2::new(1e-5, 2e-5)).collect()).collect();
    let [first, second] = [rings, other].map(|rings| PlaneRings::new(rings).unwrap());
    let budget = Budget::unlimited();
    let areas = overlap_areas(&first, &second, &budget);
    assert!(areas.error() > 0.0 && areas.error() < 0.1, "{areas:?}");
    budget.charged()
}

#[test]
fn the_overlap_of_vertices_grows_as_they_do() {
    assert_growth("comb", 300, |teeth| overlap_work(vec![comb(teeth)]));
    assert_growth("waves", 500, |vertices| overlap_work(vec![wavy(vertices)]));
}

#[test]
fn the_overlap_of_holes_grows_as_they_do() {
    let [one, four, sixteen] = [6, 12, 24].map(|rows| overlap_work(sieve(rows)) as f64);
    assert!(four < DOUBLE.powi(2) * one && sixteen < DOUBLE.powi(2) * four, "{one}, {four}, {sixteen}");
}

/// Of a comb with itself the whole of it, to rounding.
#[test]
fn a_comb_covers_itself() {
    let region = PlaneRings::new(vec![comb(1000)]).unwrap();
    let areas = overlap_areas(&region, &region, &Budget::unlimited());
    assert!(areas.error() < 1e-10, "{areas:?}");
}

/// A spiral loses one vertex after the other, from outside inwards.
fn spiral(vertices: usize) -> Ring {
    let arm = |k: usize, width: f64| {
        let turn = TAU * 8.0 * (k as f64 / vertices as f64).sqrt();
        (0.05 + width + turn) * Vector2::new(turn.cos(), turn.sin())
    };
    (0..vertices).map(|k| arm(k, 0.0)).chain((0..vertices).rev().map(|k| arm(k, 1.0))).collect()
}

#[test]
fn fewer_vertices_of_a_spiral_take_as_much_as_it_has() {
    assert_growth("spiral", 2000, |vertices| {
        let budget = Budget::unlimited();
        let fewer = simplified(&spiral(vertices), 1e-9, &budget);
        assert!(fewer.len() > vertices, "{} of {}", fewer.len(), 2 * vertices);
        budget.charged()
    });
}

/// A vertex a chord: by calls within calls this takes more than the stack of a thread.
#[test]
fn a_long_line_is_simplified_in_little_room() {
    // Each vertex is the farthest of all that follow it.
    let steep = |k: usize| Vector2::new(k as f64, (1.0 + k as f64).powi(2));
    let ring: Ring = (0..200_000).map(steep).chain([Vector2::new(200_000.0, 0.0)]).collect();
    let simplified = move || simplified(&ring, 1e-3, &Budget::unlimited()).len();
    let fewer = std::thread::Builder::new().stack_size(64 * 1024).spawn(simplified);
    assert!(fewer.unwrap().join().unwrap() > 1000);
}

/// Two walls that meet in a corner, both seen as wavy discs.
fn corner(vertices: usize) -> Problem {
    let left: SpaceRing = wavy(vertices).iter().map(|p| Vector3::new(p.x - 1.05, p.y, 4.0)).collect();
    let back = Rotation3::from_axis_angle(&Vector3::y_axis(), 0.8);
    let right = wavy(vertices).iter().map(|p| back * Vector3::new(p.x + 1.05, p.y, 0.0) + Vector3::z() * 4.0).collect();
    let rings = [vec![left], vec![right]];
    let observed: Vec<ObservedRegion> = rings.iter().map(|rings| rendered(rings, &Pose::identity())).collect();
    Problem::new(&observed, &rings.map(|rings| WorldRegion::from_rings(&rings).unwrap())).unwrap()
}

fn creases_work(problem: &Problem) -> u64 {
    let budget = Budget::unlimited();
    problem.creases(&budget);
    budget.charged()
}

#[test]
fn creases_grow_as_vertices_do() {
    assert_growth("creases", 1000, |vertices| creases_work(&corner(vertices)));
}

/// So many squares, here and there about the camera's axis, in all of about the same area.
fn many(regions: usize) -> Problem {
    let mut random = Random::new(7);
    let side = 1.0 / (regions as f64).sqrt();
    let square = |_| {
        let place = Vector3::new(random.uniform(-3.0, 3.0), random.uniform(-3.0, 3.0), random.uniform(4.0, 6.0));
        let turn = Rotation3::from_scaled_axis(0.5 * random.direction());
        placed(&[rectangle(side, 0.8 * side)], &Pose::new(turn, place))
    };
    let rings: Vec<Vec<SpaceRing>> = (0..regions).map(square).collect();
    let observed: Vec<ObservedRegion> = rings.iter().map(|rings| rendered(rings, &Pose::identity())).collect();
    let worlds: Vec<WorldRegion> = rings.iter().map(|rings| WorldRegion::from_rings(rings).unwrap()).collect();
    Problem::new(&observed, &worlds).unwrap()
}

/// Up to 24 regions, all are compared; further ones take one evaluation each to choose among them.
#[test]
fn poses_of_centroids_grow_as_regions_do() {
    assert_growth("centroids", 100, |regions| {
        let budget = Budget::unlimited();
        let poses = centroid_poses(&many(regions), &budget);
        assert!(poses.iter().any(|pose| pose.angle_to(&Pose::identity()) < 1e-2));
        budget.charged()
    });
}

#[test]
fn creases_grow_as_regions_do() {
    assert_growth("regions", 100, |regions| creases_work(&many(regions)));
}

/// Cost of an estimate, in evaluations of all of the problem: where these stay, the work grows as the problem does.
fn evaluations(problem: &Problem) -> f64 {
    let budget = Budget::unlimited();
    assert!(problem.estimate_within(&Options::default(), &budget).is_ok());
    budget.charged() as f64 / problem.work() as f64
}

#[test]
fn evaluations_do_not_grow_with_vertices() {
    let scene = |vertices| Scene::of_shapes(&mut Random::new(3), vec![vec![wavy(vertices)]], Layout::default());
    let [few, many] = [200, 800].map(|vertices| {
        evaluations(&scene(vertices).problem(regionpose::System::Plane, regionpose::Integration::Boundary))
    });
    assert!(many < 1.5 * few, "{few}, {many}");
}

#[test]
fn evaluations_do_not_grow_with_regions() {
    let [few, many] = [10, 40].map(|regions| evaluations(&self::many(regions)));
    assert!(many < 1.5 * few, "{few}, {many}");
}

/// A sieve with samples inside of it, in its holes and beside it, that many to a hole.
fn sampled_sieve(rows: usize, to_a_hole: usize) -> Problem {
    let mut random = Random::new(11);
    let pose = Pose::new(Rotation3::from_scaled_axis(Vector3::new(0.3, -0.2, 0.1)), Vector3::new(0.1, 0.1, 4.0));
    let rings = placed(&sieve(rows), &Pose::identity());
    let outline = PlaneRings::new(sieve(rows)).unwrap();
    let places =
        (0..to_a_hole * rows * rows).map(|_| Vector2::new(random.uniform(-1.2, 1.2), random.uniform(-1.2, 1.2)));
    let (inside, others): (Vec<_>, Vec<_>) = places.partition(|p| outline.contains(*p));
    let (enclosed, outside): (Vec<_>, Vec<_>) = others.into_iter().partition(|p: &Vector2<f64>| p.amax() < 1.0);
    let lifted = |flat: Vec<Vector2<f64>>| flat.iter().map(|p| p.push(0.0)).collect::<Vec<_>>();
    let world = WorldRegion::from_rings(&rings).unwrap();
    let world =
        world.with_samples(&lifted(inside), &lifted(outside)).unwrap().with_enclosed(&lifted(enclosed)).unwrap();
    Problem::new(&[rendered(&rings, &pose)], &[world]).unwrap()
}

#[test]
fn evaluations_do_not_grow_with_holes() {
    let [few, many] = [3, 6].map(|rows| evaluations(&sampled_sieve(rows, 20)));
    assert!(many < 1.5 * few, "{few}, {many}");
}

#[test]
fn evaluations_do_not_grow_with_samples() {
    let [few, many] = [20, 80].map(|to_a_hole| evaluations(&sampled_sieve(3, to_a_hole)));
    assert!(many < 1.5 * few, "{few}, {many}");
}
