//! What the tests of poses share: seeded randomness, scenes with a renderer independent of the crate's integrals,
//! and the one checker of derivatives.
pub mod contours;
pub mod jacobian;
pub mod random;
pub mod samples;
pub mod scene;
