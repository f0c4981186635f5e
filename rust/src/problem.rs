//! A pose problem: pairs of observed and world regions, with their equations, contours and samples.

use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;

use crate::budget::Budget;
use crate::contour::creases::{Crease, creases};
use crate::contour::readings::Contour;
use crate::equations::facet::Integration;
use crate::equations::residual::{Evaluation, RegionEquations, evaluate};
use crate::equations::system::{System, Weighting};
use crate::equations::whitening::Orders;
use crate::error::{Error, Result};
use crate::geometry::pose::{PARAMETERS, Pose, Tangent, increment_derivative};
use crate::noise::boundary::CALIBRATION;
use crate::region::{ObservedRegion, WorldRegion};
use crate::samples::ep;
use crate::samples::margin::SampledRegion;

/// Work budget of a search, its least squares and its verdict each, in evaluations of all of the problem: more than problems of the
/// studies `trust` and `mistakes` take altogether, up to 1,987 (`_core.work_counter`, `_core.Problem.work`).
pub const MAX_EVALUATIONS: u64 = 2_500;

/// Pairs of regions, observed in one image and given in the world, ready to be solved.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::{ObservedRegion, Problem, WorldRegion};
/// # let corners = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)];
/// # let sign: Vec<_> = corners.iter().map(|&(x, y)| Vector3::new(x, y, 0.7 * y)).collect();
/// # let bearings = sign.iter().map(|x| (x + Vector3::new(-0.2, 0.1, 4.0)).normalize()).collect();
/// # let observed = [ObservedRegion::new(vec![bearings], 20_000.0)];
/// # let worlds = [WorldRegion::from_rings(&[sign])?];
/// let problem = Problem::new(&observed, &worlds)?;
/// let estimate = problem.estimate()?;
/// println!("{:?}, covariance {}", estimate.best.pose, estimate.best.covariance);
/// estimate.warnings.iter().for_each(|warning| println!("{}: {warning:?}", warning.code()));
/// assert!(estimate.alternatives.is_empty() && estimate.warnings.is_empty());
/// # Ok::<(), regionpose::Error>(())
/// ```
#[derive(Debug, Clone)]
#[must_use]
pub struct Problem {
    /// World coordinates are taken relative to this point, so that large ones lose no digits.
    origin: Vector3<f64>,
    regions: Vec<RegionEquations>,
    worlds: Arc<[WorldRegion]>,
    contours: Arc<[Contour]>,
    sampled: Arc<[SampledRegion]>,
    /// Computed on demand.
    coarse: OnceLock<Arc<[RegionEquations]>>,
    creases: OnceLock<Arc<[Crease]>>,
}

impl Problem {
    /// The problem of these regions, the k-th observed one being the image of the k-th world one, by moments on each region's
    /// plane, summed over the boundary.
    ///
    /// # Errors
    /// No regions, unequal numbers, or a region that is refused; the message names it.
    pub fn new(observed: &[ObservedRegion], worlds: &[WorldRegion]) -> Result<Self> {
        Self::with(observed, worlds, System::Plane, Integration::Boundary)
    }

    /// The same with the moments of another system, or summed otherwise.
    ///
    /// ```
    /// # use nalgebra::Vector3;
    /// # use regionpose::{Integration, ObservedRegion, Problem, System, WorldRegion};
    /// # let sign = [(0.0, 0.0), (0.6, 0.1), (0.3, 1.0)].map(|(x, y)| Vector3::new(x, y, 0.0)).to_vec();
    /// # let observed = [ObservedRegion::new(vec![sign.iter().map(|x| x + Vector3::z() * 4.0).collect()], 20_000.0)];
    /// # let worlds = [WorldRegion::from_rings(&[sign])?];
    /// // Moments of solid angle: the measure of a camera with a wide field.
    /// let problem = Problem::with(&observed, &worlds, System::Sphere, Integration::Boundary)?;
    /// assert!(problem.estimate().is_ok());
    /// # Ok::<(), regionpose::Error>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Problem::new`], and an integration that the system or a region does not have.
    pub fn with(
        observed: &[ObservedRegion],
        worlds: &[WorldRegion],
        system: System,
        integration: Integration,
    ) -> Result<Self> {
        Self::new_within(observed, worlds, system, integration, &Budget::unlimited())
    }

    /// The same within a budget.
    #[doc(hidden)]
    pub fn new_within(
        observed: &[ObservedRegion],
        worlds: &[WorldRegion],
        system: System,
        integration: Integration,
        budget: &Budget,
    ) -> Result<Self> {
        if observed.len() != worlds.len() || observed.is_empty() {
            return Err(Error::Unpaired { observed: observed.len(), world: worlds.len() });
        }
        let origin = worlds.iter().map(|world| world.frame().origin).sum::<Vector3<f64>>() / worlds.len() as f64;
        let pairs = observed.iter().zip(worlds).enumerate();
        let regions: Vec<RegionEquations> = pairs
            .map(|(index, (observed, world))| {
                RegionEquations::new(observed, world, &origin, system, integration, budget)
                    .map_err(|e| e.in_region(index))
            })
            .collect::<Result<_>>()?;
        let contours = Contour::all(&regions, worlds, &origin).into();
        let pairs = regions.iter().zip(worlds).enumerate();
        let sampled = pairs.filter_map(|(index, (region, world))| SampledRegion::new(index, region, world, &origin));
        let (coarse, creases) = (OnceLock::new(), OnceLock::new());
        Ok(Self { sampled: sampled.collect(), origin, contours, worlds: worlds.into(), regions, coarse, creases })
    }

    /// The equations of each region.
    #[doc(hidden)]
    pub fn regions(&self) -> &[RegionEquations] {
        &self.regions
    }

    /// The same with the world sides by fewer vertices, for coarse evaluations.
    pub(crate) fn coarse(&self, budget: &Budget) -> &[RegionEquations] {
        let pairs = || self.regions.iter().zip(self.worlds.iter());
        self.coarse.get_or_init(|| pairs().map(|(region, world)| region.coarse(world, &self.origin, budget)).collect())
    }

    /// The same with integrals of planes along their boundaries, where any is over a mesh: a search takes thousands of evaluations,
    /// and its result does not depend on the integration.
    pub(crate) fn by_boundary(&self) -> Option<Self> {
        let pairs = || self.regions.iter().zip(self.worlds.iter());
        let regions = || pairs().map(|(region, world)| region.by_boundary(world, &self.origin)).collect();
        pairs().any(|(region, world)| region.is_mesh(world)).then(|| Self { regions: regions(), ..self.clone() })
    }

    /// The same with the integrals of another problem of the same regions.
    pub(crate) fn integrated_as(&self, other: &Self) -> Self {
        let pairs = self.regions.iter().zip(&other.regions);
        Self { regions: pairs.map(|(region, other)| region.integrated_as(other)).collect(), ..self.clone() }
    }

    /// The world side of each region.
    pub fn worlds(&self) -> &[WorldRegion] {
        &self.worlds
    }

    /// The observed contour of each region and the boundary of its world region, about the problem's origin.
    #[doc(hidden)]
    pub fn contours(&self) -> &[Contour] {
        &self.contours
    }

    /// Stride between pieces in coarse evaluations.
    pub(crate) fn coarse_stride(&self) -> usize {
        self.contours[0].coarse_stride()
    }

    /// The regions whose world side has samples, which count in place of its outline.
    #[doc(hidden)]
    pub fn sampled(&self) -> &[SampledRegion] {
        &self.sampled
    }

    /// The same with the samples of some of these regions alone; the others have their outlines alone.
    pub(crate) fn with_sampled(&self, kept: &[bool]) -> Self {
        let numbers = self.sampled.iter().zip(kept).filter(|(_, kept)| **kept).map(|(sampled, _)| sampled.index());
        let rebuilt = |index: usize| SampledRegion::new(index, &self.regions[index], &self.worlds[index], &self.origin);
        Self { sampled: numbers.filter_map(rebuilt).collect(), ..self.clone() }
    }

    /// The straight edges that two regions share, as far as their outlines and planes show any.
    #[doc(hidden)]
    pub fn creases(&self, budget: &Budget) -> &[Crease] {
        self.creases.get_or_init(|| creases(&self.regions, &self.worlds, &self.origin, budget).into())
    }

    /// The part of a crease's line in the world that a pose shows between the ends of the edge, `camera_from_world`.
    #[doc(hidden)]
    pub fn crease_segment(&self, crease: &Crease, pose: &Pose) -> [Vector3<f64>; 2] {
        crease.segment(&self.centered(pose)).map(|place| place + self.origin)
    }

    /// Cost of one evaluation of all of the problem, in edge evaluations: its moments, the pieces of its contours, its samples.
    #[doc(hidden)]
    pub fn work(&self) -> u64 {
        let regions =
            self.regions.iter().zip(self.contours.iter()).map(|(region, contour)| region.work() + contour.work());
        (regions.sum::<usize>() + self.sampled.iter().map(ep::work).sum::<usize>()) as u64
    }

    /// The work budget of a search.
    pub(crate) fn most_work(&self) -> u64 {
        MAX_EVALUATIONS * self.work()
    }

    /// The point relative to which world coordinates are taken.
    pub(crate) fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// The same problem, its moments compared on the scale of a boundary noise in pixels.
    pub(crate) fn whitened(&self, noise: f64, orders: Orders) -> Self {
        let regions = self.regions.iter().map(|region| region.whitened_for(noise, orders)).collect();
        Self { regions, ..self.clone() }
    }

    /// Residuals and derivatives at `camera_from_world`; `None` where a region is out of view.
    pub fn evaluate(&self, pose: &Pose, weighting: Weighting) -> Option<Evaluation> {
        evaluate(&self.regions, &self.centered(pose), weighting, &Budget::unlimited())
    }

    /// Residuals at a pose moved by a left increment, and their derivatives by that increment.
    pub fn evaluate_moved(&self, pose: &Pose, increment: &Tangent, weighting: Weighting) -> Option<Evaluation> {
        let evaluation = self.evaluate(&pose.retract(increment), weighting)?;
        Some(Evaluation { jacobian: evaluation.jacobian * increment_derivative(increment), ..evaluation })
    }

    /// Estimated variance of the boundary's noise from a whitened cost, squared pixels (`docs/math.md`, eq. 10.2).
    #[doc(hidden)]
    pub fn noise_variance(&self, cost: f64) -> f64 {
        (cost / self.degrees_of_freedom()).max(CALIBRATION * CALIBRATION)
    }

    /// Deviance of a whitened cost to another, in variances, with at most so many degrees of freedom of the noise (`numbers`;
    /// `docs/math.md`, eq. 10.3).
    #[doc(hidden)]
    pub fn worse_by_moments(&self, cost: f64, other: f64, numbers: f64) -> f64 {
        let numbers = self.degrees_of_freedom().min(numbers);
        numbers * (self.noise_variance(cost) / self.noise_variance(other)).ln()
    }

    /// Residual degrees of freedom of the whitened equations.
    fn degrees_of_freedom(&self) -> f64 {
        let count: usize = self.regions.iter().map(|region| region.count(Weighting::Whitened)).sum();
        count.saturating_sub(PARAMETERS).max(1) as f64
    }

    /// The regions that a pose sees from the side opposite to their viewpoint.
    pub fn seen_from_behind(&self, pose: &Pose) -> Vec<usize> {
        let camera = pose.inverse().translation;
        let behind = |(index, world): (usize, &WorldRegion)| world.is_behind(&camera).then_some(index);
        self.worlds.iter().enumerate().filter_map(behind).collect()
    }

    /// Median distance of the regions from the camera.
    pub fn distance(&self, pose: &Pose) -> f64 {
        let distance = |world: &WorldRegion| pose.transform(&world.frame().origin).norm();
        let mut distances: Vec<f64> = self.worlds.iter().map(distance).collect();
        distances.sort_by(f64::total_cmp);
        let (below, above) = (distances[(distances.len() - 1) / 2], distances[distances.len() / 2]);
        0.5 * (below + above)
    }

    /// Angle of a pixel where the regions are seen, rad: the root of its mean square over them.
    pub fn pixel_angle(&self) -> f64 {
        let squares = self.regions.iter().map(|region| region.pixels_per_radian().powi(-2));
        (squares.sum::<f64>() / self.regions.len() as f64).sqrt()
    }

    /// The pose for world points about the problem's origin.
    #[doc(hidden)]
    pub fn centered(&self, pose: &Pose) -> Pose {
        Pose::new(pose.rotation, pose.transform(&self.origin))
    }

    /// The pose for world points, of one for points about the problem's origin.
    pub(crate) fn uncentered(&self, pose: &Pose) -> Pose {
        Pose::new(pose.rotation, pose.translation - pose.rotation * self.origin)
    }
}
