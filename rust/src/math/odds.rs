//! The scale of evidence: natural logarithms of odds (`docs/math.md`, section 21).

/// Log odds that decide: five standard deviations of one number. Chance gives the likelier of two poses 3 of them, half of its six
/// parameters, and no more than this in one of 10^4 problems.
pub const DECISIVE: f64 = 12.5;

/// The same as a deviance.
pub const DECISIVE_DEVIANCE: f64 = 2.0 * DECISIVE;

/// Deviance, and squared Mahalanobis distance, up to which two answers are one: one variance. Turns of symmetric shapes, which differ by
/// where the contours' pieces lie alone, are 0.6 at most, poses that fit worse more than 1 (`cargo test symmetry::`).
pub const ONE_VARIANCE: f64 = 1.0;

/// Times as much evidence as decides is needed to give up what is not refined yet: refining gains as much again, and once more by
/// all data.
pub const UNREFINED: f64 = 2.0;
