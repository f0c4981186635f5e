//! Rings of the plane, what is cut of them and what they share, fewer vertices for them, the edges nearest to points, the
//! points farthest from chords, and rigid poses.

pub mod clipping;
pub(crate) mod edge_boxes;
pub mod edge_field;
pub mod overlap;
mod point_tree;
pub mod pose;
pub mod rings;
pub mod simplified;
