//! Which ring lies inside which, exactly.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::iter;

use nalgebra::Vector2;

use super::predicates::turn;
use super::ring::{CleanRing, ring_edges};

/// Position of a point relative to one ring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Location {
    Inside,
    Outside,
    /// On an edge or a vertex.
    Boundary,
}

/// Position of `point` relative to `ring`: the parity of the edges that a ray towards +x crosses.
pub(crate) fn location(ring: &[Vector2<f64>], point: Vector2<f64>) -> Location {
    let mut inside = false;
    for (a, b) in ring_edges(ring) {
        if point == a {
            return Location::Boundary;
        }
        if point == b {
            continue; // the start of the next edge
        }
        if (a.y > point.y) != (b.y > point.y) {
            let side = turn(a, b, point);
            if side.is_eq() {
                return Location::Boundary;
            }
            inside ^= side.is_gt() == (b.y > a.y);
        } else if a.y == point.y && b.y == point.y && (a.x < point.x) != (b.x <= point.x) {
            return Location::Boundary;
        }
    }
    if inside { Location::Inside } else { Location::Outside }
}

/// Nesting of a ring among others.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Nesting {
    /// The innermost ring around it.
    pub(super) parent: Option<usize>,
    /// Number of rings around it.
    pub(super) depth: usize,
}

/// An edge that is not level, of a ring of this index.
#[derive(Debug, Clone, Copy)]
struct Edge {
    low: Vector2<f64>,
    high: Vector2<f64>,
    ring: usize,
    /// Whether what the ring bounds lies on the right of the edge.
    opens: bool,
}

impl Ord for Edge {
    /// From left to right, of edges that are at some height both, may touch there and do not cross.
    fn cmp(&self, other: &Self) -> Ordering {
        if other.low.y < self.low.y {
            return other.cmp(self).reverse();
        }
        let by_ends = || match other.high.y < self.high.y {
            true => turn(self.low, self.high, other.high),
            false => turn(other.low, other.high, self.high).reverse(),
        };
        turn(self.low, self.high, other.low).then_with(by_ends)
    }
}

impl PartialOrd for Edge {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Edge {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Edge {}

/// Nesting of simple, disjoint rings.
///
/// A line is swept upwards: what lies just left of a ring where it begins is the ring around it, or one beside it.
pub(super) fn nesting(rings: &[CleanRing]) -> Vec<Nesting> {
    if rings.len() < 2 {
        return vec![Nesting::default(); rings.len()];
    }
    let edges: Vec<Edge> = rings.iter().enumerate().flat_map(|(index, ring)| edges(index, ring)).collect();
    let by_height = |height: fn(&Edge) -> f64| {
        let mut order: Vec<&Edge> = edges.iter().collect();
        order.sort_by(|a, b| height(a).total_cmp(&height(b)));
        order
    };
    let mut ends = by_height(|edge| edge.high.y).into_iter().peekable();
    let mut crossed: BTreeSet<Edge> = BTreeSet::new();
    let (mut firsts, mut beside) = (vec![None::<&Edge>; rings.len()], vec![None; rings.len()]);
    for begun in by_height(|edge| edge.low.y).chunk_by(|a, b| a.low.y == b.low.y) {
        while let Some(ended) = ends.next_if(|edge| edge.high.y <= begun[0].low.y) {
            crossed.remove(ended);
        }
        crossed.extend(begun.iter().copied());
        let lowest = || begun.iter().copied().filter(|edge| rings[edge.ring].bounds.0.y == edge.low.y);
        for edge in lowest() {
            let first = firsts[edge.ring].get_or_insert(edge);
            *first = (*first).min(edge);
        }
        for edge in lowest().filter(|edge| firsts[edge.ring] == Some(*edge)) {
            beside[edge.ring] = crossed.range(..*edge).next_back().copied();
        }
    }
    nested(&beside)
}

/// The edges of a ring that are not level.
fn edges(ring: usize, clean: &CleanRing) -> impl Iterator<Item = Edge> {
    ring_edges(&clean.vertices).filter(|(a, b)| a.y != b.y).map(move |(a, b)| {
        let rises = a.y < b.y;
        let (low, high) = if rises { (a, b) } else { (b, a) };
        Edge { low, high, ring, opens: rises != (clean.area > 0.0) }
    })
}

/// The places of rings that have these edges on their left where they begin.
fn nested(beside: &[Option<Edge>]) -> Vec<Nesting> {
    let mut found: Vec<Option<Nesting>> = vec![None; beside.len()];
    for ring in 0..beside.len() {
        let unknown = |ring: &usize| found[*ring].is_none();
        let row = iter::successors(Some(ring), |&next| beside[next].map(|edge| edge.ring)).take_while(unknown);
        for ring in row.collect::<Vec<_>>().into_iter().rev() {
            let left = beside[ring].map(|edge| (edge, found[edge.ring].unwrap_or_default()));
            found[ring] = Some(match left {
                None => Nesting::default(),
                Some((edge, place)) if edge.opens => Nesting { parent: Some(edge.ring), depth: place.depth + 1 },
                Some((_, place)) => place,
            });
        }
    }
    found.into_iter().map(Option::unwrap_or_default).collect()
}
