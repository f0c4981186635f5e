//! The part of one region that lies in another (Weiler and Atherton 1977).
//!
//! Every decision is an exact predicate on the first region moved by an infinitesimal step, along x first and then, far
//! smaller still, along y: no vertex then lies on an edge of the other region, so that vertices that touch and edges that
//! coincide need no case of their own. The area, as every other integral, does not feel the step (`docs/math.md`, section 14).

use nalgebra::Vector2;

use crate::geometry::rings::predicates::turn;

type Point = Vector2<f64>;

/// The rings of an intersection, and which of their edges the second region gave.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Clipped {
    /// Closed rings, turning as those that were given.
    pub rings: Vec<Vec<Point>>,
    /// The edges of the second region that bound them, in their direction.
    pub border: Vec<[Point; 2]>,
}

/// What two regions share; outer rings turn counter-clockwise, holes clockwise, rings of one region do not cross.
pub fn intersection(first: &[Vec<Point>], second: &[Vec<Point>]) -> Clipped {
    let (ahead, behind) = (Side { rings: first, moved: 1.0 }, Side { rings: second, moved: -1.0 });
    let crossings = crossings(first, second);
    let of_first = ahead.paths(&behind, crossings.iter().map(|c| (c.first, c.point, c.enters)));
    let of_second = behind.paths(&ahead, crossings.iter().map(|c| (c.second, c.point, !c.enters)));
    let mut clipped = stitched(&of_first.open, &of_second.open, crossings.len());
    for ring in of_second.closed.iter() {
        clipped.border.extend((0..ring.len()).map(|k| [ring[k], ring[(k + 1) % ring.len()]]));
    }
    clipped.rings.extend(of_first.closed.into_iter().chain(of_second.closed));
    clipped
}

/// A place on a region's boundary: ring, edge, and the share of the edge before it.
type Place = (usize, usize, f64);

/// Where an edge of the first region crosses one of the second.
struct Crossing {
    first: Place,
    second: Place,
    point: Point,
    /// Whether the first region's boundary enters the second region there; the second's then leaves the first.
    enters: bool,
}

/// Edges in one box: neighbors along a ring lie together, and a box that an edge misses holds none that it crosses. A convention.
const GROUP: usize = 16;

/// An edge: its ring, its number, and its ends.
type Edge = (usize, usize, Point, Point);

fn crossings(first: &[Vec<Point>], second: &[Vec<Point>]) -> Vec<Crossing> {
    let others: Vec<Edge> = edges(second).collect();
    let boxes: Vec<[Point; 2]> = others.chunks(GROUP).map(around).collect();
    let mut found = Vec::new();
    for (ring, edge, a, b) in edges(first) {
        let (lower, upper) = (a.inf(&b), a.sup(&b));
        let apart = |low: Point, high: Point| (0..2).any(|k| low[k] > upper[k] || high[k] < lower[k]);
        let near = others.chunks(GROUP).zip(&boxes).filter(|(_, [low, high])| !apart(*low, *high));
        for &(other_ring, other_edge, c, d) in near.flat_map(|(edges, _)| edges) {
            if apart(c.inf(&d), c.sup(&d)) {
                continue;
            }
            let enters = is_left(c, d, b, 1.0);
            if is_left(c, d, a, 1.0) == enters || is_left(a, b, c, -1.0) == is_left(a, b, d, -1.0) {
                continue;
            }
            let (share, other_share) = (share_before(a, b, c, d), share_before(c, d, a, b));
            let point = a.lerp(&b, share);
            found.push(Crossing {
                first: (ring, edge, share),
                second: (other_ring, other_edge, other_share),
                point,
                enters,
            });
        }
    }
    found
}

/// The least and the greatest coordinates of edges.
fn around(edges: &[Edge]) -> [Point; 2] {
    let ends = || edges.iter().flat_map(|&(_, _, c, d)| [c, d]);
    let low = ends().fold(Point::repeat(f64::INFINITY), |low, end| low.inf(&end));
    [low, ends().fold(Point::repeat(f64::NEG_INFINITY), |high, end| high.sup(&end))]
}

/// Share of the edge from `a` to `b` before the line through `c` and `d`.
fn share_before(a: Point, b: Point, c: Point, d: Point) -> f64 {
    let (before, after) = ((d - c).perp(&(a - c)), (d - c).perp(&(b - c)));
    let share = before / (before - after);
    // Rounding may leave nothing of a difference that the predicates know.
    if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.5 }
}

/// Whether a point moved by an infinitesimal step of this sign lies left of the line from `a` to `b`.
fn is_left(a: Point, b: Point, point: Point, moved: f64) -> bool {
    match turn(a, b, point) {
        std::cmp::Ordering::Greater => true,
        std::cmp::Ordering::Less => false,
        std::cmp::Ordering::Equal if a.y != b.y => moved * (a.y - b.y) > 0.0,
        std::cmp::Ordering::Equal => moved * (b.x - a.x) > 0.0,
    }
}

fn edges(rings: &[Vec<Point>]) -> impl Iterator<Item = Edge> + '_ {
    rings
        .iter()
        .enumerate()
        .flat_map(|(ring, points)| (0..points.len()).map(move |k| (ring, k, points[k], points[(k + 1) % points.len()])))
}

/// One of two regions, and the sign of its step against the other.
struct Side<'a> {
    rings: &'a [Vec<Point>],
    moved: f64,
}

/// The parts of a boundary inside the other region.
#[derive(Default)]
struct Paths {
    /// From crossing to crossing, with the points between.
    open: Vec<Path>,
    /// Whole rings.
    closed: Vec<Vec<Point>>,
}

struct Path {
    from: usize,
    to: usize,
    points: Vec<Point>,
}

/// A crossing along a ring: its edge and share, its number, where it is, and whether the ring enters the other region.
#[derive(Clone, Copy)]
struct Event {
    at: (usize, f64),
    crossing: usize,
    point: Point,
    enters: bool,
}

impl Side<'_> {
    fn paths(&self, other: &Self, crossings: impl Iterator<Item = (Place, Point, bool)>) -> Paths {
        let mut events: Vec<Vec<Event>> = self.rings.iter().map(|_| Vec::new()).collect();
        for (crossing, ((ring, edge, share), point, enters)) in crossings.enumerate() {
            events[ring].push(Event { at: (edge, share), crossing, point, enters });
        }
        let mut paths = Paths::default();
        for (ring, mut along) in self.rings.iter().zip(events) {
            let begins_inside = ring.first().is_some_and(|&point| holds(other.rings, point, self.moved));
            if begins_inside && along.is_empty() {
                paths.closed.push(ring.clone());
            }
            along.sort_by(|a, b| a.at.0.cmp(&b.at.0).then(a.at.1.total_cmp(&b.at.1)));
            alternate(&mut along, begins_inside);
            paths.open.extend(inside(ring, &along));
        }
        paths
    }
}

/// Whether rings hold a point moved by an infinitesimal step of this sign.
pub fn holds(rings: &[Vec<Point>], point: Point, moved: f64) -> bool {
    let above = |y: f64| y > point.y || (y == point.y && moved < 0.0);
    let beside = |&(_, _, a, b): &(usize, usize, Point, Point)| {
        above(a.y) != above(b.y) && is_left(a, b, point, moved) == (b.y > a.y)
    };
    edges(rings).filter(beside).count() % 2 == 1
}

/// Puts crossings that rounding brought to the same place in an order in which the boundary goes in and out by turns.
fn alternate(events: &mut [Event], mut inside: bool) {
    for k in 0..events.len() {
        let Some(next) = (k..events.len()).find(|&j| events[j].enters != inside) else { return };
        // The places along the ring keep their order.
        let (at, other) = (events[k].at, events[next].at);
        events.swap(k, next);
        (events[k].at, events[next].at) = (at, other);
        inside = !inside;
    }
}

/// The stretches of a ring from where it enters the other region to where it leaves it.
fn inside(ring: &[Point], events: &[Event]) -> Vec<Path> {
    let entries = (0..events.len()).filter(|&k| events[k].enters);
    entries
        .map(|k| {
            let (from, to) = (&events[k], &events[(k + 1) % events.len()]);
            let mut steps = (to.at.0 + ring.len() - from.at.0) % ring.len();
            // On around the ring where the next crossing is the one before on the same edge.
            if steps == 0 && (k + 1) % events.len() <= k {
                steps = ring.len();
            }
            let mut points = vec![from.point];
            points.extend((1..=steps).map(|step| ring[(from.at.0 + step) % ring.len()]));
            points.push(to.point);
            Path { from: from.crossing, to: to.crossing, points }
        })
        .collect()
}

/// Closed rings of the stretches of both boundaries, which take turns at the crossings.
fn stitched(first: &[Path], second: &[Path], crossings: usize) -> Clipped {
    let mut starting = vec![[None; 2]; crossings];
    for (side, paths) in [first, second].into_iter().enumerate() {
        for path in paths {
            starting[path.from][side] = Some(path);
        }
    }
    let mut clipped = Clipped::default();
    for begin in 0..crossings {
        let (mut ring, mut at, mut side) = (Vec::new(), begin, 0);
        while let Some(path) = starting[at][side].take() {
            ring.extend_from_slice(&path.points[..path.points.len() - 1]);
            if side == 1 {
                clipped.border.extend(path.points.windows(2).map(|ends| [ends[0], ends[1]]));
            }
            (at, side) = (path.to, 1 - side);
        }
        if !ring.is_empty() {
            clipped.rings.push(ring);
        }
    }
    clipped
}
