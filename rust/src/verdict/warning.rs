//! Warnings of an estimate: their codes and texts.

use nalgebra::Vector3;
use thiserror::Error as Message;

use crate::equations::least_squares::Termination;
use crate::geometry::pose::Pose;

/// Poses that a warning spells out; of more, it says how many are left.
const SPELT_OUT: usize = 3;

const MM: f64 = 1e3;

/// What a user has to know before trusting a pose. Lengths are meters, axes the camera's.
#[derive(Debug, Clone, PartialEq, Message)]
#[non_exhaustive]
pub enum Warning {
    /// Other poses fit as well.
    #[error("{} other pose(s) fit as well, the regions are symmetric or too few: {}", .others.len(), listed(.others))]
    Ambiguous {
        /// From the best pose to each of the others, the nearest first.
        others: Vec<RelativePose>,
    },
    /// The search or its least squares did not end at a minimum.
    #[error("the search did not converge: {termination}")]
    NotConverged {
        /// Why it ended.
        termination: Termination,
    },
    /// No pose was found from the samples of regions: it is that of their outlines, by which they are judged.
    #[error("nothing was found that the samples of regions leave possible: this pose is that of their outlines alone")]
    SamplesUnused,
    /// A projected region does not cover the observed one.
    #[error("region {region} projected with this pose misses the observed one by {percent:.1} % of its area")]
    PoorOverlap {
        /// The region.
        region: usize,
        /// Overlap error in percent.
        percent: f64,
    },
    /// A region's contour lies nowhere where the others put it.
    #[error(
        "region {region} does not belong to this pose: {percent:.0} % of its contour lies on its projection, of the others {others:.0} %"
    )]
    OutlierRegion {
        /// The region.
        region: usize,
        /// Share of its contour on the projected boundary, percent.
        percent: f64,
        /// The same of the other regions.
        others: f64,
    },
    /// A region's contour lies nowhere where a pose that fits alike puts it.
    #[error(
        "region {region} does not belong to the other pose that is {degrees:.1} deg away: {percent:.0} % of its contour lies on its projection, of the others {others:.0} %"
    )]
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
    /// Nothing else is wrong, but too little of the contours speaks for the pose.
    #[error("too little of the contours speaks for this pose: it is right with a probability of {percent:.0} %")]
    LowConfidence {
        /// Probability that the pose is within 5 degrees of the true one, percent.
        percent: f64,
    },
    /// The standard deviations of the pose exceed what a trusted one may have.
    #[error("{}{}", held(*.degrees, .axis, *.shift, .along, [*.most_degrees, *.most_shift]), because(.causes))]
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
        /// What makes it weak, as far as can be told.
        causes: Vec<Cause>,
    },
    /// The pose is not where the initial one says.
    #[error("the pose lies {degrees:.2} deg and {:.1} mm from the initial one{}", MM * .shift, beyond(.sigmas))]
    InitialContradicted {
        /// Rotation from the initial pose, degrees.
        degrees: f64,
        /// Distance between the camera's places.
        shift: f64,
        /// Both in standard deviations of the initial pose and the pose together, where the initial one has any.
        sigmas: Option<f64>,
    },
    /// Up is not where the prior says.
    #[error("the up direction lies {degrees:.1} deg off the image's, {sigmas:.1} times what is known of it (1 sigma)")]
    UpContradicted {
        /// Angle, degrees.
        degrees: f64,
        /// The same in standard deviations.
        sigmas: f64,
    },
    /// The camera is not where the prior says.
    #[error(
        "the camera stands {:.1} mm from the place it is known to be near, {sigmas:.1} times what is known of it (1 sigma)",
        MM * .shift
    )]
    PlaceContradicted {
        /// Distance between the two places.
        shift: f64,
        /// The same in standard deviations of prior and pose together.
        sigmas: f64,
    },
    /// A region is seen from the side away from its viewpoint.
    #[error("region {region} is seen from behind: this pose shows the side away from the viewpoint it was given")]
    SideContradicted {
        /// The region.
        region: usize,
    },
}

impl Warning {
    /// A short name that stays the same from version to version.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Ambiguous { .. } => "ambiguous",
            Self::NotConverged { .. } => "not-converged",
            Self::SamplesUnused => "samples-unused",
            Self::PoorOverlap { .. } => "poor-overlap",
            Self::OutlierRegion { .. } => "outlier-region",
            Self::AmbiguousRegion { .. } => "ambiguous-region",
            Self::LowConfidence { .. } => "low-confidence",
            Self::WeakGeometry { .. } => "weak-geometry",
            Self::InitialContradicted { .. } => "initial-contradicted",
            Self::UpContradicted { .. } => "up-contradicted",
            Self::PlaceContradicted { .. } => "place-contradicted",
            Self::SideContradicted { .. } => "side-contradicted",
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

/// From one pose to another.
#[derive(Debug, Clone, PartialEq, Message)]
#[error("{degrees:.1} deg about camera axis [{}] with the camera {:.1} mm away", shown(.axis), MM * .shift)]
pub struct RelativePose {
    /// Turn, degrees.
    pub degrees: f64,
    /// The axis it is about.
    pub axis: Vector3<f64>,
    /// Distance between the camera's places.
    pub shift: f64,
}

impl RelativePose {
    /// From a pose to another: the turn in the camera's axes, and how far the camera goes.
    pub(super) fn between(from: &Pose, to: &Pose) -> Self {
        let increment = from.local_coordinates(to);
        let (turn, shift) = (increment.fixed_rows::<3>(0).into_owned(), increment.fixed_rows::<3>(3).norm());
        Self { degrees: turn.norm().to_degrees(), axis: turn.try_normalize(0.0).unwrap_or_else(Vector3::zeros), shift }
    }
}

/// What makes a geometry weak.
#[derive(Debug, Clone, Copy, PartialEq, Message)]
#[non_exhaustive]
pub enum Cause {
    /// A plane that faces the camera looks the same, to first order, after a small tilt either way.
    #[error("the plane is seen frontally, {degrees:.0} deg off the line of sight")]
    Frontal {
        /// Angle between its normal and the ray.
        degrees: f64,
    },
    /// Regions of few pixels.
    #[error("no region is more than {pixels:.0} px across")]
    Tiny {
        /// Side of a square of the largest one's area.
        pixels: f64,
    },
    /// Regions that one scan line crosses.
    #[error("{count} of {regions} regions are known along one scan line only")]
    Lines {
        /// How many.
        count: usize,
        /// Of so many.
        regions: usize,
    },
    /// Several regions that are one plane.
    #[error("all regions lie in one plane")]
    Coplanar,
}

fn listed(others: &[RelativePose]) -> String {
    let mut parts: Vec<String> = others.iter().take(SPELT_OUT).map(|way| way.to_string()).collect();
    if others.len() > SPELT_OUT {
        parts.push(format!("and {} more", others.len() - SPELT_OUT));
    }
    parts.join("; ")
}

fn because(causes: &[Cause]) -> String {
    let named: Vec<String> = causes.iter().map(|cause| cause.to_string()).collect();
    if named.is_empty() { String::new() } else { format!(": {}", named.join(", and ")) }
}

fn beyond(sigmas: &Option<f64>) -> String {
    sigmas.map_or_else(String::new, |sigmas| format!(", {sigmas:.1} times the uncertainty of both (1 sigma)"))
}

fn held(degrees: f64, axis: &Vector3<f64>, shift: f64, along: &Vector3<f64>, most: [f64; 2]) -> String {
    if !(degrees.is_finite() && shift.is_finite()) {
        return "the regions leave a direction of the pose free".into();
    }
    let (axis, along, shift) = (shown(axis), shown(along), MM * shift);
    format!(
        "the pose is held weakly: {degrees:.2} deg about camera axis [{axis}] and {shift:.1} mm along [{along}] (1 sigma), where {:.2} deg \
         and {:.1} mm are the limits",
        most[0],
        MM * most[1]
    )
}

fn shown(direction: &Vector3<f64>) -> String {
    format!("{:.2}, {:.2}, {:.2}", direction.x, direction.y, direction.z)
}
