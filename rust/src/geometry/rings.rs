//! The rings that bound a region of the plane, valid by construction.
//!
//! [`PlaneRings`] is the one way in: whoever holds one may rely on closed simple rings that neither cross nor overlap,
//! outer rings counter-clockwise and holes clockwise. All decisions come from exact predicates, without a tolerance,
//! so rings that nearly touch are as welcome as rings that are far apart.

mod crossing;
mod nesting;
pub(crate) mod predicates;

use std::iter;

use nalgebra::Vector2;

use crate::error::{Error, Result};
use nesting::{Location, Nesting};

/// Smallest area of a ring as a fraction of its extent squared: what rounding alone may leave of a collapsed ring of
/// ten thousand vertices.
pub const SMALLEST_AREA_FRACTION: f64 = 1e-12;

/// Largest coordinate accepted (2^200), in the rings' unit: products of four coordinates stay finite.
pub const LARGEST_COORDINATE: f64 = 1.606_938_044_258_990_3e60;

/// Smallest accepted value of a region's largest coordinate (2^-200): exact predicates stay clear of underflow.
pub const SMALLEST_SIZE: f64 = 6.223_015_277_861_142e-61;

/// Coordinates below this fraction (2^-140) of the largest one are stored as zero, for the same reason.
pub(crate) const NEGLIGIBLE_FRACTION: f64 = 7.174_648_137_343_064e-43;

/// The rings of a planar region: outer rings counter-clockwise, holes clockwise, never crossing or overlapping.
///
/// A ring is a list of vertices whose last one joins the first; different rings may touch each other at single points.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneRings {
    rings: Vec<Vec<Vector2<f64>>>,
}

impl PlaneRings {
    /// The region bounded by `rings`, in any order and turning either way: nesting decides which ones are holes.
    ///
    /// A ring inside an even number of others is an outer ring, inside an odd number a hole. Repeated consecutive
    /// vertices and a repeated closing vertex are dropped; each ring keeps its place and its first vertex.
    ///
    /// # Errors
    /// No rings; a coordinate that is not finite or whose size is out of range; a ring with fewer than 3 distinct
    /// vertices or an area below [`SMALLEST_AREA_FRACTION`] of its extent squared; edges that cross, overlap, or touch
    /// within one ring; a ring outside all others that turns against the largest one ([`Error::HoleOutside`]).
    pub fn new(rings: Vec<Vec<Vector2<f64>>>) -> Result<Self> {
        let simple = SimpleRings::new(&rings)?;
        simple.check_outer_turns()?;
        Ok(simple.oriented())
    }

    /// The region bounded by the outline `rings[0]`, every further ring being a hole inside it.
    ///
    /// # Errors
    /// As [`PlaneRings::new`]; a further ring outside the outline ([`Error::HoleOutside`]) or inside another hole
    /// ([`Error::NestedHole`]).
    pub fn polygon(rings: Vec<Vec<Vector2<f64>>>) -> Result<Self> {
        let simple = SimpleRings::new(&rings)?;
        simple.check_holes()?;
        Ok(simple.oriented())
    }

    /// The rings, in the order given, without a repeated closing vertex.
    pub fn rings(&self) -> &[Vec<Vector2<f64>>] {
        &self.rings
    }

    /// Whether a ring bounds a hole.
    pub fn has_holes(&self) -> bool {
        self.rings.iter().any(|ring| signed_area(ring) < 0.0)
    }

    /// Area of the region (outer rings minus holes), in the rings' unit squared; always positive.
    pub fn area(&self) -> f64 {
        self.rings.iter().map(|ring| signed_area(ring)).sum()
    }

    /// The rings under a map that keeps them simple and their orientation, such as a projective map of a half plane that
    /// holds them; `None` where the map has no value.
    pub(crate) fn mapped(&self, map: impl Fn(&Vector2<f64>) -> Option<Vector2<f64>>) -> Option<Self> {
        let mut rings = Vec::with_capacity(self.rings.len());
        for ring in &self.rings {
            let mut mapped = Vec::with_capacity(ring.len());
            for vertex in ring {
                mapped.push(map(vertex)?);
            }
            rings.push(mapped);
        }
        Some(Self { rings })
    }

    /// The rings after a map that may have turned all of them round: outer ones counter-clockwise again.
    pub(crate) fn facing(mut self) -> Self {
        if self.area() < 0.0 {
            self.rings.iter_mut().for_each(|ring| ring.reverse());
        }
        self
    }

    /// Rings that are known to be simple and oriented, as those of what two regions share; none for nothing.
    pub(crate) fn of_simple(rings: Vec<Vec<Vector2<f64>>>) -> Self {
        Self { rings }
    }

    /// Edges of all rings as (start, end), ring by ring; the region lies to their left.
    pub fn edges(&self) -> impl Iterator<Item = (Vector2<f64>, Vector2<f64>)> + '_ {
        self.rings.iter().flat_map(|ring| ring_edges(ring))
    }

    /// Whether `point` lies in the region or on its boundary, exactly; `false` for a point that is not finite.
    pub fn contains(&self, point: Vector2<f64>) -> bool {
        let (lower, upper) = self.bounds();
        if !(0..2).all(|k| lower[k] <= point[k] && point[k] <= upper[k]) {
            return false;
        }
        let point = without_negligible(point, lower.amax().max(upper.amax()));
        let mut inside = false;
        for ring in &self.rings {
            match nesting::location(ring, point) {
                Location::Boundary => return true,
                Location::Inside => inside = !inside,
                Location::Outside => {}
            }
        }
        inside
    }

    /// Corners (lower left, upper right) of the smallest box around the region, sides along the axes.
    pub fn bounds(&self) -> (Vector2<f64>, Vector2<f64>) {
        bounding_box(self.rings.iter().flatten().copied())
    }
}

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

fn without_negligible(point: Vector2<f64>, largest: f64) -> Vector2<f64> {
    let smallest = NEGLIGIBLE_FRACTION * largest;
    point.map(|x| if x.abs() < smallest { 0.0 } else { x })
}

/// One ring freed of repeated vertices, its place in the input remembered for error messages.
struct CleanRing {
    vertices: Vec<Vector2<f64>>,
    /// Index of each vertex in the ring as given.
    given: Vec<usize>,
    area: f64,
    /// Corners of the smallest box around it.
    bounds: (Vector2<f64>, Vector2<f64>),
}

impl CleanRing {
    fn new(given: &[Vector2<f64>], largest: f64) -> Self {
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

    fn check_count(&self, ring: usize) -> Result<()> {
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

    fn check_area(&self, ring: usize) -> Result<()> {
        let needed = smallest_area_within(&self.bounds);
        let area = self.area.abs();
        if area > needed { Ok(()) } else { Err(Error::ZeroArea { ring, area, needed }) }
    }
}

/// Rings known to be simple and apart, with the place of each among the others.
struct SimpleRings {
    rings: Vec<CleanRing>,
    nesting: Vec<Nesting>,
}

impl SimpleRings {
    fn new(given: &[Vec<Vector2<f64>>]) -> Result<Self> {
        if given.is_empty() {
            return Err(Error::NoRings);
        }
        let largest = largest_coordinate(given)?;
        let rings: Vec<CleanRing> = given.iter().map(|ring| CleanRing::new(ring, largest)).collect();
        for (index, ring) in rings.iter().enumerate() {
            ring.check_count(index)?;
        }
        check_size_range(largest)?;
        crossing::check_apart(&rings)?;
        for (index, ring) in rings.iter().enumerate() {
            ring.check_area(index)?;
        }
        let nesting = nesting::nesting(&rings);
        Ok(Self { rings, nesting })
    }

    fn check_outer_turns(&self) -> Result<()> {
        let outer = || (0..self.rings.len()).filter(|&k| self.nesting[k].depth == 0);
        let size = |k: usize| self.rings[k].area.abs();
        let Some(largest) = outer().max_by(|&a, &b| size(a).total_cmp(&size(b)).then(b.cmp(&a))) else {
            return Ok(());
        };
        let turn = self.rings[largest].area > 0.0;
        match outer().find(|&k| (self.rings[k].area > 0.0) != turn) {
            Some(ring) => Err(Error::HoleOutside { ring }),
            None => Ok(()),
        }
    }

    fn check_holes(&self) -> Result<()> {
        for ring in 1..self.rings.len() {
            let around = |ring: usize| self.nesting[ring].parent;
            match around(ring) {
                Some(0) => {}
                Some(outer) if iter::successors(Some(outer), |&outer| around(outer)).any(|outer| outer == 0) => {
                    return Err(Error::NestedHole { ring, outer });
                }
                _ => return Err(Error::HoleOutside { ring }),
            }
        }
        Ok(())
    }

    fn oriented(self) -> PlaneRings {
        let turned = |(mut ring, place): (CleanRing, Nesting)| {
            if (ring.area > 0.0) != place.depth.is_multiple_of(2) {
                ring.vertices[1..].reverse();
            }
            ring.vertices
        };
        PlaneRings { rings: self.rings.into_iter().zip(self.nesting).map(turned).collect() }
    }
}

fn largest_coordinate(rings: &[Vec<Vector2<f64>>]) -> Result<f64> {
    let mut largest = 0.0_f64;
    for (ring, vertices) in rings.iter().enumerate() {
        for (index, vertex) in vertices.iter().enumerate() {
            if let Some(&value) = vertex.iter().find(|x| !x.is_finite()) {
                return Err(Error::NotFinite { item: format!("ring {ring} vertex"), index, value });
            }
            largest = largest.max(vertex.amax());
        }
    }
    if largest > LARGEST_COORDINATE { Err(size_out_of_range(largest)) } else { Ok(largest) }
}

fn check_size_range(largest: f64) -> Result<()> {
    if largest < SMALLEST_SIZE { Err(size_out_of_range(largest)) } else { Ok(()) }
}

fn size_out_of_range(largest: f64) -> Error {
    Error::OutOfRange {
        item: "the largest coordinate of the rings",
        found: format!("{largest:e}"),
        needed: format!("from {SMALLEST_SIZE:.1e} to {LARGEST_COORDINATE:.1e}"),
    }
}
