//! Moments compared: which, by how much a pose changes them, on what scale, and their least squares.

mod boundary_sums;
pub mod derivatives;
pub mod facet;
pub mod information;
pub mod least_squares;
pub mod normal_equations;
pub mod residual;
pub mod step_bounds;
pub mod system;
pub mod whitening;
