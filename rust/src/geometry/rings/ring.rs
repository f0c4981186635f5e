//! One ring of the plane: its edges, area and box, and the ring freed of repeated vertices.

use nalgebra::Vector2;

use crate::error::{Error, Result};

/// Smallest area of a ring as a fraction of its extent squared: what rounding alone may leave of a collapsed ring of
/// ten thousand vertices.
pub const SMALLEST_AREA_FRACTION: f64 = 1e-12;

/// Coordinates below this fraction (2^-140) of the largest one are stored as zero, for the same reason.
pub(crate) const NEGLIGIBLE_FRACTION: f64 = 7.174_648_137_343_064e-43;

/// Signed area of a ring, positive counter-clockwise: half the sum of `(a - o) x (b - o)`, `o` its first vertex.
pub(crate) fn signed_area(ring: &[Vector2<f64>]) -> f64 {
    let Some(&origin) = ring.first() else { return 0.0 };
    0.5 * ring_edges(ring).map(|(a, b)| (a - origin).perp(&(b - origin))).sum::<f64>()
}

/// Whether the area of a ring is too small for its extent, or the ring has no area at all.
#[cfg(feature = "mesh")]
pub(crate) fn is_flat(ring: &[Vector2<f64>]) -> bool {
    signed_area(ring).abs() <= smallest_area(ring)
}

/// Smallest area accepted for a ring of this extent.
#[cfg(feature = "mesh")]
fn smallest_area(ring: &[Vector2<f64>]) -> f64 {
    smallest_area_within(&bounding_box(ring.iter().copied()))
}

/// The same of the corners of a ring's box.
fn smallest_area_within((lower, upper): &(Vector2<f64>, Vector2<f64>)) -> f64 {
    SMALLEST_AREA_FRACTION * (upper - lower).amax().powi(2)
}

/// Edges of one ring as (start, end), the closing one last.
pub(crate) fn ring_edges(ring: &[Vector2<f64>]) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + '_ {
    ring.iter().zip(ring.iter().skip(1).chain(ring.first())).map(|(a, b)| (*a, *b))
}

/// The places of numbers in rising order, ties as they come: the order of a sweep.
pub(crate) fn rising(numbers: impl Iterator<Item = f64>) -> impl Iterator<Item = usize> {
    // As whole numbers of the same order (IEEE 754 total order), and the places behind: compared without a branch.
    let whole = |number: f64| {
        let bits = number.to_bits() as i64;
        (bits ^ (((bits >> 63) as u64) >> 1) as i64) as i128
    };
    let mut order: Vec<i128> = numbers.zip(0..).map(|(number, place)| whole(number) << 64 | place).collect();
    order.sort_unstable();
    order.into_iter().map(|key| key as u64 as usize)
}

/// Corners of the smallest box around `points`.
pub(crate) fn bounding_box(points: impl Iterator<Item = Vector2<f64>>) -> (Vector2<f64>, Vector2<f64>) {
    let start = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
    let lesser = |a: f64, b: f64| if b < a { b } else { a };
    let greater = |a: f64, b: f64| if b > a { b } else { a };
    points.fold(start, |(lower, upper), point| (lower.zip_map(&point, lesser), upper.zip_map(&point, greater)))
}

pub(super) fn without_negligible(point: Vector2<f64>, largest: f64) -> Vector2<f64> {
    let smallest = NEGLIGIBLE_FRACTION * largest;
    point.map(|x| if x.abs() < smallest { 0.0 } else { x })
}

/// One ring freed of repeated vertices, its place in the input remembered for error messages.
pub(super) struct CleanRing {
    pub(super) vertices: Vec<Vector2<f64>>,
    /// Index of each vertex in the ring as given.
    pub(super) given: Vec<usize>,
    pub(super) area: f64,
    /// Corners of the smallest box around it.
    pub(super) bounds: (Vector2<f64>, Vector2<f64>),
}

impl CleanRing {
    pub(super) fn new(given: &[Vector2<f64>], largest: f64) -> Self {
        let (vertices, places) = (Vec::with_capacity(given.len()), Vec::with_capacity(given.len()));
        let mut ring = Self { vertices, given: places, area: 0.0, bounds: Default::default() };
        for (index, &vertex) in given.iter().enumerate() {
            let vertex = without_negligible(vertex, largest);
            if ring.vertices.last() != Some(&vertex) {
                ring.vertices.push(vertex);
                ring.given.push(index);
            }
        }
        while ring.vertices.len() > 1 && ring.vertices.first() == ring.vertices.last() {
            ring.vertices.pop();
            ring.given.pop();
        }
        ring.area = signed_area(&ring.vertices);
        ring.bounds = bounding_box(ring.vertices.iter().copied());
        ring
    }

    pub(super) fn check_count(&self, ring: usize) -> Result<()> {
        let mut found: Vec<&Vector2<f64>> = Vec::with_capacity(3);
        for vertex in &self.vertices {
            if !found.contains(&vertex) {
                found.push(vertex);
            }
            if found.len() == 3 {
                return Ok(());
            }
        }
        Err(Error::TooFewVertices { ring, found: found.len() })
    }

    pub(super) fn check_area(&self, ring: usize) -> Result<()> {
        let needed = smallest_area_within(&self.bounds);
        let area = self.area.abs();
        if area > needed { Ok(()) } else { Err(Error::ZeroArea { ring, area, needed }) }
    }
}
