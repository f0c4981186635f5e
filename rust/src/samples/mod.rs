//! The pose from samples of regions: how likely they are, and the mean of what they leave possible (`docs/math.md`,
//! section 17).

pub mod ends;
pub mod kinds;
pub mod labels;
pub mod outline;
pub mod posterior;
pub mod propagation;
pub mod readings;
pub mod ring;
pub mod settings;
pub mod signed_field;
pub mod stretch;
pub mod telling;
pub mod trust;
