//! Autocorrelation, normal distributions, functions in single precision and lanes for vector instructions: what everything else is built on.

pub mod autocorrelation;
pub mod gaussian;
pub(crate) mod lanes;
pub mod normal;
pub mod odds;
pub mod single_precision;
