//! Absolute pose of a central camera from planar regions, without correspondences.
#![forbid(unsafe_code)]

pub mod batch;
pub mod bearing_rings;
pub mod chart;
pub mod derivatives;
pub mod equations;
pub mod error;
pub mod estimate;
pub mod facet;
pub mod fit;
pub mod initial;
pub mod least_squares;
pub mod mesh;
pub mod moments;
pub mod overlap;
pub mod pose;
pub mod region;
pub mod residual;
pub mod rings;
pub mod solve;
pub mod whitening;
