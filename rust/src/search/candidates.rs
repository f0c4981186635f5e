//! From region pairs to the minima of their equations.

use nalgebra::{Matrix6, Vector3};

use crate::contour::distance::{Contour, contour_distances};
use crate::equations::facet::Integration;
use crate::equations::least_squares::{Minimum, Stopping, minimize};
use crate::equations::residual::{Evaluation, RegionEquations, evaluate};
use crate::equations::system::{System, Weighting};
use crate::equations::whitening::Orders;
use crate::error::{Error, Result};
use crate::geometry::pose::{Pose, Tangent, increment_derivative};
use crate::prior::{BELIEVED, Prior};
use crate::region::{ObservedRegion, WorldRegion};
use crate::search::closed_form::{WantedTurns, closed_form, conjugate, facing};
use crate::search::corners::triangle_poses;
use crate::search::fit::Fit;
use crate::view::border::cut_worlds;

/// A candidate of one region: enough to tell it from the others, not yet a solution.
const SINGLE_REGION: Stopping = Stopping { tolerance: 1e-3, evaluations: 14 };

/// A candidate of all regions together.
const JOINT: Stopping = Stopping { tolerance: 1e-3, evaluations: 21 };

/// The paper's start is followed all the way down, from wherever it lies.
const PAPER: Stopping = Stopping { tolerance: 1e-6, evaluations: 210 };

/// A candidate on the whitened scale, where it can be seen whether it fits.
const COARSE: Stopping = Stopping { tolerance: 1e-4, evaluations: 14 };

/// A candidate stays while its coarse cost is within this factor of what would count as fitting.
const COARSE_AMBIGUITY: f64 = 4.0;

/// Candidates above the least unweighted cost by this factor are given up.
const WORTH_A_LOOK: f64 = 1e3;

/// Unweighted cost (squared shares of the observed area) below which every candidate is looked at: a hundredth of the area.
const SMALL_COST: f64 = 1e-4;

/// A final solution: the last step is far shorter than the 1e-7 within which both drivers end.
const FINAL: Stopping = Stopping { tolerance: 1e-11, evaluations: 140 };

/// Candidates of one region whose cost is above this share of the squared observed area are no view of it: the area
/// of the symmetric difference is then of the order of the region itself.
const SINGLE_REGION_COST: f64 = 0.05;

/// Overlap error above which the search takes a second look, from every turn.
const SECOND_LOOK: f64 = 0.02;

/// Boundary noise, in pixels, up to which outlines count as clean: a binary mask's is uniform over a pixel, 0.29.
const CLEAN: f64 = 0.5;

/// Share of the overlap error to which all moments have to bring it down to be preferred to those of low order.
const MUCH_BETTER: f64 = 0.8;

/// Starts of one region that are followed where other regions can tell them apart; the second look follows all.
const STARTS_PER_REGION: usize = 4;

/// Starts of a region that the image's border cuts, of all the cuts that are tried.
const STARTS_OF_CUT: usize = 48;

/// Candidates carried into the joint system at most.
const MOST_CANDIDATES: usize = 32;

/// Poses nearer than this are one candidate: radians, and a share of the distance to the regions.
const SAME_CANDIDATE: f64 = 0.01;

/// Poses nearer than this are one minimum.
const SAME_MINIMUM: f64 = 1e-4;

/// Noise of the boundary, in pixels, below which the fit is not taken at its word: the quantization of a binary mask, and
/// the quality of calibrations.
const NOISE_FLOOR: f64 = 0.1;

/// Another pose fits as well when its cost is above the best by less than this many variances of the noise: five standard
/// deviations.
pub(crate) const AMBIGUITY_COST: f64 = 25.0;

/// Where the search starts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// From the closed form of every region, without any prior (`docs/math.md`, section 7).
    #[default]
    Global,
    /// From the paper's start for the first region, solved alone, then all together (paper section 2.1.1 and 2.2.1).
    Paper,
}

/// What a search found: where to solve from, best first, and the problem on the scale of the noise that was found.
#[derive(Debug, Clone)]
pub struct Search {
    /// The problem, whitened for the boundary noise of its best candidate.
    pub problem: Problem,
    /// Distinct poses near minima of the whitened equations, none so much worse than the best that it could not fit.
    pub candidates: Vec<Pose>,
}

impl Search {
    /// Overlap error of the best candidate, infinite without one.
    fn overlap_error(&self) -> f64 {
        let Problem { regions, worlds, .. } = &self.problem;
        let fit = self.candidates.first().and_then(|pose| Fit::of(regions, worlds, pose));
        fit.map_or(f64::INFINITY, |fit| fit.overlap_error)
    }
}

/// Regions seen in one image and known in the world, ready to be solved.
#[derive(Debug, Clone)]
pub struct Problem {
    /// World coordinates are taken relative to this point, so that large ones lose no digits.
    origin: Vector3<f64>,
    regions: Vec<RegionEquations>,
    worlds: Vec<WorldRegion>,
}

impl Problem {
    /// The problem of these regions, the k-th observed one being the image of the k-th world one.
    ///
    /// # Errors
    /// No regions, unequal numbers, or a region that is refused; the message names it.
    pub fn new(
        observed: &[ObservedRegion],
        worlds: Vec<WorldRegion>,
        system: System,
        integration: Integration,
    ) -> Result<Self> {
        if observed.len() != worlds.len() || observed.is_empty() {
            return Err(Error::Unpaired { observed: observed.len(), world: worlds.len() });
        }
        let origin = worlds.iter().map(|world| world.frame().origin).sum::<Vector3<f64>>() / worlds.len() as f64;
        let pairs = observed.iter().zip(&worlds).enumerate();
        let regions = pairs
            .map(|(index, (observed, world))| {
                RegionEquations::new(observed, world, &origin, system, integration).map_err(|e| e.in_region(index))
            })
            .collect::<Result<_>>()?;
        Ok(Self { origin, regions, worlds })
    }

    /// The equations of each region.
    pub fn regions(&self) -> &[RegionEquations] {
        &self.regions
    }

    /// The world side of each region.
    pub fn worlds(&self) -> &[WorldRegion] {
        &self.worlds
    }

    /// Residuals and derivatives at `camera_from_world`; `None` where a region is out of view.
    pub fn evaluate(&self, pose: &Pose, weighting: Weighting) -> Option<Evaluation> {
        evaluate(&self.regions, &self.centred(pose), weighting)
    }

    /// Residuals at a pose moved by a left increment, and their derivatives by that increment.
    pub fn evaluate_moved(&self, pose: &Pose, increment: &Tangent, weighting: Weighting) -> Option<Evaluation> {
        let evaluation = self.evaluate(&pose.moved(increment), weighting)?;
        Some(Evaluation { jacobian: evaluation.jacobian * increment_derivative(increment), ..evaluation })
    }

    /// The candidates for the pose, and this problem whitened for the boundary noise that the best of them shows.
    ///
    /// Where the outlines are not clean, moments of low order are safer; all are kept if their best candidate covers the
    /// observed regions much better, as it does where only high orders tell the turns of a symmetric shape apart.
    pub fn search(self, start: Start, prior: &Prior) -> Search {
        let mut poses = match start {
            Start::Global => self.solved_together(self.global_starts(prior, WantedTurns::Likely)),
            Start::Paper => self.solved_together(self.paper_starts(prior)),
        };
        let mut fit = self.fit_of_best(&poses);
        if start == Start::Global && fit.is_none_or(|fit| fit.overlap_error > SECOND_LOOK) {
            poses = self.solved_together(self.global_starts(prior, WantedTurns::All));
            fit = self.fit_of_best(&poses);
        }
        let (noise, penalty) = (fit.map_or(0.0, |fit| fit.boundary_noise), self.most_penalty(prior));
        let all = self.clone().whitened(noise, Orders::All).searched(&poses, penalty);
        if fit.is_none_or(|fit| fit.boundary_noise < CLEAN) {
            return all;
        }
        let low = self.whitened(noise, Orders::Low).searched(&poses, penalty);
        if all.overlap_error() < MUCH_BETTER * low.overlap_error() { all } else { low }
    }

    fn whitened(self, noise: f64, orders: Orders) -> Self {
        let regions = self.regions.into_iter().map(|region| region.whitened_for(noise, orders)).collect();
        Self { regions, ..self }
    }

    fn searched(self, poses: &[Pose], penalty: f64) -> Search {
        Search { candidates: self.fitting(poses, penalty), problem: self }
    }

    /// Minima of all regions' unweighted equations near the starts, best first.
    fn solved_together(&self, starts: Vec<Pose>) -> Vec<Pose> {
        let poses = self.narrowed(starts);
        if self.regions.len() == 1 {
            return poses;
        }
        let joint = |pose: &Pose| minimize(&self.regions, pose, Weighting::Uniform, JOINT).pose;
        self.narrowed(poses.iter().map(joint).collect())
    }

    fn fit_of_best(&self, poses: &[Pose]) -> Option<Fit> {
        Fit::of(&self.regions, &self.worlds, &self.uncentred(poses.first()?))
    }

    /// The candidates that could fit as well as the best once the whitened equations are solved, best first; with a prior
    /// that may count for so many variances.
    fn fitting(&self, poses: &[Pose], penalty: f64) -> Vec<Pose> {
        let minima = poses.iter().map(|pose| minimize(&self.regions, pose, Weighting::Whitened, COARSE)).collect();
        let minima = distinct(minima, SAME_CANDIDATE);
        let least = minima.first().map_or(0.0, |minimum| minimum.cost);
        let limit = COARSE_AMBIGUITY * self.ambiguity_limit(least, penalty);
        minima.into_iter().filter(|m| m.cost <= limit).map(|m| self.uncentred(&m.pose)).collect()
    }

    /// The minimum of the whitened equations that is reached from a candidate, `camera_from_world`.
    pub fn solve_from(&self, candidate: &Pose) -> Minimum {
        let minimum = minimize(&self.regions, &self.centred(candidate), Weighting::Whitened, FINAL);
        Minimum { pose: self.uncentred(&minimum.pose), ..minimum }
    }

    /// Distinct minima of the whitened equations, best first.
    pub fn minima(&self, candidates: &[Pose]) -> Vec<Minimum> {
        self.distinct(candidates.iter().map(|candidate| self.solve_from(candidate)).collect())
    }

    /// Minima sorted by cost, each pose once.
    pub fn distinct(&self, minima: Vec<Minimum>) -> Vec<Minimum> {
        let centred = minima.into_iter().map(|m| Minimum { pose: self.centred(&m.pose), ..m }).collect();
        let kept = distinct(centred, SAME_MINIMUM);
        kept.into_iter().map(|m| Minimum { pose: self.uncentred(&m.pose), ..m }).collect()
    }

    /// The whitened cost up to which a pose fits as well as the best, whose cost is `least`, or could with a prior that
    /// counts for at most `prior` variances.
    pub fn ambiguity_limit(&self, least: f64, prior: f64) -> f64 {
        least + (AMBIGUITY_COST + prior) * self.boundary_noise(least).powi(2)
    }

    /// The regions that a pose sees from the side away from their viewpoint.
    pub fn seen_from_behind(&self, pose: &Pose) -> Vec<usize> {
        let camera = pose.inverse().translation;
        let behind = |(index, world): (usize, &WorldRegion)| world.is_behind(&camera).then_some(index);
        self.worlds.iter().enumerate().filter_map(behind).collect()
    }

    /// What a prior and the regions' visible sides count against a pose with this covariance, in variances.
    pub(crate) fn penalty(&self, pose: &Pose, covariance: &Matrix6<f64>, prior: &Prior) -> f64 {
        prior.penalty(pose, covariance) + BELIEVED * self.seen_from_behind(pose).len() as f64
    }

    /// The most that a prior and the regions' visible sides count against a pose, in variances.
    pub(crate) fn most_penalty(&self, prior: &Prior) -> f64 {
        let sides = self.worlds.iter().filter(|world| world.viewpoint().is_some()).count();
        prior.most() + BELIEVED * sides as f64
    }

    /// Standard deviation of the boundary's noise, from the whitened cost and the equations left over.
    pub fn boundary_noise(&self, cost: f64) -> f64 {
        let count: usize =
            self.regions().iter().map(|region: &RegionEquations| region.count(Weighting::Whitened)).sum();
        let left = count.saturating_sub(6).max(1) as f64;
        (cost / left).sqrt().max(NOISE_FLOOR)
    }

    /// Distance from the camera to the middle of the regions.
    pub fn distance(&self, pose: &Pose) -> f64 {
        pose.transform(&self.origin).norm()
    }

    fn global_starts(&self, prior: &Prior, turns: WantedTurns) -> Vec<Pose> {
        let mut starts: Vec<Pose> = prior.initial.iter().map(|pose| self.centred(pose)).collect();
        for (region, world) in self.regions.iter().zip(&self.worlds) {
            let mut poses = closed_form(region.chart(), region.outline(), world, &self.origin, turns);
            let pixel = region.pixel_area().sqrt().recip();
            poses.extend(triangle_poses(region.chart(), region.outline(), world, &self.origin, pixel));
            if prior.up.is_some() {
                poses.extend(facing(region.chart(), region.outline(), world, &self.origin, prior.up.as_ref()));
            }
            // A wrong view of a region alone may look right where the rest of it is cut off.
            if region.border().is_some() && (turns == WantedTurns::All || self.regions.len() == 1) {
                poses.extend(self.cut_starts(region, world));
            }
            if turns == WantedTurns::Likely && self.regions.len() > 1 {
                poses = self.best_together(poses);
            }
            starts.extend(poses.iter().filter_map(|pose| single_region(region, pose)));
        }
        starts
    }

    /// The starts of a region that the image's border cuts, at which the cut prediction fits best: those of its world region
    /// cut by lines from all sides.
    fn cut_starts(&self, region: &RegionEquations, world: &WorldRegion) -> Vec<Pose> {
        let closed =
            |cut: &WorldRegion| closed_form(region.chart(), region.outline(), cut, &self.origin, WantedTurns::Likely);
        let poses = cut_worlds(world).iter().flat_map(closed).collect();
        best_fitting(std::slice::from_ref(region), poses, STARTS_OF_CUT)
    }

    /// Poses of single regions, about the problem's origin, whatever the others say.
    pub(crate) fn single_region_poses(&self) -> Vec<Pose> {
        self.global_starts(&Prior::default(), WantedTurns::All)
    }

    /// The starts of one region at which the others fit best, those out of view last.
    fn best_together(&self, poses: Vec<Pose>) -> Vec<Pose> {
        best_fitting(&self.regions, poses, STARTS_PER_REGION)
    }

    fn paper_starts(&self, prior: &Prior) -> Vec<Pose> {
        if let Some(initial) = &prior.initial {
            return vec![minimize(&self.regions, &self.centred(initial), Weighting::Uniform, PAPER).pose];
        }
        let (first, world) = (&self.regions[..1], &self.worlds[0]);
        let solved = |pose: &Pose| minimize(first, pose, Weighting::Uniform, PAPER).pose;
        facing(first[0].chart(), first[0].outline(), world, &self.origin, prior.up.as_ref())
            .iter()
            .map(solved)
            .flat_map(|pose| [pose, solved(&conjugate(&pose, world, &self.origin))])
            .collect()
    }

    /// Distinct poses by their joint unweighted cost, best first, as many as are worth another look.
    fn narrowed(&self, poses: Vec<Pose>) -> Vec<Pose> {
        let cost = |pose: Pose| {
            let evaluation = evaluate(&self.regions, &pose, Weighting::Uniform)?;
            Some((pose, evaluation.residual.norm_squared()))
        };
        let mut costs: Vec<(Pose, f64)> = poses.into_iter().filter_map(cost).collect();
        costs.sort_by(|a, b| a.1.total_cmp(&b.1));
        let limit = costs.first().map_or(0.0, |(_, least)| least * WORTH_A_LOOK + SMALL_COST);
        let mut kept: Vec<Pose> = Vec::new();
        for (pose, cost) in costs {
            if cost <= limit
                && kept.len() < MOST_CANDIDATES
                && kept.iter().all(|other| apart(other, &pose, SAME_CANDIDATE))
            {
                kept.push(pose);
            }
        }
        kept
    }

    /// Signed distances, in pixels, of the contours' pieces from the projected boundaries, and their derivatives by the left
    /// increment; `None` where a region is out of view. A piece nearest to a vertex has its distance from there, unsigned.
    pub fn contour_distances(&self, pose: &Pose) -> Option<Evaluation> {
        contour_distances(&self.contours(), &self.centred(pose))
    }

    /// The contours of the regions, about the problem's origin.
    pub(crate) fn contours(&self) -> Vec<Contour> {
        self.regions.iter().zip(&self.worlds).map(|(region, world)| Contour::new(region, world, &self.origin)).collect()
    }

    /// The point relative to which world coordinates are taken.
    pub(crate) fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// The pose for world points about the problem's origin.
    pub(crate) fn centred(&self, pose: &Pose) -> Pose {
        Pose::new(pose.rotation, pose.transform(&self.origin))
    }

    /// The pose for world points, of one for points about the problem's origin.
    pub(crate) fn uncentred(&self, pose: &Pose) -> Pose {
        Pose::new(pose.rotation, pose.translation - pose.rotation * self.origin)
    }
}

/// Minima sorted by cost, each pose once.
fn distinct(mut minima: Vec<Minimum>, limit: f64) -> Vec<Minimum> {
    minima.retain(|minimum| minimum.cost.is_finite());
    minima.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<Minimum> = Vec::new();
    for minimum in minima {
        if kept.iter().all(|other| apart(&other.pose, &minimum.pose, limit)) {
            kept.push(minimum);
        }
    }
    kept
}

impl Problem {
    /// Whether two poses differ by more than `limit`: radians, or that share of the distance.
    pub(crate) fn apart(&self, a: &Pose, b: &Pose, limit: f64) -> bool {
        apart(&self.centred(a), &self.centred(b), limit)
    }
}

/// Whether two poses of the centred world differ by more than `limit`: radians, or that share of the distance.
pub(crate) fn apart(a: &Pose, b: &Pose, limit: f64) -> bool {
    a.angle_to(b) > limit || (a.translation - b.translation).norm() > limit * a.translation.norm()
}

/// The poses at which the regions' unweighted equations fit best, those out of view last.
fn best_fitting(regions: &[RegionEquations], poses: Vec<Pose>, most: usize) -> Vec<Pose> {
    let cost = |pose: &Pose| {
        let evaluation = evaluate(regions, pose, Weighting::Uniform);
        evaluation.map_or(f64::INFINITY, |evaluation| evaluation.residual.norm_squared())
    };
    let mut costs: Vec<(f64, Pose)> = poses.into_iter().map(|pose| (cost(&pose), pose)).collect();
    costs.sort_by(|a, b| a.0.total_cmp(&b.0));
    costs.into_iter().take(most).map(|(_, pose)| pose).collect()
}

/// The minimum of one region's unweighted equations near a candidate, if it looks like the region.
fn single_region(region: &RegionEquations, pose: &Pose) -> Option<Pose> {
    let region = std::slice::from_ref(region);
    evaluate(region, pose, Weighting::Uniform)?;
    let minimum = minimize(region, pose, Weighting::Uniform, SINGLE_REGION);
    (minimum.cost < SINGLE_REGION_COST).then_some(minimum.pose)
}
