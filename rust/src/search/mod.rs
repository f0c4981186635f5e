//! Poses to start from, and what they lead to.

pub mod candidates;
pub mod closed_form;
pub mod corners;
pub mod fit;
pub mod p3p;
pub mod places;
pub mod symmetry;
