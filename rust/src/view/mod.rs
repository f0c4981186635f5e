//! The image side of a region: rings of bearings, the region's own chart, the image's border.

pub mod bearing_rings;
pub mod border;
pub mod chart;
pub mod mask;
