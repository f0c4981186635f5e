//! Intersection of two polygons with holes (Weiler and Atherton 1977).
//!
//! Every decision is an exact predicate on the first region moved by an infinitesimal step, along x first and then, far
//! smaller still, along y: no vertex then lies on an edge of the other region, so that vertices that touch and edges that
//! coincide need no case of their own. The area, like any other integral, is independent of the step (`docs/math.md`, section 14).

use std::ops::Range;

use nalgebra::Vector2;

use crate::budget::Budget;
use crate::geometry::edge_boxes::EdgeBoxes;
use crate::geometry::rings::predicates::turn;
use crate::geometry::rings::ring_edges;

type Point = Vector2<f64>;

/// The rings of an intersection, and which of their edges the second region gave.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Clipped {
    /// Closed rings, turning as those that were given.
    pub rings: Vec<Vec<Point>>,
    /// The edges of the second region that bound them, in their direction.
    pub border: Vec<[Point; 2]>,
}

/// The intersection of two regions; outer rings turn counter-clockwise, holes clockwise, rings of one region do not cross.
pub fn intersection(first: &[Vec<Point>], second: &[Vec<Point>], budget: &Budget) -> Clipped {
    Window::new(second.to_vec()).shared_with(first, budget)
}

/// A region that others are cut by: its rings, and boxes around their edges, made once for all of them.
#[derive(Debug, Clone)]
pub struct Window {
    rings: Vec<Vec<Point>>,
    /// All edges, ring after ring.
    edges: EdgeBoxes,
}

/// Cost of a crossing, in edge evaluations: those that were nearly crossed, its places among those of both
/// boundaries, its point in the ring. Measured, 200 to 400 ns (`fuzz --target border --seed 270000866 --runs 1`).
const EDGES_OF_CROSSING: usize = 100;

/// A crossing of an edge of the first region and one of the second.
struct Crossing {
    /// The edges' numbers over all rings, and the shares of them before the place: the first region's, the second's.
    places: [(usize, f64); 2],
    point: Point,
    /// Whether the first region's boundary enters the second region there; the second's then leaves the first.
    enters: bool,
}

impl Window {
    /// The region of rings: outer ones turn counter-clockwise, holes clockwise, none cross.
    pub fn new(rings: Vec<Vec<Point>>) -> Self {
        Self { edges: EdgeBoxes::new(edges(&rings).collect()), rings }
    }

    /// The number of edges.
    pub fn edge_count(&self) -> usize {
        self.edges.count()
    }

    /// The intersection of another region with this one, which gives the border; charges the edges it evaluates.
    pub fn shared_with(&self, first: &[Vec<Point>], budget: &Budget) -> Clipped {
        let crossings = self.crossings(first, budget);
        let of_first = paths(first, &crossings, 0, |point| is_inside(&self.edges, point, 1.0, budget));
        let of_second = match &self.rings[..] {
            // One test alone is not worth boxes.
            [_] => {
                budget.charge(edges(first).count());
                paths(&self.rings, &crossings, 1, |point| holds(first, point, -1.0))
            }
            _ => {
                let first = EdgeBoxes::new(edges(first).collect());
                paths(&self.rings, &crossings, 1, |point| is_inside(&first, point, -1.0, budget))
            }
        };
        let mut clipped = stitched(&of_first, &of_second, crossings.len());
        for ring in &of_second.closed {
            clipped.border.extend((0..ring.len()).map(|k| [ring[k], ring[(k + 1) % ring.len()]]));
        }
        clipped.rings.extend(of_first.closed.into_iter().chain(of_second.closed));
        clipped
    }

    fn crossings(&self, first: &[Vec<Point>], budget: &Budget) -> Vec<Crossing> {
        let mut found = Vec::new();
        for (number, [a, b]) in edges(first).enumerate() {
            let crossed = |other: usize, [c, d]: [Point; 2]| {
                let enters = is_left(c, d, b, 1.0);
                if is_left(c, d, a, 1.0) == enters || is_left(a, b, c, -1.0) == is_left(a, b, d, -1.0) {
                    return;
                }
                let (share, other_share) = (share_before(a, b, c, d), share_before(c, d, a, b));
                let places = [(number, share), (other, other_share)];
                found.push(Crossing { places, point: a.lerp(&b, share), enters });
            };
            self.edges.for_each_across([a, b], crossed, budget);
        }
        budget.charge(EDGES_OF_CROSSING * found.len());
        found
    }
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

fn edges(rings: &[Vec<Point>]) -> impl Iterator<Item = [Point; 2]> + '_ {
    rings.iter().flat_map(|ring| ring_edges(ring)).map(|(a, b)| [a, b])
}

/// The parts of a boundary inside the other region.
#[derive(Default)]
struct Paths {
    /// From crossing to crossing, with the points between, of the points of all.
    open: Vec<Path>,
    points: Vec<Point>,
    /// Whole rings.
    closed: Vec<Vec<Point>>,
}

struct Path {
    from: usize,
    to: usize,
    points: Range<usize>,
}

/// A crossing along a ring: its edge and share, its number, where it is, and whether the ring enters the other region.
#[derive(Clone, Copy)]
struct Event {
    at: (usize, f64),
    crossing: usize,
    point: Point,
    enters: bool,
}

/// The parts of the first (0) or the second (1) region's boundary inside the other, of which `holds` tests points.
fn paths(rings: &[Vec<Point>], crossings: &[Crossing], side: usize, holds: impl Fn(Point) -> bool) -> Paths {
    let (mut events, mut end) = (along(crossings, side), 0);
    let (mut rest, mut paths) = (events.as_mut_slice(), Paths::default());
    for ring in rings {
        end += ring.len();
        let count = rest.partition_point(|event| event.at.0 < end);
        let (along, remaining) = rest.split_at_mut(count);
        rest = remaining;
        let begins_inside = ring.first().is_some_and(|&point| holds(point));
        if begins_inside && along.is_empty() {
            paths.closed.push(ring.clone());
        }
        along.iter_mut().for_each(|event| event.at.0 -= end - ring.len());
        alternate(along, begins_inside);
        paths.add_inside(ring, along);
    }
    paths
}

/// Crossings in the order in which a region's boundary meets them.
fn along(crossings: &[Crossing], side: usize) -> Vec<Event> {
    // By whole numbers, an edge's and behind it the crossing's: far faster than by shares, which few crossings have to be.
    let key = |(number, crossing): (usize, &Crossing)| (crossing.places[side].0 as u128) << 64 | number as u128;
    let mut order: Vec<u128> = crossings.iter().enumerate().map(key).collect();
    order.sort_unstable();
    let event = |key: u128| {
        let number = key as u64 as usize;
        let Crossing { places, point, enters } = &crossings[number];
        Event { at: places[side], crossing: number, point: *point, enters: *enters == (side == 0) }
    };
    let mut events: Vec<Event> = order.into_iter().map(event).collect();
    for on_edge in events.chunk_by_mut(|a, b| a.at.0 == b.at.0) {
        on_edge.sort_by(|a, b| a.at.1.total_cmp(&b.at.1));
    }
    events
}

/// Whether rings hold a point moved by an infinitesimal step of this sign.
pub fn holds(rings: &[Vec<Point>], point: Point, moved: f64) -> bool {
    edges(rings).filter(|&[a, b]| is_beside(a, b, point, moved)).count() % 2 == 1
}

/// Whether the region that edges bound holds a point moved by an infinitesimal step of this sign.
fn is_inside(edges: &EdgeBoxes, point: Point, moved: f64, budget: &Budget) -> bool {
    let mut inside = false;
    edges.for_each_near(
        // A ray to the right meets nothing that is above, below or left of the point.
        |[low, high]| low.y <= point.y && high.y >= point.y && high.x >= point.x,
        |_, [a, b]| inside ^= is_beside(a, b, point, moved),
        budget,
    );
    inside
}

/// Whether a ray to the right from a point moved by an infinitesimal step of this sign meets an edge.
fn is_beside(a: Point, b: Point, point: Point, moved: f64) -> bool {
    let above = |y: f64| y > point.y || (y == point.y && moved < 0.0);
    above(a.y) != above(b.y) && is_left(a, b, point, moved) == (b.y > a.y)
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

impl Paths {
    /// Adds the stretches of a ring from where it enters the other region to where it leaves it.
    fn add_inside(&mut self, ring: &[Point], events: &[Event]) {
        for k in (0..events.len()).filter(|&k| events[k].enters) {
            let (from, to) = (&events[k], &events[(k + 1) % events.len()]);
            let mut steps = (to.at.0 + ring.len() - from.at.0) % ring.len();
            // On around the ring where the next crossing is the one before on the same edge.
            if steps == 0 && (k + 1) % events.len() <= k {
                steps = ring.len();
            }
            let first = self.points.len();
            self.points.push(from.point);
            self.points.extend((1..=steps).map(|step| ring[(from.at.0 + step) % ring.len()]));
            self.points.push(to.point);
            self.open.push(Path { from: from.crossing, to: to.crossing, points: first..self.points.len() });
        }
    }
}

/// Closed rings of the stretches of both boundaries, which take turns at the crossings.
fn stitched(first: &Paths, second: &Paths, crossings: usize) -> Clipped {
    let sides = [first, second];
    let mut starting = vec![[None; 2]; crossings];
    for (side, paths) in sides.into_iter().enumerate() {
        for path in &paths.open {
            starting[path.from][side] = Some(path);
        }
    }
    let mut clipped = Clipped::default();
    for begin in 0..crossings {
        let (mut ring, mut at, mut side) = (Vec::new(), begin, 0);
        while let Some(path) = starting[at][side].take() {
            let points = &sides[side].points[path.points.clone()];
            ring.extend_from_slice(&points[..points.len() - 1]);
            if side == 1 {
                clipped.border.extend(points.windows(2).map(|ends| [ends[0], ends[1]]));
            }
            (at, side) = (path.to, 1 - side);
        }
        if !ring.is_empty() {
            clipped.rings.push(ring);
        }
    }
    clipped
}
