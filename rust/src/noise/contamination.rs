//! Disturbed stretches of a boundary: how much of it, and how far off (`docs/math.md`, section 21).

/// Prior mean of the share of a boundary that is disturbed.
pub const PRIOR_SHARE: f64 = 0.03;

/// Prior scale of the offsets of disturbed stretches, over the square root of their region's area.
pub const SIZE_RATIO: f64 = 0.1;

/// Least ratio of the offsets of disturbed stretches to the noise of clean ones: what is nearer is clean.
pub const LEAST_RATIO: f64 = 4.0;

/// Share of a boundary from which on most of it is clean, and a region belongs to one pose rather than to another: a majority.
pub const MAJORITY: f64 = 0.5;
