//! The one error type of the crate.

use thiserror::Error;

/// Why an input was refused: which item, what was found, what is needed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// A region needs at least one ring.
    #[error("the region has no rings; it needs at least 1")]
    NoRings,
    /// A ring has too few distinct vertices to bound an area.
    #[error("ring {ring} has {found} distinct vertices; a region ring needs at least 3")]
    TooFewVertices {
        /// Index of the ring.
        ring: usize,
        /// Distinct vertices found.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("{item} {index} is not finite: {value}; coordinates need to be finite numbers")]
    NotFinite {
        /// What the coordinate belongs to, for example `ring 2 vertex`.
        item: String,
        /// Index of the item.
        index: usize,
        /// The value found.
        value: f64,
    },
    /// Two edges of the rings meet where they must not.
    #[error(
        "edge {first_edge} of ring {first_ring} {contact} edge {second_edge} of ring {second_ring}; a ring needs to be \
         simple, and different rings may touch at single points only"
    )]
    Crossing {
        /// Ring of the first edge.
        first_ring: usize,
        /// First edge, counted from its start vertex.
        first_edge: usize,
        /// Ring of the second edge.
        second_ring: usize,
        /// Second edge.
        second_edge: usize,
        /// How they meet.
        contact: Contact,
    },
    /// A ring encloses no area.
    #[error("ring {ring} has area {area:.3e}; a region ring needs an area above {needed:.3e}")]
    ZeroArea {
        /// Index of the ring.
        ring: usize,
        /// Area found.
        area: f64,
        /// Smallest area accepted for a ring of its extent.
        needed: f64,
    },
    /// A hole lies outside its outer ring.
    #[error("ring {ring} is a hole outside every outer ring; a hole needs to lie inside its outer ring")]
    HoleOutside {
        /// Index of the ring.
        ring: usize,
    },
    /// A hole of a polygon lies inside another hole.
    #[error("ring {ring} lies inside the hole ring {outer}; the holes of a polygon need to lie side by side")]
    NestedHole {
        /// Index of the ring.
        ring: usize,
        /// Index of the hole around it.
        outer: usize,
    },
    /// A triangulation could not be built from its edges.
    #[error("no triangulation of the region: {reason}; rings need to be further apart than rounding")]
    Triangulation {
        /// What went wrong.
        reason: String,
    },
    /// A mesh does not cover its region.
    #[error("the mesh has area {found:e}, the region {needed:e}; the rings need to be further apart than rounding")]
    MeshArea {
        /// Area of the mesh.
        found: f64,
        /// Area of the region.
        needed: f64,
    },
    /// Refinement did not end.
    #[error(
        "refinement stopped at {vertices} vertices, {budget} of them allowed on top of the rings'; it needs a larger \
         max_area or a smaller min_angle"
    )]
    MeshIncomplete {
        /// Vertices reached.
        vertices: usize,
        /// Vertices allowed besides those of the rings.
        budget: usize,
    },
    /// Too few distinct points for an outline.
    #[error("{found} distinct points; an outline needs at least 3")]
    TooFewPoints {
        /// Distinct points found.
        found: usize,
    },
    /// All points of an outline lie on one line.
    #[error("all {found} distinct points lie on one line; an outline needs points that span an area")]
    CollinearPoints {
        /// Distinct points found.
        found: usize,
    },
    /// An alpha shape keeps no triangle.
    #[error("radius {radius:e} keeps none of the triangles; it needs to be at least {smallest:e}")]
    EmptyShape {
        /// Radius given.
        radius: f64,
        /// Smallest radius that keeps a triangle.
        smallest: f64,
    },
    /// An option or a size lies outside its range.
    #[error("{item} is {found}; it needs to be {needed}")]
    OutOfRange {
        /// The option or size.
        item: &'static str,
        /// The value found.
        found: String,
        /// What is accepted.
        needed: String,
    },
}

/// How two edges meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Contact {
    /// They change sides of each other.
    Crosses,
    /// They share more than a point.
    Overlaps,
    /// They share one point without changing sides.
    Touches,
}

impl std::fmt::Display for Contact {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Crosses => "crosses",
            Self::Overlaps => "overlaps",
            Self::Touches => "touches",
        })
    }
}

/// `Result` of this crate.
pub type Result<T> = std::result::Result<T, Error>;
