//! Observed contours: point-to-boundary residuals, their robust likelihood, registration and covariance.

mod boundary;
pub mod covariance;
pub mod creases;
pub mod degrees_of_freedom;
pub mod fit;
pub mod members;
pub mod mixture;
mod neighbors;
pub mod pieces;
pub mod readings;
pub mod region_preference;
