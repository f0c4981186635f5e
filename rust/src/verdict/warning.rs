//! Warnings of an estimate: their codes and numbers.

use nalgebra::Vector3;

use crate::equations::least_squares::Termination;
use crate::geometry::pose::Pose;

/// A reason not to trust a pose as it is. Lengths are meters, axes the camera's.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Warning {
    /// Other poses fit as well.
    Ambiguous {
        /// Relative poses from the best one to each of the others, the nearest first.
        others: Vec<RelativePose>,
    },
    /// The search or its least squares did not end at a minimum.
    NotConverged {
        /// The reason.
        termination: Termination,
    },
    /// No pose was found from the samples of regions: it is that of their outlines, by which they are judged.
    SamplesUnused,
    /// A projected region does not cover the observed one.
    PoorOverlap {
        /// The region.
        region: usize,
        /// Overlap error in percent.
        percent: f64,
    },
    /// A region contradicts the pose that the others support.
    OutlierRegion {
        /// The region.
        region: usize,
        /// Share of its contour on the projected boundary, percent.
        percent: f64,
        /// The same of the other regions.
        others: f64,
    },
    /// A region contradicts another pose that fits alike.
    AmbiguousRegion {
        /// The region.
        region: usize,
        /// Rotation from the best pose to the other one, degrees.
        degrees: f64,
        /// Share of its contour on the projected boundary, percent.
        percent: f64,
        /// The same of the other regions.
        others: f64,
    },
    /// No other warning applies, but too little of the contours matches at the pose.
    LowConfidence {
        /// Probability that the pose is within 5 degrees of the true one, percent.
        percent: f64,
    },
    /// The standard deviations of the pose exceed what a trusted one may have.
    WeakGeometry {
        /// Largest standard deviation of the rotation, degrees; infinite where a direction is free.
        degrees: f64,
        /// The axis it is about.
        axis: Vector3<f64>,
        /// Largest standard deviation of the translation.
        shift: f64,
        /// The direction it is along.
        along: Vector3<f64>,
        /// The largest deviation of the rotation of a trusted pose, degrees.
        most_degrees: f64,
        /// The same of the translation.
        most_shift: f64,
        /// Causes, as far as they can be identified.
        causes: Vec<Cause>,
    },
    /// The pose contradicts the initial one.
    InitialContradicted {
        /// Rotation from the initial pose, degrees.
        degrees: f64,
        /// Distance between the camera's places.
        shift: f64,
        /// Both in standard deviations of the initial pose and the pose together, where the initial one has any.
        sigmas: Option<f64>,
    },
    /// The pose contradicts the prior's up direction.
    UpContradicted {
        /// Angle, degrees.
        degrees: f64,
        /// The same in standard deviations.
        sigmas: f64,
    },
    /// The pose contradicts the prior's camera place.
    PlaceContradicted {
        /// Distance between the two places.
        shift: f64,
        /// The same in standard deviations of prior and pose together.
        sigmas: f64,
    },
    /// A region is seen from the side opposite to its viewpoint.
    SideContradicted {
        /// The region.
        region: usize,
    },
}

impl Warning {
    /// A short name that is stable across versions.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Ambiguous { .. } => "ambiguous-pose",
            Self::NotConverged { .. } => "not-converged",
            Self::SamplesUnused => "samples-unused",
            Self::PoorOverlap { .. } => "poor-overlap",
            Self::OutlierRegion { .. } => "outlier-region",
            Self::AmbiguousRegion { .. } => "ambiguous-region",
            Self::LowConfidence { .. } => "low-confidence",
            Self::WeakGeometry { .. } => "weak-geometry",
            Self::InitialContradicted { .. } => "initial-pose-conflict",
            Self::UpContradicted { .. } => "up-direction-conflict",
            Self::PlaceContradicted { .. } => "camera-position-conflict",
            Self::SideContradicted { .. } => "viewpoint-conflict",
        }
    }

    /// The region that it is about, if it is about one.
    pub fn region(&self) -> Option<usize> {
        match self {
            Self::PoorOverlap { region, .. }
            | Self::OutlierRegion { region, .. }
            | Self::AmbiguousRegion { region, .. }
            | Self::SideContradicted { region } => Some(*region),
            _ => None,
        }
    }
}

/// The motion from one pose to another.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RelativePose {
    /// Turn, degrees.
    pub degrees: f64,
    /// The axis it is about.
    pub axis: Vector3<f64>,
    /// Distance between the camera's places.
    pub shift: f64,
}

impl RelativePose {
    /// The motion from a pose to another: the turn in the camera's axes, and the distance between both places.
    pub(super) fn between(from: &Pose, to: &Pose) -> Self {
        let increment = from.local_coordinates(to);
        let (turn, shift) = (increment.fixed_rows::<3>(0).into_owned(), increment.fixed_rows::<3>(3).norm());
        Self { degrees: turn.norm().to_degrees(), axis: turn.try_normalize(0.0).unwrap_or_else(Vector3::zeros), shift }
    }
}

/// A cause of weak geometry.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Cause {
    /// A plane that faces the camera: to first order its view does not change with its tilt.
    Frontal {
        /// Angle between its normal and the ray.
        degrees: f64,
    },
    /// Regions of few pixels.
    Tiny {
        /// Side of a square of the largest one's area.
        pixels: f64,
    },
    /// Regions that one scan line crosses.
    Lines {
        /// How many.
        count: usize,
        /// Of so many.
        regions: usize,
    },
    /// Several regions that are one plane.
    Coplanar,
}
