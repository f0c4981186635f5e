//! Pose estimation by edge alignment: edges of a cloud against the edges of a photo (`docs/math.md`, sections 18 and 19).

pub mod blur;
pub mod cloud_edges;
pub mod density;
pub mod descent;
pub mod edges;
pub mod frame;
mod groups;
pub mod null_poses;
mod parallel;
pub mod pictures;
pub mod posterior;
pub mod projection;
pub mod search;
