//! Absolute pose of a central camera from planar regions, without correspondences.
#![forbid(unsafe_code)]

pub mod error;
pub mod mesh;
pub mod moments;
pub mod overlap;
pub mod rings;
