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
    /// A ring leaves its plane.
    #[error(
        "ring {ring} leaves the region's plane by {distance:.3e}; a planar region needs its vertices within {allowed:.3e}"
    )]
    NotPlanar {
        /// Index of the ring.
        ring: usize,
        /// Largest distance of a vertex from the plane.
        distance: f64,
        /// Largest distance accepted.
        allowed: f64,
    },
    /// Triangles that are no open surface.
    #[error("the mesh has {found}; it needs {needed}")]
    BadMesh {
        /// The fault found.
        found: String,
        /// Accepted values.
        needed: &'static str,
    },
    /// A bearing has no direction.
    #[error("{item} {index} is zero; a bearing needs a direction")]
    ZeroBearing {
        /// What the bearing belongs to.
        item: String,
        /// Index of the bearing.
        index: usize,
    },
    /// A line of the image's border, or of hidden edges, with fewer than two distinct bearings.
    #[error("{item} line {line} has {found} bearings; a line needs at least 2")]
    ShortLine {
        /// Which lines: "border" or "hidden".
        item: &'static str,
        /// Index of the line.
        line: usize,
        /// Bearings found.
        found: usize,
    },
    /// An observed region is too wide to be projected onto a plane.
    #[error("the observed region reaches {limit:.1} deg or more from every axis; it needs to lie nearer to one")]
    TooWide {
        /// Largest angle accepted, in degrees.
        limit: f64,
    },
    /// Sums over pixels were asked for without pixels.
    #[error("the observed region holds no pixels; integration over pixels needs a region made from a mask")]
    NoPixels,
    /// A mask of integers has more than two values.
    #[error("mask holds {found} integer values; needed 0 and one other (for labels, pass mask == label)")]
    MaskIntegers {
        /// Number of distinct values.
        found: usize,
    },
    /// A mask of coverage holds what is none.
    #[error("mask holds values from {found}; needed coverage in [0, 1]")]
    MaskCoverage {
        /// The least and the largest value.
        found: String,
    },
    /// A mask without a contour.
    #[error("mask is empty; needed at least one pixel that is covered by more than half")]
    EmptyMask,
    /// No pose shows every region within its view.
    #[error("no pose shows every region where it was observed; the regions need to be paired rightly")]
    NoPose,
    /// The two sides do not pair up.
    #[error("there are {observed} observed and {world} world regions; there need to be as many of each, at least 1")]
    Unpaired {
        /// Number of observed regions.
        observed: usize,
        /// Number of world regions.
        world: usize,
    },
    /// An iteration that has to end did not.
    #[error("the eigenvalues of a covariance did not converge; the region's coordinates need to be of ordinary size")]
    NoConvergence,
    /// The pool of threads could not be started.
    #[error("the threads could not be started: {reason}")]
    Threads {
        /// The system's message.
        reason: String,
    },
    /// An error of one region of several.
    #[error("region {index}: {error}")]
    InRegion {
        /// Index of the region.
        index: usize,
        /// Its error.
        error: Box<Error>,
    },
    /// A triangulation could not be built from its edges.
    #[error("no triangulation of the region: {reason}; rings need to be further apart than rounding")]
    Triangulation {
        /// The fault.
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
    /// A problem of a batch panicked, which is a defect of the crate or of the function that solves it.
    #[error("the solver failed on this problem ({reason}); this is a defect of regionpose")]
    Panicked {
        /// The message of the panic.
        reason: String,
    },
    /// The caller canceled the work.
    #[error("the work was canceled by its caller")]
    Canceled,
    /// An option outside its range.
    #[error("{item} is {found}; it needs to be {needed}")]
    InvalidOption {
        /// The option.
        item: &'static str,
        /// The value found.
        found: String,
        /// Accepted values.
        needed: String,
    },
    /// A prior that no pose can be compared with.
    #[error("{item} is {found}; it needs to be {needed}")]
    InvalidPrior {
        /// The field of the prior.
        item: &'static str,
        /// The value found.
        found: String,
        /// Accepted values.
        needed: String,
    },
    /// A matrix that is no rotation.
    #[error("{item} is {found}; it needs to be {needed}")]
    InvalidRotation {
        /// The matrix.
        item: &'static str,
        /// The value found.
        found: String,
        /// Accepted values.
        needed: String,
    },
    /// Points, vertices or samples of a region that determine no region.
    #[error("{item} is {found}; it needs to be {needed}")]
    InvalidGeometry {
        /// The refused item.
        item: &'static str,
        /// The value found.
        found: String,
        /// Accepted values.
        needed: String,
    },
    /// An observed region that cannot be compared: its area, pixels, or what its image's border leaves of it.
    #[error("{item} is {found}; it needs to be {needed}")]
    InvalidObservation {
        /// The refused item.
        item: &'static str,
        /// The value found.
        found: String,
        /// Accepted values.
        needed: String,
    },
}

impl Error {
    /// The same error, located at the region with this index.
    pub fn in_region(self, index: usize) -> Self {
        Self::InRegion { index, error: Box::new(self) }
    }
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
