//! What a user has to know before trusting a pose.

use nalgebra::Vector3;
use thiserror::Error as Message;

/// What a user has to know before trusting a pose.
#[derive(Debug, Clone, PartialEq, Message)]
#[non_exhaustive]
pub enum Warning {
    /// Other poses fit as well.
    #[error(
        "{count} other pose(s) fit as well, the nearest {degrees:.1} deg away: the regions are symmetric or too few"
    )]
    Ambiguous {
        /// How many.
        count: usize,
        /// Rotation to the nearest of them.
        degrees: f64,
    },
    /// The least squares did not end at a minimum.
    #[error("the least squares did not converge: {termination}")]
    NotConverged {
        /// Why it ended.
        termination: String,
    },
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
    /// The regions hold the pose only weakly.
    #[error(
        "weak geometry: {degrees:.2} deg about camera axis [{}] and {share:.1} % of the distance along [{}] (1 sigma)", shown(.axis), shown(.along)
    )]
    WeakGeometry {
        /// Largest standard deviation of the rotation, degrees.
        degrees: f64,
        /// The camera axis it is about.
        axis: Vector3<f64>,
        /// Largest standard deviation of the translation, percent of the distance.
        share: f64,
        /// The camera direction it is along.
        along: Vector3<f64>,
    },
}

impl Warning {
    /// A short name that stays the same from version to version.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Ambiguous { .. } => "ambiguous",
            Self::NotConverged { .. } => "not-converged",
            Self::PoorOverlap { .. } => "poor-overlap",
            Self::OutlierRegion { .. } => "outlier-region",
            Self::WeakGeometry { .. } => "weak-geometry",
        }
    }
}

fn shown(direction: &Vector3<f64>) -> String {
    format!("{:.2}, {:.2}, {:.2}", direction.x, direction.y, direction.z)
}
