//! Assessment of poses: ranking, confidence, covariance, overlap and warnings.

mod checks;
pub mod confidence;
pub mod coverage;
pub mod estimate;
pub mod frame_error;
mod hypothesis;
pub mod mode_probability;
pub mod nearness;
pub mod outliers;
mod ranking;
pub mod solution;
pub mod warning;
pub mod weakness;
