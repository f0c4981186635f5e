//! The nearest edge of rings, against all edges one after the other.

use crate::support::random::Random;
use crate::support::scene::{Ring, pierced_star, rectangle, regular, star};
use nalgebra::Vector2;
use regionpose::internals::geometry::edge_field::EdgeField;

/// The nearest edge is found to rounding, as a share of the coordinates.
const ROUNDING: f64 = 1e-12;

/// Share of the extent, beyond the rings on each side, up to which points are drawn: within the grid and about its rim.
const AROUND: f64 = 0.5;

/// Times that a point is asked for again: more than a field takes to list the edges of its cell.
const ASKED: usize = 4;

type Point = Vector2<f64>;

fn edges(rings: &[Ring]) -> Vec<(Point, Point)> {
    rings.iter().flat_map(|ring| (0..ring.len()).map(|k| (ring[k], ring[(k + 1) % ring.len()]))).collect()
}

fn distance((a, b): &(Point, Point), point: &Point) -> f64 {
    let step = b - a;
    let share = ((point - a).dot(&step) / step.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (a + step * share - point).norm()
}

/// Distances of a point from the edge that the field names and from the nearest of all; the field names the same one each time,
/// be it from all edges, as for the first points of a cell, or from the cell's own.
fn found_and_nearest(field: &EdgeField, edges: &[(Point, Point)], point: &Point) -> [f64; 2] {
    let first = field.nearest_edge(point);
    assert!(
        (0..ASKED).all(|_| field.nearest_edge(point) == first),
        "{point} has another nearest edge when asked again"
    );
    let found = distance(&edges[first], point);
    [found, edges.iter().map(|edge| distance(edge, point)).fold(f64::INFINITY, f64::min)]
}

/// A shape of about a unit's radius, anywhere near the origin.
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

/// Low corner and extent of rings.
fn bounds(rings: &[Ring]) -> (Point, Point) {
    let low = rings.iter().flatten().fold(Point::repeat(f64::INFINITY), |low, p| low.inf(p));
    let high = rings.iter().flatten().fold(Point::repeat(f64::NEG_INFINITY), |high, p| high.sup(p));
    (low, high - low)
}

#[test]
fn near_the_rings_the_nearest_edge_is_found() {
    for seed in 0..400 {
        let mut random = Random::new(seed);
        let rings = shape(&mut random);
        let (field, edges, (low, extent)) = (EdgeField::new(&rings), edges(&rings), bounds(&rings));
        for _ in 0..50 {
            let share = Point::new(random.uniform(-AROUND, 1.0 + AROUND), random.uniform(-AROUND, 1.0 + AROUND));
            let [found, nearest] = found_and_nearest(&field, &edges, &(low + extent.component_mul(&share)));
            assert!(found - nearest < ROUNDING, "seed {seed}: {found} {nearest}");
        }
    }
}

#[test]
fn far_away_it_is_found_too() {
    for seed in 0..400 {
        let mut random = Random::new(seed);
        let rings = shape(&mut random);
        let (field, edges, (low, extent)) = (EdgeField::new(&rings), edges(&rings), bounds(&rings));
        for far in [1.0, 2.0, 10.0, 1e3, 1e6] {
            let off = random.direction().xy().normalize() * (far * extent.norm());
            let [found, nearest] = found_and_nearest(&field, &edges, &(low + extent * 0.5 + off));
            assert!(found - nearest < ROUNDING * found, "seed {seed}, {far} extents off: {found} {nearest}");
        }
    }
}

#[test]
fn points_that_are_not_finite_are_given_an_edge() {
    let rings = [regular(7, 1.0)];
    let field = EdgeField::new(&rings);
    for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
        assert!(field.nearest_edge(&Point::new(x, 0.0)) < 7 && field.nearest_edge(&Point::new(1.0, x)) < 7);
    }
}

#[test]
fn edges_are_counted_ring_after_ring() {
    let rings = [rectangle(4.0, 4.0), rectangle(2.0, 2.0)];
    let field = EdgeField::new(&rings);
    let middles = edges(&rings).into_iter().map(|(a, b)| a.lerp(&b, 0.5));
    assert!(middles.enumerate().all(|(edge, middle)| field.nearest_edge(&middle) == edge));
}

/// A triangle of one long and two short sides, edges of no length, a ring of many vertices at one place.
#[test]
fn uneven_rings_are_searched_too() {
    let needle = vec![Point::new(0.0, 0.0), Point::new(100.0, 0.0), Point::new(100.0, 0.1)];
    let repeated = vec![Point::new(0.0, 0.0), Point::new(0.0, 0.0), Point::new(1.0, 0.0), Point::new(0.5, 1.0)];
    for ring in [needle, repeated] {
        let (field, edges) = (EdgeField::new(std::slice::from_ref(&ring)), edges(std::slice::from_ref(&ring)));
        for vertex in &ring {
            let [found, nearest] = found_and_nearest(&field, &edges, &(vertex + Point::new(1e-3, 1e-3)));
            assert!(found - nearest < ROUNDING, "{found} {nearest}");
        }
    }
}
