//! The observed contour: its pieces, how far a projected boundary lies from it, and what that says of a pose.

pub mod correlation;
pub mod covariance;
pub mod distance;
pub mod loss;
pub mod mixture;
pub mod pieces;
