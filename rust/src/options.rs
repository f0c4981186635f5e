//! Options of the pose search, expected errors of an exposure, and limits of a trusted pose.

use crate::prior::Prior;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Where the search starts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Start {
    /// From the closed form of every region, without any prior (`docs/math.md`, section 7).
    #[default]
    Global,
    /// From the paper's start for the first region, solved alone, then all together (paper section 2.1.1 and 2.2.1).
    Paper,
}

/// Refinement after the solution of the moment equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Refinement {
    /// Where a part of the contours is disturbed, the pose is refined on the rest, unless several regions all have samples.
    #[default]
    Contour,
    /// Nothing.
    Off,
}

/// Options of a pose search.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::{ObservedRegion, Options, Prior, Problem, Refinement, WorldRegion};
/// # let corners = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)];
/// # let sign: Vec<_> = corners.iter().map(|&(x, y)| Vector3::new(x, y, 0.7 * y)).collect();
/// # let bearings = sign.iter().map(|x| (x + Vector3::new(-0.2, 0.1, 4.0)).normalize()).collect();
/// # let observed = [ObservedRegion::new(vec![bearings], 20_000.0)];
/// # let worlds = [WorldRegion::from_rings(&[sign])?];
/// // A camera held upright, in a world whose y axis points down; the moments alone decide.
/// let prior = Prior::default().with_up(-Vector3::y(), None)?;
/// let options = Options::default().with_prior(prior).with_refinement(Refinement::Off);
/// let estimate = Problem::new(&observed, &worlds)?.estimate_with(&options)?;
/// assert!(estimate.warnings.is_empty() && estimate.best.minimum.is_some());
/// # Ok::<(), regionpose::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[must_use]
#[non_exhaustive]
pub struct Options {
    /// Where the search starts.
    pub start: Start,
    /// The prior of the pose.
    pub prior: Prior,
    /// Refinement after the moments.
    pub refinement: Refinement,
    /// Errors of calibration, time and scan, which add to the covariance.
    pub frame_sigma: FrameSigma,
    /// Largest standard deviations of a pose that is trusted.
    pub limits: Limits,
}

impl Options {
    /// The same with another start.
    pub fn with_start(self, start: Start) -> Self {
        Self { start, ..self }
    }

    /// The same with another prior.
    pub fn with_prior(self, prior: Prior) -> Self {
        Self { prior, ..self }
    }

    /// The same with another refinement.
    pub fn with_refinement(self, refinement: Refinement) -> Self {
        Self { refinement, ..self }
    }

    /// The same with other errors of calibration, time and scan.
    pub fn with_frame_sigma(self, frame_sigma: FrameSigma) -> Self {
        Self { frame_sigma, ..self }
    }

    /// The same with other limits of a trusted pose.
    pub fn with_limits(self, limits: Limits) -> Self {
        Self { limits, ..self }
    }
}

impl Default for Options {
    fn default() -> Self {
        let (start, prior, refinement) = (Start::default(), Prior::default(), Refinement::default());
        Self { start, prior, refinement, frame_sigma: FrameSigma::default(), limits: Limits::default() }
    }
}

/// Standard deviations of errors of a whole exposure, which no contour shows: its calibration, and the time between photo and scan
/// (`docs/math.md`, section 10).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[must_use]
#[non_exhaustive]
pub struct FrameSigma {
    /// Of the camera's rotation, rad.
    pub rotation: f64,
    /// Of its place, where regions are those of a scan.
    pub place: f64,
    /// Of the focal lengths, as a share of them.
    pub focal: f64,
    /// Of the image's center along either axis, pixels: of the rotation, too, by the angle that a pixel is.
    pub center: f64,
}

impl FrameSigma {
    /// No errors, as of simulated exposures.
    pub const ZERO: Self = Self { rotation: 0.0, place: 0.0, focal: 0.0, center: 0.0 };

    /// The same with another deviation of the camera's rotation, rad.
    pub fn with_rotation(self, rotation: f64) -> Self {
        Self { rotation, ..self }
    }

    /// The same with another deviation of its place.
    pub fn with_place(self, place: f64) -> Self {
        Self { place, ..self }
    }

    /// The same with another deviation of the focal lengths, as a share of them.
    pub fn with_focal(self, focal: f64) -> Self {
        Self { focal, ..self }
    }

    /// The same with another deviation of the image's center along either axis, pixels.
    pub fn with_center(self, center: f64) -> Self {
        Self { center, ..self }
    }
}

impl Default for FrameSigma {
    /// A tenth of a degree: over five frames of a car's rig, 28 depth edges of a scan are 1.15 px off the photo's in the root mean
    /// square, of a focal length of 720 px. 3 cm: ranges of scanners are good to 2 or 3. Half a percent: twice what OpenCV states
    /// of nine views of a chessboard, 0.24 %, in which there is noise alone. 1.5 pixels: it states 1.4 of the center of the same
    /// views.
    fn default() -> Self {
        Self { rotation: 0.1 * DEGREE, place: 0.03, focal: 0.005, center: 1.5 }
    }
}

/// Largest standard deviations with which a pose is trusted, along its weakest axes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
#[must_use]
#[non_exhaustive]
pub struct Limits {
    /// Of the rotation, rad.
    pub rotation: f64,
    /// Of the translation, over the median distance of the regions.
    pub translation: f64,
}

impl Limits {
    /// The same with another limit of the rotation, rad.
    pub fn with_rotation(self, rotation: f64) -> Self {
        Self { rotation, ..self }
    }

    /// The same with another limit of the translation, over the median distance of the regions.
    pub fn with_translation(self, translation: f64) -> Self {
        Self { translation, ..self }
    }
}

impl Default for Limits {
    /// Half a degree, and 2 % of the distance: conventions.
    fn default() -> Self {
        Self { rotation: 0.5 * DEGREE, translation: 0.02 }
    }
}
