//! Which ring lies inside which, exactly.

use nalgebra::Vector2;

use super::CleanRing;
use super::predicates::{is_left_of_corner, turn};

/// Where a point lies relative to one ring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Location {
    Inside,
    Outside,
    /// On the edge with this index; on its start where it is a vertex.
    Boundary(usize),
}

/// Where `point` lies relative to `ring`: the parity of the edges that a ray towards +x crosses.
pub(crate) fn location(ring: &[Vector2<f64>], point: Vector2<f64>) -> Location {
    let mut inside = false;
    for (index, (a, b)) in super::ring_edges(ring).enumerate() {
        if point == a {
            return Location::Boundary(index);
        }
        if point == b {
            continue; // the start of the next edge
        }
        if (a.y > point.y) != (b.y > point.y) {
            let side = turn(a, b, point);
            if side.is_eq() {
                return Location::Boundary(index);
            }
            inside ^= side.is_gt() == (b.y > a.y);
        } else if a.y == point.y && b.y == point.y && (a.x < point.x) != (b.x <= point.x) {
            return Location::Boundary(index);
        }
    }
    if inside { Location::Inside } else { Location::Outside }
}

/// For each ring the rings that contain it, in order; the rings have to be simple and apart.
///
/// A line is swept upwards: a ring can lie only in those whose boxes it is in where the ring begins.
pub(super) fn parents(rings: &[CleanRing]) -> Vec<Vec<usize>> {
    let low = |ring: usize| rings[ring].bounds.0.y;
    let mut upwards: Vec<usize> = (0..rings.len()).collect();
    upwards.sort_by(|&a, &b| low(a).total_cmp(&low(b)));
    let mut to_come = upwards.iter().copied().peekable();
    let (mut crossed, mut parents) = (Vec::new(), vec![Vec::new(); rings.len()]);
    for &inner in &upwards {
        while let Some(outer) = to_come.next_if(|&outer| low(outer) <= low(inner)) {
            crossed.push(outer);
        }
        crossed.retain(|&outer| rings[outer].bounds.1.y >= low(inner));
        parents[inner] = crossed.iter().copied().filter(|&outer| holds(&rings[outer], &rings[inner])).collect();
        parents[inner].sort_unstable();
    }
    parents
}

/// Whether a ring contains another one.
fn holds(outer: &CleanRing, inner: &CleanRing) -> bool {
    let ((outer_low, outer_high), (low, high)) = (outer.bounds, inner.bounds);
    let within_box = (0..2).all(|k| outer_low[k] <= low[k] && high[k] <= outer_high[k]);
    !std::ptr::eq(outer, inner) && within_box && contains_ring(outer, &inner.vertices)
}

/// Whether the first edge of `inner` runs inside `outer`; it may start on the boundary.
fn contains_ring(outer: &CleanRing, inner: &[Vector2<f64>]) -> bool {
    let ring = &outer.vertices;
    match location(ring, inner[0]) {
        Location::Inside => true,
        Location::Outside => false,
        Location::Boundary(index) => {
            let count = ring.len();
            let before = if ring[index] == inner[0] { (index + count - 1) % count } else { index };
            let path = [ring[before], inner[0], ring[(index + 1) % count]];
            is_left_of_corner(path, inner[1]) == (outer.area > 0.0)
        }
    }
}
