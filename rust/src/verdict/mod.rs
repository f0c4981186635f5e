//! What is known of a pose: how likely it is right, how well it is held, and the warnings.

pub mod confidence;
pub mod coverage;
pub mod estimate;
pub mod frame_error;
pub mod nearness;
pub mod outliers;
pub mod shares;
pub mod warning;
pub mod weakness;
