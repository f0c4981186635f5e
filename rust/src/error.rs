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
    /// Two edges of the rings cross or touch.
    #[error(
        "edge {first_edge} of ring {first_ring} crosses edge {second_edge} of ring {second_ring}; rings need to be simple and apart"
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
    /// A ring that turns as a hole lies outside every other ring.
    #[error("ring {ring} turns as a hole but lies outside every other ring; a hole needs to lie inside its outer ring")]
    HoleOutside {
        /// Index of the ring.
        ring: usize,
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

/// `Result` of this crate.
pub type Result<T> = std::result::Result<T, Error>;
