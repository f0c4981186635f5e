//! What is known of a pose: how likely it is right, how well it is held, what to be warned of.

pub mod confidence;
pub mod estimate;
pub mod warning;
pub mod weakness;
