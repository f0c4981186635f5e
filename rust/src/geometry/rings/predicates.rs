//! Exact answers about points and segments of the plane (Shewchuk 1997, by the crate `robust`).
//!
//! All points need to be finite and of a size for which products neither overflow nor underflow.

use std::cmp::Ordering;

use nalgebra::Vector2;
use robust::{Coord, orient2d};

use crate::error::Contact;

/// Side of the line from `a` to `b` on which `c` lies: `Greater` left, `Less` right, `Equal` exactly on it.
pub(crate) fn turn(a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>) -> Ordering {
    let coord = |p: Vector2<f64>| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c)).partial_cmp(&0.0).unwrap_or(Ordering::Equal)
}

/// Order along x, ties by y.
pub(crate) fn by_x_then_y(a: &Vector2<f64>, b: &Vector2<f64>) -> Ordering {
    a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
}

/// The kind of intersection of the segments `(a, b)` and `(c, d)`, if any.
pub(crate) fn contact([a, b]: [Vector2<f64>; 2], [c, d]: [Vector2<f64>; 2]) -> Option<Contact> {
    let (side_c, side_d) = (turn(a, b, c), turn(a, b, d));
    if side_c == side_d {
        return if side_c.is_eq() { contact_on_line([a, b], [c, d]) } else { None };
    }
    let (side_a, side_b) = (turn(c, d, a), turn(c, d, b));
    if side_a == side_b {
        return None;
    }
    let on_line = [side_a, side_b, side_c, side_d].iter().any(|side| side.is_eq());
    Some(if on_line { Contact::Touches } else { Contact::Crosses })
}

/// Whether `point` lies on the segment `(a, b)`, ends included.
pub(crate) fn lies_on(point: Vector2<f64>, [a, b]: [Vector2<f64>; 2]) -> bool {
    let (lower, upper) = (a.inf(&b), a.sup(&b));
    turn(a, b, point).is_eq() && (0..2).all(|k| lower[k] <= point[k] && point[k] <= upper[k])
}

fn contact_on_line(first: [Vector2<f64>; 2], second: [Vector2<f64>; 2]) -> Option<Contact> {
    let sorted = |[a, b]: [Vector2<f64>; 2]| if by_x_then_y(&a, &b).is_le() { [a, b] } else { [b, a] };
    let ([first_low, first_high], [second_low, second_high]) = (sorted(first), sorted(second));
    let low = if by_x_then_y(&first_low, &second_low).is_ge() { first_low } else { second_low };
    let high = if by_x_then_y(&first_high, &second_high).is_le() { first_high } else { second_high };
    match by_x_then_y(&low, &high) {
        Ordering::Less => Some(Contact::Overlaps),
        Ordering::Equal => Some(Contact::Touches),
        Ordering::Greater => None,
    }
}

/// Whether the direction from `corner` to `point` lies strictly left of the path `previous -> corner -> next`.
pub(crate) fn is_left_of_corner([previous, corner, next]: [Vector2<f64>; 3], point: Vector2<f64>) -> bool {
    let left_of_arrival = turn(previous, corner, point).is_gt();
    let left_of_departure = turn(corner, next, point).is_gt();
    if turn(previous, corner, next).is_lt() {
        left_of_arrival || left_of_departure
    } else {
        left_of_arrival && left_of_departure
    }
}
