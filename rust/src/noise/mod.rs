//! The noise that contours and samples share: of a boundary where it is clean, and of its disturbed stretches (`docs/math.md`, section 21).

pub mod boundary;
pub mod contamination;
