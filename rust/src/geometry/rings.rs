//! The rings that bound a region of the plane, valid by construction.
//!
//! [`PlaneRings`] is the one way in: whoever holds one may rely on closed simple rings that neither cross nor overlap,
//! outer rings counter-clockwise and holes clockwise. All decisions come from exact predicates, without a tolerance,
//! so rings that nearly touch are as welcome as rings that are far apart.

mod crossing;
mod nesting;
pub(crate) mod predicates;
mod ring;

use std::iter;

use nalgebra::Vector2;

use crate::error::{Error, Result};
use nesting::{Location, Nesting};
use ring::{CleanRing, without_negligible};

pub use ring::SMALLEST_AREA_FRACTION;
#[cfg(feature = "mesh")]
pub(crate) use ring::{NEGLIGIBLE_FRACTION, is_flat};
pub(crate) use ring::{bounding_box, ring_edges, signed_area};

/// Largest coordinate accepted (2^200), in the rings' unit: products of four coordinates stay finite.
pub const LARGEST_COORDINATE: f64 = 1.606_938_044_258_990_3e60;

/// Smallest accepted value of a region's largest coordinate (2^-200): exact predicates stay clear of underflow.
pub const SMALLEST_SIZE: f64 = 6.223_015_277_861_142e-61;

/// The rings of a planar region: outer rings counter-clockwise, holes clockwise, never crossing or overlapping.
///
/// A ring is a list of vertices whose last one joins the first; different rings may touch each other at single points.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
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

    /// Rings that are simple and oriented by construction, as those of an intersection; none for an empty one.
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

/// Simple, disjoint rings, with the nesting of each.
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
    Error::InvalidGeometry {
        item: "the largest coordinate of the rings",
        found: format!("{largest:e}"),
        needed: format!("from {SMALLEST_SIZE:.1e} to {LARGEST_COORDINATE:.1e}"),
    }
}
