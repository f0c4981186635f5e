//! The nearest edge of rings, against all edges one after the other.

mod support;

use nalgebra::Vector2;
use regionpose::contour::field::EdgeField;
use support::random::Random;
use support::scene::{Ring, pierced_star, rectangle, regular, star};

/// By how much an edge that is named next to the rings may be farther than the nearest: the nearest sample of the rings, of 192 at
/// least, may lie on an edge beside it.
const NEXT_TO: f64 = 1e-3;

type Point = Vector2<f64>;

fn edges(rings: &[Ring]) -> Vec<(Point, Point)> {
    rings.iter().flat_map(|ring| (0..ring.len()).map(|k| (ring[k], ring[(k + 1) % ring.len()]))).collect()
}

fn distance((a, b): &(Point, Point), point: &Point) -> f64 {
    let step = b - a;
    let share = ((point - a).dot(&step) / step.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    (a + step * share - point).norm()
}

/// Distances of a point from the edge that the field names and from the nearest of all.
fn found_and_nearest(field: &EdgeField, edges: &[(Point, Point)], point: &Point) -> [f64; 2] {
    let found = distance(&edges[field.nearest_edge(point)], point);
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

/// Distances from the edge that is named and from the nearest one, of points `far` off the rings of many shapes.
fn distances(shapes: u64, far: [f64; 2]) -> Vec<[f64; 2]> {
    let of_shape = |seed: u64| {
        let mut random = Random::new(seed);
        let rings = shape(&mut random);
        let (field, edges) = (EdgeField::new(&rings), edges(&rings));
        let mut one = || {
            let (a, b) = edges[random.index(edges.len())];
            let off = random.direction().xy().normalize() * random.uniform(far[0], far[1]);
            found_and_nearest(&field, &edges, &(a.lerp(&b, random.uniform(0.0, 1.0)) + off))
        };
        (0..20).map(|_| one()).collect::<Vec<_>>()
    };
    (0..shapes).flat_map(of_shape).collect()
}

/// Where contours lie that fit: within 2 % of the shape's width.
#[test]
fn next_to_the_rings_the_nearest_edge_is_found() {
    for [found, nearest] in distances(1000, [0.0, 0.04]) {
        assert!(found - nearest < NEXT_TO, "{found} {nearest}");
    }
}

/// The grid looks no further than the neighbours of a cell: where the two sides of a notch are about as near, the wrong one
/// may be named.
#[test]
fn farther_off_few_points_are_given_an_edge_that_is_clearly_farther() {
    for (far, share) in [([0.0, 0.2], 0.005), ([0.2, 0.5], 0.03), ([0.5, 1.0], 0.05)] {
        let all = distances(1000, far);
        let wrong = all.iter().filter(|[found, nearest]| found > &(1.05 * nearest)).count();
        assert!((wrong as f64) < share * all.len() as f64, "{far:?}: {wrong} of {}", all.len());
        assert!(all.iter().all(|[found, nearest]| found - nearest < 0.3), "{far:?}");
    }
}

/// The cell at the grid's rim serves all that lies beyond it: the edge named is no farther than the nearest by the rings' radius.
#[test]
fn far_away_an_edge_is_named_that_is_about_as_near() {
    for far in [3.0, 1e2, 1e6, 1e12] {
        assert!(distances(300, [far, 2.0 * far]).iter().all(|[found, nearest]| found - nearest < 1.0 + 1e-12 * far));
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
            assert!(found - nearest < NEXT_TO, "{found} {nearest}");
        }
    }
}
