//! What is known of a pose: how likely it is right, how well it is held, and the warnings.

mod checks;
pub mod confidence;
pub mod coverage;
pub mod estimate;
pub mod frame_error;
mod hypothesis;
pub mod nearness;
pub mod outliers;
mod ranking;
pub mod shares;
pub mod solution;
pub mod warning;
pub mod weakness;
