//! The pose from labeled samples of regions: expectation propagation with a label noise model, annealed (`docs/math.md`, section 17).

pub mod active_set;
pub mod anneal;
pub mod chain;
pub mod em;
pub mod ep;
pub mod label_inference;
pub mod label_model;
pub mod margin;
pub mod posterior;
pub mod probit_site;
pub mod quadrature;
pub mod segment;
pub mod signed_distance;
