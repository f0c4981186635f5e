//! What the rest of a scene says of a pose: depth steps of its points, and how far these lie on edges of the photo
//! (`docs/math.md`, section 18).

pub mod agreement;
pub mod blur;
pub mod edges;
pub mod evidence;
