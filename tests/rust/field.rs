//! The nearest edge of rings, against all edges one after the other.

mod support;

use nalgebra::Vector2;
use proptest::prelude::*;
use regionpose::contour::field::EdgeField;
use support::random::Random;
use support::scene::{Ring, pierced_star, rectangle, regular, star};

type Point = Vector2<f64>;

fn edges(rings: &[Ring]) -> Vec<(Point, Point)> {
    rings.iter().flat_map(|ring| (0..ring.len()).map(|k| (ring[k], ring[(k + 1) % ring.len()]))).collect()
}

fn distance((a, b): &(Point, Point), point: &Point) -> f64 {
    let step = b - a;
    let share = ((point - a).dot(&step) / step.norm_squared()).clamp(0.0, 1.0);
    (a + step * share - point).norm()
}

/// Distances of a point from the edge that the field names and from the nearest of all.
fn found_and_nearest(field: &EdgeField, edges: &[(Point, Point)], point: &Point) -> [f64; 2] {
    let found = distance(&edges[field.nearest_edge(point)], point);
    [found, edges.iter().map(|edge| distance(edge, point)).fold(f64::INFINITY, f64::min)]
}

fn shape(random: &mut Random) -> Vec<Ring> {
    let count = 4 + random.index(60);
    let shift = random.direction().xy() * random.uniform(0.0, 3.0);
    let rings = match random.index(4) {
        0 => vec![star(random, count, 1.0)],
        1 => pierced_star(random, count, 1.0),
        2 => vec![regular(count, 1.0)],
        _ => vec![rectangle(2.0, random.uniform(0.02, 1.0))],
    };
    rings.iter().map(|ring| ring.iter().map(|p| p + shift).collect()).collect()
}

#[test]
fn measure() {
    let mut worst = [[0.0_f64; 2]; 8];
    for seed in 0..3000 {
        let mut random = Random::new(seed);
        let rings = shape(&mut random);
        let (field, edges) = (EdgeField::new(&rings), edges(&rings));
        for (k, far) in [0.001, 0.01, 0.05, 0.1, 0.3, 1.0, 10.0, 1e6].into_iter().enumerate() {
            for _ in 0..20 {
                let (a, b) = edges[random.index(edges.len())];
                let p = a.lerp(&b, random.uniform(0.0, 1.0))
                    + random.direction().xy().normalize() * far * random.uniform(0.0, 1.0);
                let [found, nearest] = found_and_nearest(&field, &edges, &p);
                worst[k][0] = worst[k][0].max(found - nearest);
                worst[k][1] = worst[k][1].max(found / nearest - 1.0);
            }
        }
    }
    for w in worst {
        println!("{:.2e} {:.2e}", w[0], w[1]);
    }
}
