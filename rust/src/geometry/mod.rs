//! Rings of the plane, what is cut of them and what they share, and rigid poses.

pub mod clipping;
pub mod overlap;
pub mod pose;
pub mod rings;
