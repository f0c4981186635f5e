//! Search for edges that cross, overlap or touch where they must not: sweep and prune along one axis.

use nalgebra::Vector2;

use super::predicates::{contact, is_left_of_corner, lies_on, turn};
use super::ring::{CleanRing, bounding_box, ring_edges, rising, without_negligible};
use crate::error::{Contact, Error, Result};

/// Edges for which a strip of its own pays: a convention.
const EDGES_PER_STRIP: usize = 64;

/// One edge of one ring with its box, `along` the sweep axis and `across` it.
struct Edge {
    ring: usize,
    index: usize,
    ends: [Vector2<f64>; 2],
    along: [f64; 2],
    across: [f64; 2],
}

/// Refuses rings with an edge that crosses or overlaps another, or touches another of the same ring.
pub(super) fn check_apart(rings: &[CleanRing]) -> Result<()> {
    if let [ring] = rings
        && is_star(&ring.vertices)
    {
        return Ok(());
    }
    let edges = edges_for_sweep(rings);
    let strips = Strips::new(&edges);
    let mut active = vec![Vec::<&Edge>::new(); strips.count];
    for edge in rising(edges.iter().map(|edge| edge.along[0])).map(|index| &edges[index]) {
        let (first, last) = (strips.at(edge.across[0]), strips.at(edge.across[1]));
        for (strip, active) in (first..).zip(&mut active[first..=last]) {
            active.retain(|other| other.along[1] >= edge.along[0]);
            for other in &*active {
                // A pair that shares several strips is tested in the first of these.
                let is_first = strip == first || strip == strips.at(other.across[0]);
                if is_first && other.across[0] <= edge.across[1] && edge.across[0] <= other.across[1] {
                    check_pair(rings, other, edge)?;
                }
            }
            active.push(edge);
        }
    }
    Ok(())
}

/// Strips of equal width along the sweep: edges that share none are apart.
struct Strips {
    count: usize,
    low: f64,
    per_unit: f64,
}

impl Strips {
    /// Of no more than [`EDGES_PER_STRIP`] edges in the mean, and as wide as an edge, in the mean, or wider: together they hold
    /// an edge about twice.
    fn new(edges: &[Edge]) -> Self {
        let low = edges.iter().map(|edge| edge.across[0]).fold(f64::INFINITY, f64::min);
        let high = edges.iter().map(|edge| edge.across[1]).fold(f64::NEG_INFINITY, f64::max);
        let widths: f64 = edges.iter().map(|edge| edge.across[1] - edge.across[0]).sum();
        let most = (high - low) / widths * edges.len() as f64;
        let count = (most.min((edges.len() / EDGES_PER_STRIP) as f64) as usize).max(1);
        Self { count, low, per_unit: count as f64 / (high - low) }
    }

    /// The strip that holds a place.
    fn at(&self, across: f64) -> usize {
        (((across - self.low) * self.per_unit) as usize).min(self.count - 1)
    }
}

/// Whether a ring goes once around the mean of its vertices, all edges turning one way about it: none can then meet another.
fn is_star(ring: &[Vector2<f64>]) -> bool {
    let largest = ring.iter().map(Vector2::amax).fold(0.0, f64::max);
    let middle = without_negligible(ring.iter().sum::<Vector2<f64>>() / ring.len() as f64, largest);
    let (first, second) = (ring[0], ring[1 % ring.len()]);
    let way = turn(middle, first, second);
    let crossings = ring_edges(ring).filter(|(a, b)| (a.y > middle.y) != (b.y > middle.y)).count();
    // An edge turns by less than half a circle: twice across a line through the middle is once around.
    way.is_ne() && crossings == 2 && ring_edges(ring).all(|(a, b)| turn(middle, a, b) == way)
}

/// All edges, to be swept along the axis along which they are shorter, hence fewer at a time.
fn edges_for_sweep(rings: &[CleanRing]) -> Vec<Edge> {
    let vertices = || rings.iter().flat_map(|ring| ring.vertices.iter().copied());
    let (lower, upper) = bounding_box(vertices());
    let lengths = rings.iter().flat_map(|ring| ring_edges(&ring.vertices)).map(|(a, b)| (b - a).abs());
    let share = lengths.sum::<Vector2<f64>>().component_div(&(upper - lower));
    let axis = if share.x <= share.y { 0 } else { 1 };
    let mut edges = Vec::with_capacity(vertices().count());
    for (ring, clean) in rings.iter().enumerate() {
        for (index, (a, b)) in ring_edges(&clean.vertices).enumerate() {
            let interval = |k: usize| [a[k].min(b[k]), a[k].max(b[k])];
            edges.push(Edge { ring, index, ends: [a, b], along: interval(axis), across: interval(1 - axis) });
        }
    }
    edges
}

fn check_pair(rings: &[CleanRing], first: &Edge, second: &Edge) -> Result<()> {
    if first.ring == second.ring && are_bent(first, second, rings[first.ring].vertices.len()) {
        return Ok(());
    }
    let Some(contact) = contact(first.ends, second.ends) else { return Ok(()) };
    let contact = match contact {
        Contact::Touches if first.ring == second.ring => {
            if are_neighbors(first, second, rings[first.ring].vertices.len()) {
                return Ok(());
            }
            Contact::Touches
        }
        Contact::Touches if passes_through(rings, first, second) => Contact::Crosses,
        Contact::Touches => return Ok(()),
        found => found,
    };
    let (first, second) =
        if (first.ring, first.index) <= (second.ring, second.index) { (first, second) } else { (second, first) };
    Err(Error::Crossing {
        first_ring: first.ring,
        first_edge: rings[first.ring].given[first.index],
        second_ring: second.ring,
        second_edge: rings[second.ring].given[second.index],
        contact,
    })
}

fn are_neighbors(first: &Edge, second: &Edge, count: usize) -> bool {
    (first.index + 1) % count == second.index || (second.index + 1) % count == first.index
}

/// Whether two neighbors on a ring turn a corner: they then meet there alone.
fn are_bent(first: &Edge, second: &Edge, count: usize) -> bool {
    let [a, b] = first.ends;
    are_neighbors(first, second, count) && second.ends.into_iter().any(|end| turn(a, b, end).is_ne())
}

/// Whether two rings that touch at a vertex change sides there, rather than only meet.
fn passes_through(rings: &[CleanRing], first: &Edge, second: &Edge) -> bool {
    let Some(corner) = touching_point(first, second) else { return false };
    let path = path_through(&rings[first.ring].vertices, first, corner);
    let [before, _, after] = path_through(&rings[second.ring].vertices, second, corner);
    let runs_along =
        |arm: Vector2<f64>, other: Vector2<f64>| contact([corner, arm], [corner, other]) == Some(Contact::Overlaps);
    if [before, after].iter().any(|&arm| runs_along(path[0], arm) || runs_along(path[2], arm)) {
        return false; // the two edges that overlap are found as a pair of their own
    }
    is_left_of_corner(path, before) != is_left_of_corner(path, after)
}

/// The one vertex that two touching segments share or that lies on the other.
fn touching_point(first: &Edge, second: &Edge) -> Option<Vector2<f64>> {
    let on_second = first.ends.into_iter().find(|&end| lies_on(end, second.ends));
    on_second.or_else(|| second.ends.into_iter().find(|&end| lies_on(end, first.ends)))
}

/// The vertex before, the corner, and the vertex after it on the ring that runs through `corner` on `edge`.
fn path_through(ring: &[Vector2<f64>], edge: &Edge, corner: Vector2<f64>) -> [Vector2<f64>; 3] {
    let [a, b] = edge.ends;
    let count = ring.len();
    if corner == a {
        [ring[(edge.index + count - 1) % count], corner, b]
    } else if corner == b {
        [a, corner, ring[(edge.index + 2) % count]]
    } else {
        [a, corner, b]
    }
}
