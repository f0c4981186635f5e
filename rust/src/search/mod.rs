//! Poses to start from, and the ones that may be the answer.

pub mod candidates;
pub mod centroids;
pub mod closed_form;
pub mod corners;
pub mod cuts;
pub mod decision;
pub mod directions;
pub mod moments;
mod outlined;
pub mod p3p;
pub mod poses;
pub mod sampled;
pub mod symmetry;
mod turns;
