//! Time an edge of the boundary moments; criterion's "elements" are edges.
use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Vector2, Vector3};
use regionpose::moments::PlaneMoments;
use regionpose::moments::mesh::{mesh_plane_moments, mesh_sphere_moments};
use regionpose::moments::plane::ring_moments;
use regionpose::moments::sphere::spherical_moments;

/// Vertices of the benchmark ring.
const VERTICES: usize = 100;

/// A wavy ring of about unit radius around the origin.
fn wavy_ring() -> Vec<Vector2<f64>> {
    let vertex = |i: usize| {
        let angle = TAU * i as f64 / VERTICES as f64;
        (1.0 + 0.2 * (5.0 * angle).sin()) * Vector2::new(angle.cos(), angle.sin())
    };
    (0..VERTICES).map(vertex).collect()
}

/// Bearings of that ring shrunk by `scale` on the plane z = 1.
fn wavy_bearings(scale: f64) -> Vec<Vector3<f64>> {
    wavy_ring().iter().map(|p| Vector3::new(scale * p.x, scale * p.y, 1.0).normalize()).collect()
}

fn plane(criterion: &mut Criterion) {
    let ring = wavy_ring();
    let mut group = criterion.benchmark_group("plane");
    group.throughput(Throughput::Elements(VERTICES as u64));
    for order in [4, 5, 8] {
        group.bench_function(format!("order {order}"), |bencher| {
            bencher.iter(|| {
                let mut moments = PlaneMoments::zero(order);
                ring_moments(black_box(&ring), order, &mut moments);
                moments
            });
        });
    }
    group.finish();
}

fn sphere(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("sphere");
    group.throughput(Throughput::Elements(VERTICES as u64));
    for (scale, order) in [(0.2, 3), (0.2, 4), (0.2, 5), (1.0, 5), (0.2, 8)] {
        let ring = wavy_bearings(scale);
        group.bench_function(format!("scale {scale} order {order}"), |bencher| {
            bencher.iter(|| spherical_moments([black_box(&ring[..])], order));
        });
    }
    group.finish();
}

/// The mesh forms on a fan of as many triangles as the ring has edges; here an element is a triangle.
fn mesh(criterion: &mut Criterion) {
    let mut vertices = wavy_ring();
    vertices.push(Vector2::zeros());
    let triangles: Vec<_> = (0..VERTICES).map(|i| [VERTICES, i, (i + 1) % VERTICES]).collect();
    let lifted: Vec<_> = vertices.iter().map(|p| Vector3::new(0.2 * p.x, 0.2 * p.y, 1.0)).collect();
    let mut group = criterion.benchmark_group("mesh");
    group.throughput(Throughput::Elements(VERTICES as u64));
    group.bench_function("plane order 5", |bencher| {
        bencher.iter(|| mesh_plane_moments(black_box(&vertices), &triangles, 5));
    });
    group.bench_function("sphere order 5, subdivision 1", |bencher| {
        bencher.iter(|| mesh_sphere_moments(black_box(&lifted), &triangles, 5, 1));
    });
    group.finish();
}

criterion_group!(moments, plane, sphere, mesh);
criterion_main!(moments);
