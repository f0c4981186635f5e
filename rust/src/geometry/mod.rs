//! Rings of the plane, what is cut of them and what they share, fewer vertices for them, the edges nearest to points, and
//! rigid poses.

pub mod clipping;
pub(crate) mod edge_boxes;
pub mod edge_field;
pub mod overlap;
pub mod pose;
pub mod rings;
pub mod simplified;
