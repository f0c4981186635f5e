//! The observed contour: how far a projected boundary lies from it, and how likely that makes a pose.

mod boundary;
pub mod correlation;
pub mod covariance;
pub mod creases;
pub mod fit;
pub mod members;
pub mod mixture;
mod neighbors;
pub mod numbers;
pub mod pieces;
pub mod readings;
pub mod votes;
