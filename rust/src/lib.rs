//! Absolute pose of a central camera from planar regions, without correspondences.
//!
//! A region is closed rings of bearings in the image and a planar patch or an open surface in the world. [`Problem`] pairs
//! both sides; [`Problem::estimate`] returns the pose, without an initial one, with its covariance, alternatives that fit as
//! well, and warnings. The method is that of Frohlich, Tamas and Kato (IEEE TPAMI 2019);
//! the formulas are derived in the document on its mathematics.
//!
//! Cameras end at bearings: any central camera, up to regions 87 degrees off their own axis, is served by the same code.
//!
//! Poses are `camera_from_world`, increments from the left and `[omega (rad), tau (meters)]`. An input that cannot be used is an
//! [`Error`] that names it; whatever makes a pose doubtful is a [`Warning`] of the [`Estimate`].
//!
//! ```
//! use regionpose::nalgebra::Vector3;
//! use regionpose::{ObservedRegion, Problem, WorldRegion};
//!
//! // An L-shaped sign in the world (meters), and its corners as a camera 4 m before it sees them.
//! let corners = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)];
//! let sign: Vec<_> = corners.iter().map(|&(x, y)| Vector3::new(x, y, 0.0)).collect();
//! let bearings = sign.iter().map(|x| (x + Vector3::new(-0.2, 0.1, 4.0)).normalize()).collect();
//!
//! let observed = ObservedRegion::new(vec![bearings], 20_000.0); // its area in pixels
//! let world = WorldRegion::from_rings(&[sign])?;
//! let estimate = Problem::new(&[observed], &[world])?.estimate()?;
//! assert!((estimate.best.pose.translation - Vector3::new(-0.2, 0.1, 4.0)).norm() < 1e-9);
//! # Ok::<(), regionpose::Error>(())
//! ```
//!
//! [`Options`] have a prior and the settings of the search; [`Problem::with`] takes other integrals. Another least-squares
//! solver runs between [`Problem::search`] and [`Search::assess`].
//!
//! # Features
//!
//! All but `serde` are on by default.
//! - `alignment`: the pose of a camera by the edges of photos and clouds;
//! - `batch`: many problems on a pool of threads by `in_parallel`;
//! - `mesh`: triangulated regions and outlines of points; without it [`Integration::Mesh`] is refused;
//! - `serde`: [`Pose`], [`Prior`], [`Options`], [`Estimate`] and [`Warning`] are serialized; poses and priors are checked
//!   where they are read, and options for unknown fields. An estimate may have deviations that are infinite or not a number, which
//!   JSON has no form for.
#![forbid(unsafe_code)]

#[cfg(feature = "alignment")]
mod alignment;
#[cfg(feature = "batch")]
mod batch;
mod budget;
mod contour;
mod equations;
mod error;
mod geometry;
mod math;
pub mod mesh;
pub mod moments;
mod noise;
mod options;
mod prior;
mod problem;
mod region;
mod samples;
mod search;
mod verdict;
mod view;

#[cfg(feature = "batch")]
pub use batch::in_parallel;
pub use contour::creases::Crease;
pub use contour::fit::ContourFit;
pub use contour::mixture::Mixture;
pub use equations::facet::Integration;
pub use equations::least_squares::{Minimum, Termination};
pub use equations::residual::Evaluation;
pub use equations::system::{System, Weighting};
pub use error::{Contact, Error, Result};
pub use geometry::pose::{Pose, Tangent};
pub use geometry::rings::PlaneRings;
pub use math::gaussian::Gaussian;
pub use nalgebra;
pub use options::{FrameSigma, Limits, Options, Refinement, Start};
pub use prior::{InitialDeviation, PlaceDeviation, PoseSigma, Prior, UpDeviation};
pub use problem::Problem;
pub use region::samples::Samples;
pub use region::{ObservedRegion, Pixels, PlaneFrame, Surface, WorldRegion};
pub use samples::label_model::NoiseLevels;
pub use samples::posterior::Posterior;
pub use search::Search;
pub use verdict::confidence::Evidence;
pub use verdict::estimate::Estimate;
pub use verdict::solution::Solution;
pub use verdict::warning::{Cause, RelativePose, Warning};

/// Internal interface for tests, benchmarks and bindings of this repository, without stability.
#[doc(hidden)]
pub mod internals {
    #[cfg(feature = "alignment")]
    pub mod alignment {
        pub use crate::alignment::*;
    }
    #[cfg(feature = "batch")]
    pub mod batch {
        pub use crate::batch::*;
    }
    pub mod contour {
        pub use crate::contour::*;
    }
    pub mod budget {
        pub use crate::budget::*;
    }
    pub mod equations {
        pub use crate::equations::*;
    }
    pub mod error {
        pub use crate::error::*;
    }
    pub mod geometry {
        pub use crate::geometry::*;
    }
    pub mod math {
        pub use crate::math::*;
    }
    #[cfg(feature = "mesh")]
    pub mod mesh {
        pub use crate::mesh::spacing::{bridging_gap, even_spacing};
    }
    pub mod options {
        pub use crate::options::*;
    }
    pub mod prior {
        pub use crate::prior::*;
    }
    pub mod problem {
        pub use crate::problem::*;
    }
    pub mod region {
        pub use crate::region::*;
    }
    pub mod samples {
        pub use crate::samples::*;
    }
    pub mod search {
        pub use crate::search::*;
    }
    pub mod verdict {
        pub use crate::verdict::*;
    }
    pub mod view {
        pub use crate::view::*;
    }
}

/// The README's Rust blocks, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
