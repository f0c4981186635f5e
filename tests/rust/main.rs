//! The tests of the crate through its public interface, in one binary: it is compiled and linked once, and its tests run side by side.

mod support;

mod alignment;
#[cfg(feature = "batch")]
mod batch;
mod border;
mod chart;
mod clipping;
mod closed_form;
mod confidence;
mod contour;
mod corners;
mod correlation;
mod covariance;
mod creases;
#[cfg(feature = "mesh")]
mod derivatives;
mod directions;
mod disturbed;
mod edge_field;
mod edge_sums;
#[cfg(feature = "mesh")]
mod estimate;
#[cfg(feature = "mesh")]
mod found;
mod frame_error;
mod growth;
mod hidden;
mod mask;
#[cfg(feature = "mesh")]
mod mesh;
mod mixture;
mod moments;
mod nearness;
mod outliers;
mod overlap;
mod p3p;
mod pieces;
mod pose;
mod prior;
mod region;
mod rings;
mod sampled;
mod samples;
mod scene_steps;
mod segments;
#[cfg(feature = "serde")]
mod serialization;
mod signed_distance;
mod symmetry;
mod uninformative;
