//! Rings that people don't draw: needles, repeated and collinear vertices, holes that touch, any unit of length.

use std::f64::consts::TAU;

use nalgebra::{Rotation2, Vector2};

use crate::random::Random;

pub type Ring = Vec<Vector2<f64>>;

/// A number from 10^low to 10^high, every magnitude alike.
pub fn magnitude(random: &mut Random, low: f64, high: f64) -> f64 {
    10.0_f64.powf(random.uniform(low, high))
}

/// True once in so many times.
pub fn once_in(random: &mut Random, times: usize) -> bool {
    random.index(times) == 0
}

/// A ring of size one, mostly simple.
pub fn ring(random: &mut Random) -> Ring {
    let count = match random.index(20) {
        0 => 3 + random.index(2000),
        1..4 => 3 + random.index(60),
        _ => 3 + random.index(6),
    };
    let mut ring = match random.index(8) {
        0..3 => star(random, count, 0.45),
        3 => star(random, count, 1e-4),
        4 => star(random, count, 1.0),
        5 => snapped(random, count),
        6 => comb(random, count.min(60)),
        _ => (0..count.min(8)).map(|_| Vector2::new(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0))).collect(),
    };
    for _ in 0..random.index(3) {
        spoil(random, &mut ring);
    }
    ring
}

/// Vertices at rising angles, their distances from `least` to one.
fn star(random: &mut Random, count: usize, least: f64) -> Ring {
    let vertex = |k: usize| {
        let angle = TAU * (k as f64 + random.uniform(-0.45, 0.45)) / count as f64;
        random.uniform(least, 1.0) * Vector2::new(angle.cos(), angle.sin())
    };
    (0..count).map(vertex).collect()
}

/// Vertices on a coarse grid, so that edges touch and coincide.
fn snapped(random: &mut Random, count: usize) -> Ring {
    let cells = [2.0, 4.0, 16.0][random.index(3)];
    star(random, count.min(12), 0.3).into_iter().map(|p| p.map(|x| (x * cells).round() / cells)).collect()
}

/// A back with thin teeth.
fn comb(random: &mut Random, count: usize) -> Ring {
    let (width, teeth) = (magnitude(random, -6.0, -0.5) / count as f64, count.max(2));
    let tooth = |k: usize| {
        let x = 2.0 * k as f64 / teeth as f64 - 1.0;
        [(x, 0.0), (x, 1.0), (x + width, 1.0), (x + width, 0.0)].map(|(x, y)| Vector2::new(x, y))
    };
    let back = [Vector2::new(1.0, -0.5), Vector2::new(-1.0, -0.5)];
    (0..teeth).flat_map(tooth).chain(back).collect()
}

/// Flattened, or with repeated, collinear, nearly equal or pointed vertices.
fn spoil(random: &mut Random, ring: &mut Ring) {
    let at = random.index(ring.len());
    let (here, next) = (ring[at], ring[(at + 1) % ring.len()]);
    match random.index(6) {
        0 => {
            let (flat, turn) = (magnitude(random, -14.0, 0.0), Rotation2::new(random.uniform(0.0, TAU)));
            ring.iter_mut().for_each(|p| *p = turn * Vector2::new(p.x, p.y * flat));
        }
        1 => ring.insert(at, here),
        2 => ring.insert(at + 1, here.lerp(&next, random.uniform(0.0, 1.0))),
        3 => ring.insert(at, here + Vector2::new(magnitude(random, -17.0, -3.0), magnitude(random, -17.0, -3.0))),
        4 => ring[at] = here * magnitude(random, -3.0, 4.0),
        _ => ring.reverse(),
    }
}

/// A ring and, now and then, others: holes, islands, copies.
pub fn rings(random: &mut Random) -> Vec<Ring> {
    let mut rings = vec![ring(random)];
    for _ in 0..random.index(6).saturating_sub(3) {
        let (size, aside) =
            (random.uniform(0.01, 1.0), Vector2::new(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)));
        let other = if once_in(random, 4) { rings[0].clone() } else { ring(random) };
        rings.push(other.iter().map(|p| p * size + aside * random.uniform(0.0, 0.5)).collect());
    }
    rings
}

/// The same rings in another unit, moved.
pub fn placed(random: &mut Random, rings: Vec<Ring>, low: f64, high: f64) -> Vec<Ring> {
    let unit = magnitude(random, low, high);
    let aside = if once_in(random, 3) { magnitude(random, -3.0, 6.0) * unit } else { 0.0 };
    let by = Vector2::new(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)) * aside;
    rings.into_iter().map(|ring| ring.into_iter().map(|p| p * unit + by).collect()).collect()
}
