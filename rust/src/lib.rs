//! Absolute pose of a central camera from planar regions, without correspondences.
//!
//! A region is seen in the image as closed rings of bearings and known in the world as a planar patch or an
//! open surface. [`Problem`] pairs both sides; [`Problem::estimate`] finds the pose from nothing else, with its covariance,
//! the other poses that fit as well, and warnings. The method is that of Frohlich, Tamas and Kato (IEEE TPAMI 2019);
//! the formulas are derived in the document on its mathematics.
//!
//! Cameras end at bearings: any central camera, up to regions 87 degrees off their own axis, is served by the same code.
//!
//! Poses are `camera_from_world`, increments from the left and `[omega (rad), tau (meters)]`. An input that cannot be used is an
//! [`Error`] that names it; whatever makes a pose doubtful is a [`Warning`] of the [`Estimate`].
//!
//! ```
//! use nalgebra::Vector3;
//! use regionpose::{ObservedRegion, Problem, WorldRegion};
//!
//! // An L-shaped sign in the world (meters), and its corners as a camera 4 m before it sees them.
//! let corners = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)];
//! let sign: Vec<_> = corners.iter().map(|&(x, y)| Vector3::new(x, y, 0.0)).collect();
//! let bearings = sign.iter().map(|x| (x + Vector3::new(-0.2, 0.1, 4.0)).normalize()).collect();
//!
//! let observed = ObservedRegion::new(vec![bearings], 20_000.0); // its area in pixels
//! let world = WorldRegion::from_rings(&[sign])?;
//! let estimate = Problem::new(&[observed], &[world])?.estimate().expect("a pose in view");
//! assert!((estimate.best.pose.translation - Vector3::new(-0.2, 0.1, 4.0)).norm() < 1e-9);
//! # Ok::<(), regionpose::Error>(())
//! ```
//!
//! What is known beforehand, and what else is to be done differently, goes into [`Options`]; [`Problem::with`] takes other
//! integrals. A least squares of one's own runs between [`Problem::search`] and [`Search::judged`].
//!
//! # Features
//!
//! All are on by default.
//! - `alignment`: the pose of a camera by the edges of photos and clouds;
//! - `batch`: many problems on a pool of threads by `in_parallel`;
//! - `mesh`: triangulated regions and outlines of points; without it [`Integration::Mesh`] is refused.
#![forbid(unsafe_code)]

// Hidden modules are for the tests, benchmarks and bindings of this repository; no promise is made of them.
#[cfg(feature = "alignment")]
#[doc(hidden)]
pub mod alignment;
#[cfg(feature = "batch")]
#[doc(hidden)]
pub mod batch;
#[doc(hidden)]
pub mod contour;
#[doc(hidden)]
pub mod effort;
#[doc(hidden)]
pub mod equations;
#[doc(hidden)]
pub mod error;
#[doc(hidden)]
pub mod geometry;
#[doc(hidden)]
pub mod math;
pub mod mesh;
pub mod moments;
#[doc(hidden)]
pub mod options;
#[doc(hidden)]
pub mod prior;
#[doc(hidden)]
pub mod problem;
#[doc(hidden)]
pub mod region;
#[doc(hidden)]
pub mod samples;
#[doc(hidden)]
pub mod search;
#[doc(hidden)]
pub mod verdict;
#[doc(hidden)]
pub mod view;

#[cfg(feature = "batch")]
pub use batch::in_parallel;
pub use contour::creases::Crease;
pub use equations::facet::Integration;
pub use equations::system::System;
pub use error::{Error, Result};
pub use geometry::pose::Pose;
pub use math::gaussian::Gaussian;
pub use options::{FrameSigma, Limits, Options, Refinement, Start};
pub use prior::{PoseSigma, Prior};
pub use problem::Problem;
pub use region::{ObservedRegion, WorldRegion};
pub use search::Search;
pub use verdict::estimate::Estimate;
pub use verdict::solution::Solution;
pub use verdict::warning::Warning;

/// The README's Rust blocks, run as tests.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;
