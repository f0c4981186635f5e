//! Normal distributions, functions in single precision and groups of numbers for vector instructions: what everything else is built on.

pub mod gaussian;
pub(crate) mod lanes;
pub mod normal;
pub mod single_precision;
