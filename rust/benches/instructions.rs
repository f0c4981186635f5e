//! Instructions of a pose from nothing and of what it is made of, to be counted by Callgrind: 20 fixed scenes of 3 planar regions
//! of 100 vertices each, 4 to 6 m away.
//!
//! ```sh
//! cargo bench -p regionpose-benches --bench instructions --no-run --config 'profile.bench.debug=true' --config 'profile.bench.strip="none"'
//! valgrind --tool=callgrind --callgrind-out-file=out target/release/deps/instructions-*
//! callgrind_annotate --inclusive=yes out | grep instructions::
//! ```
//!
//! It prints how often each function ran, to divide its inclusive count by.

use std::f64::consts::TAU;
use std::hint::black_box;

use nalgebra::{Matrix3, Rotation3, Vector3};
use regionpose::internals::budget::Budget;
use regionpose::internals::equations::residual::{RegionEquations, cost, normal_equations};
use regionpose::internals::equations::system::Weighting;
use regionpose::internals::equations::whitening::Orders;
use regionpose::internals::search::closed_form::closed_form;
use regionpose::internals::verdict::coverage::region_overlap;
use regionpose::{ObservedRegion, Pose, Problem, WorldRegion};

const SCENES: usize = 20;
const REGIONS: usize = 3;
const VERTICES: usize = 100;

/// Pixels a radian.
const FOCAL: f64 = 1000.0;

/// Mean radius of a region, in meters.
const RADIUS: f64 = 0.6;

/// Boundary noise that the equations are whitened for, in pixels.
const NOISE: f64 = 0.3;

/// The SplitMix64 generator (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.uniform(-size, size))
    }
}

/// A wavy ring of a random plane, in camera coordinates, aside the optical axis on the spoke `k`.
fn ring(random: &mut Random, k: usize) -> Vec<Vector3<f64>> {
    let spoke = TAU * k as f64 / REGIONS as f64;
    let center = Vector3::new(1.2 * spoke.cos(), 1.2 * spoke.sin(), random.uniform(4.0, 6.0));
    let tilt = Rotation3::new(random.vector(0.6));
    let waves: Vec<[f64; 2]> = (2..6).map(|_| [random.uniform(0.0, 0.12), random.uniform(0.0, TAU)]).collect();
    let vertex = |i: usize| {
        let angle = TAU * i as f64 / VERTICES as f64;
        let wave = |(n, [height, phase]): (usize, &[f64; 2])| height * ((n + 2) as f64 * angle + phase).cos();
        let radius = RADIUS * (1.0 + waves.iter().enumerate().map(wave).sum::<f64>());
        center + tilt * Vector3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
    };
    (0..VERTICES).map(vertex).collect()
}

struct Scene {
    pose: Pose,
    observed: Vec<ObservedRegion>,
    worlds: Vec<WorldRegion>,
}

impl Scene {
    fn new(random: &mut Random) -> Self {
        let rings: Vec<_> = (0..REGIONS).map(|k| ring(random, k)).collect();
        let pose = Pose::new(Rotation3::new(random.vector(2.0)), random.vector(5.0));
        let world_from_camera = pose.inverse();
        let world = |ring: &Vec<Vector3<f64>>| {
            let ring = ring.iter().map(|p| world_from_camera.transform(p)).collect();
            WorldRegion::from_rings(&[ring]).expect("the rings are planar and simple")
        };
        Self {
            pose,
            observed: rings.iter().map(|ring| seen(ring)).collect(),
            worlds: rings.iter().map(world).collect(),
        }
    }
}

fn seen(ring: &[Vector3<f64>]) -> ObservedRegion {
    let center = ring.iter().sum::<Vector3<f64>>() / ring.len() as f64;
    let cone = |i: usize| Matrix3::from_columns(&[center, ring[i], ring[(i + 1) % ring.len()]]).determinant();
    let volume: f64 = (0..ring.len()).map(cone).sum();
    ObservedRegion::new(vec![ring.to_vec()], FOCAL * FOCAL * volume.abs() / (2.0 * center.norm().powi(3)))
}

#[inline(never)]
fn problem(scene: &Scene) -> Problem {
    Problem::new(&scene.observed, &scene.worlds).expect("the regions are in view")
}

#[inline(never)]
fn pose_from_nothing(problem: &Problem) {
    let _ = black_box(problem.estimate().expect("a pose in view"));
}

#[inline(never)]
fn uniform_cost(regions: &[RegionEquations], pose: &Pose, budget: &Budget) {
    black_box(cost(regions, pose, Weighting::Uniform, budget));
}

#[inline(never)]
fn uniform_equations(regions: &[RegionEquations], pose: &Pose, budget: &Budget) {
    black_box(normal_equations(regions, pose, Weighting::Uniform, budget));
}

#[inline(never)]
fn whitened_equations(regions: &[RegionEquations], pose: &Pose, budget: &Budget) {
    black_box(normal_equations(regions, pose, Weighting::Whitened, budget));
}

#[inline(never)]
fn whitening(region: RegionEquations) -> RegionEquations {
    region.whitened_for(NOISE, Orders::All)
}

#[inline(never)]
fn closed_form_poses(region: &RegionEquations, world: &WorldRegion) {
    black_box(closed_form(region.chart(), region.outline(), world, &Vector3::zeros()));
}

#[inline(never)]
fn overlap(region: &RegionEquations, world: &WorldRegion, pose: &Pose, budget: &Budget) {
    black_box(region_overlap(region, world, pose, budget));
}

fn main() {
    let (mut random, budget) = (Random(1), Budget::unlimited());
    for _ in 0..SCENES {
        let scene = Scene::new(&mut random);
        let problem = problem(&scene);
        let pose = scene.pose.retract(&nalgebra::Vector6::repeat(1e-3));
        let origin = scene.worlds.iter().map(|world| world.frame().origin()).sum::<Vector3<f64>>() / REGIONS as f64;
        let centered = Pose::new(pose.rotation, pose.transform(&origin));
        uniform_cost(problem.regions(), &centered, &budget);
        uniform_equations(problem.regions(), &centered, &budget);
        for (region, world) in problem.regions().iter().zip(problem.worlds()) {
            closed_form_poses(region, world);
            overlap(region, world, &pose, &budget);
            black_box(whitening(region.clone()));
        }
        problem.regions().iter().for_each(|region| _ = region.count(Weighting::Whitened));
        whitened_equations(problem.regions(), &centered, &budget);
        pose_from_nothing(&problem);
    }
    println!(
        "{SCENES} problems, poses, and evaluations of {REGIONS} regions on either scale; {} times",
        SCENES * REGIONS
    );
    println!("the whitening, the closed form and the overlap of a region");
}
