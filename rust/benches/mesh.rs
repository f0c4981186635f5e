//! Times of the plane geometry: rings, meshes, outlines, overlap.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector2;
use regionpose::internals::budget::Budget;
use regionpose::internals::geometry::overlap::overlap_areas;
use regionpose::internals::geometry::rings::PlaneRings;
use regionpose::mesh::alpha_shape::alpha_shape;
use regionpose::mesh::even_mesh::even_mesh;
use regionpose::mesh::triangulation::{MeshOptions, triangulate};

/// A ring of `count` vertices with five lobes.
fn flower(count: usize, shift: f64) -> Vec<Vector2<f64>> {
    let vertex = |k: usize| {
        let angle = TAU * k as f64 / count as f64;
        let radius = 0.3 + 0.05 * (5.0 * angle).cos();
        Vector2::new(shift + radius * angle.cos(), radius * angle.sin())
    };
    (0..count).map(vertex).collect()
}

fn region(count: usize, shift: f64) -> PlaneRings {
    PlaneRings::polygon(vec![flower(count, shift)]).expect("a flower is a valid ring")
}

fn plane_geometry(criterion: &mut Criterion) {
    for count in [100, 10_000] {
        let ring = flower(count, 0.0);
        criterion.bench_function(&format!("rings/{count}"), |b| b.iter(|| PlaneRings::polygon(vec![ring.clone()])));
    }
    let (observed, predicted) = (region(100, 0.0), region(100, 0.02));
    let budget = Budget::unlimited();
    criterion.bench_function("overlap/100", |b| b.iter(|| overlap_areas(black_box(&observed), &predicted, &budget)));
    criterion.bench_function("triangulate/100", |b| b.iter(|| triangulate(&observed, MeshOptions::default())));
    let refined = MeshOptions::default().with_max_area(5e-4).with_min_angle(25.0);
    criterion.bench_function("triangulate/refined", |b| b.iter(|| triangulate(&observed, refined)));
    criterion.bench_function("even_mesh/0.02", |b| b.iter(|| even_mesh(&observed, 0.02)));
    let points: Vec<_> = (1..=100).flat_map(|k| flower(1000, 0.0).into_iter().map(move |p| p * k as f64)).collect();
    criterion.bench_function("alpha_shape/100000", |b| b.iter(|| alpha_shape(&points, 2.0)));
}

criterion_group!(benches, plane_geometry);
criterion_main!(benches);
