//! What the edges of a scene say of a pose: those of a cloud, and how far these lie on the edges of a photo (`docs/math.md`, sections
//! 18 and 19).

pub mod blur;
pub mod cloud_edges;
pub mod density;
pub mod descent;
pub mod edges;
pub mod frame;
mod groups;
mod parallel;
pub mod pictures;
pub mod posterior;
pub mod projection;
pub mod search;
