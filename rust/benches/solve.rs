//! Times of the equations, the search and the whole pose: 3 regions of 100 vertices each, seen from 4 m.
//!
//! Criterion's "elements" are edges.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Rotation3, Vector3};
use regionpose::internals::equations::system::Weighting;
use regionpose::internals::search::closed_form::closed_form;
use regionpose::{Integration, ObservedRegion, Options, Pose, Problem, System, WorldRegion};

/// Vertices of each region.
const VERTICES: usize = 100;

/// Area of a region in the image, in pixels: 0.25 m across for each meter of distance, at 1000 pixels a radian.
const PIXEL_AREA: f64 = 60_000.0;

/// Three wavy rings around the camera's axis, tilted each its own way, in camera coordinates.
fn rings() -> Vec<Vec<Vector3<f64>>> {
    let region = |k: usize| {
        let spoke = TAU * k as f64 / 3.0;
        let center = Vector3::new(spoke.cos(), spoke.sin(), 4.0);
        let tilt = Rotation3::new(Vector3::new(0.6 * spoke.sin(), 0.5, 0.4 * spoke.cos()));
        let vertex = |i: usize| {
            let angle = TAU * i as f64 / VERTICES as f64;
            let radius = 0.5 + 0.1 * (3.0 * angle).sin() + 0.05 * (2.0 * angle + spoke).cos();
            center + tilt * Vector3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
        };
        (0..VERTICES).map(vertex).collect()
    };
    (0..3).map(region).collect()
}

fn pose() -> Pose {
    Pose::new(Rotation3::new(Vector3::new(0.7, -1.1, 0.4)), Vector3::new(1.0, 2.0, -3.0))
}

fn sides() -> (Vec<ObservedRegion>, Vec<WorldRegion>) {
    let world_from_camera = pose().inverse();
    let observed = |ring: Vec<Vector3<f64>>| ObservedRegion::new(vec![ring], PIXEL_AREA);
    let world = |ring: Vec<Vector3<f64>>| {
        let ring = ring.iter().map(|p| world_from_camera.transform(p)).collect();
        WorldRegion::from_rings(&[ring]).expect("the rings are planar")
    };
    (rings().into_iter().map(observed).collect(), rings().into_iter().map(world).collect())
}

fn problem(system: System) -> Problem {
    let (observed, worlds) = sides();
    Problem::with(&observed, &worlds, system, Integration::Boundary).expect("the regions are valid")
}

/// Residuals and Jacobian of both systems.
fn equations(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("residual and Jacobian");
    group.throughput(Throughput::Elements(3 * VERTICES as u64));
    for system in [System::Plane, System::Sphere] {
        let problem = problem(system);
        for weighting in [Weighting::Uniform, Weighting::Whitened] {
            let id = BenchmarkId::new(format!("{system:?}"), format!("{weighting:?}"));
            group.bench_function(id, |bencher| bencher.iter(|| problem.evaluate(black_box(&pose()), weighting)));
        }
    }
    group.finish();
}

/// Building the equations, the closed form of one region, the search for candidates, and all of it.
fn search(criterion: &mut Criterion) {
    let (observed, worlds) = sides();
    let ready = problem(System::Plane);
    let options = Options::default();
    let mut group = criterion.benchmark_group("3 regions");
    let build = || Problem::new(&observed, &worlds);
    group.bench_function("equations", |bencher| bencher.iter(build));
    let region = &ready.regions()[0];
    let origin = Vector3::zeros();
    group.bench_function("closed form of one region", |bencher| {
        bencher.iter(|| closed_form(region.chart(), region.outline(), black_box(&worlds[0]), &origin));
    });
    group.bench_function("candidates", |bencher| bencher.iter(|| ready.search(&options)));
    group.bench_function("pose from nothing", |bencher| {
        bencher.iter(|| build().expect("the regions are valid").estimate_with(&options));
    });
    group.finish();
}

criterion_group!(benches, equations, search);
criterion_main!(benches);
