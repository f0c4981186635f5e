//! Multi-start least squares on the moments, from closed forms of each region.

use std::collections::BTreeMap;

use super::closed_form::{closed_form, conjugate, facing};
use super::corners::triangle_poses;
use super::poses::{SAME, distinct, sorted};
use crate::budget::Budget;
use crate::equations::least_squares::{TerminationCriteria, minimize};
use crate::equations::residual::{self, RegionEquations};
use crate::equations::system::Weighting;
use crate::geometry::pose::Pose;
use crate::prior::Prior;
use crate::problem::Problem;
use crate::region::WorldRegion;
use crate::search::cuts::cut_worlds;

/// Termination of candidates: precise enough to distinguish them, whose valleys are flat where shapes are symmetric; not yet solutions.
pub const CANDIDATE: TerminationCriteria = TerminationCriteria { tolerance: 1e-4, evaluations: 28 };

/// A final solution: the last step is far shorter than the 1e-7 within which both drivers end. The paper's start needs as many,
/// from wherever it lies.
pub const FINAL: TerminationCriteria = TerminationCriteria { tolerance: 1e-11, evaluations: 210 };

/// Candidates above the least unweighted cost by this factor are given up: a convention.
const MAX_COST_RATIO: f64 = 1e2;

/// Unweighted cost (squared shares of the observed area) below which every candidate is refined: a hundredth of the area.
const SMALL_COST: f64 = 1e-4;

/// Starts of one region that are followed where other regions distinguish them, and turns at a prior's place: a convention, two
/// turns seen from two sides.
pub const STARTS_PER_REGION: usize = 4;

/// Starts of a region that the image's border cuts, of all the cuts that are tried: a convention.
const STARTS_OF_CUT: usize = 48;

/// Candidates whose equations are solved, and turns of a plane, at most: those of an eightfold symmetry, from before and from
/// behind, twice.
pub const MOST_CANDIDATES: usize = 32;

/// Which starts of a region are followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Starts {
    /// Where other regions distinguish them, the likeliest few, until a pose explains all regions.
    Likely,
    /// All, and those of regions that the image's border cuts.
    All,
}

/// Minima of the unweighted equations of all regions, about the problem's origin, best first.
///
/// From poses of the prior, then from the closed forms of one region after the other, the largest first, until one explains
/// all regions.
pub fn moment_poses(
    problem: &Problem,
    prior: &Prior,
    prior_poses: &[Pose],
    starts: Starts,
    cache: &mut SingleRegionCache,
    mut explains: impl FnMut(&Pose) -> bool,
    budget: &Budget,
) -> Vec<Pose> {
    let mut order: Vec<usize> = (0..problem.regions().len()).collect();
    order.sort_by(|&a, &b| problem.regions()[b].pixel_area().total_cmp(&problem.regions()[a].pixel_area()));
    let mut found: Vec<(f64, Pose)> = prior_poses.iter().map(|pose| solved_jointly(problem, pose, budget)).collect();
    for index in order {
        found.extend(solved_together(problem, region_poses(problem, index, prior, starts, cache, budget), budget));
        found = narrowed(found);
        if starts == Starts::Likely && found.first().is_some_and(|(_, pose)| explains(pose)) {
            break;
        }
    }
    without_cost(found)
}

/// Poses of single regions, independent of the others, region by region; none of a single region.
pub fn single_region_poses(problem: &Problem, cache: &mut SingleRegionCache, budget: &Budget) -> Vec<Vec<Pose>> {
    if problem.regions().len() == 1 {
        return Vec::new();
    }
    let of = |index| region_poses(problem, index, &Prior::default(), Starts::All, cache, budget);
    (0..problem.regions().len()).map(of).collect()
}

/// Minima of one region's equations, of fewer vertices, near its closed forms.
fn region_poses(
    problem: &Problem,
    index: usize,
    prior: &Prior,
    starts: Starts,
    cache: &mut SingleRegionCache,
    budget: &Budget,
) -> Vec<Pose> {
    let (region, world, origin) = (&problem.regions()[index], &problem.worlds()[index], problem.origin());
    let single = problem.regions().len() == 1;
    let mut poses = closed_form(region.chart(), region.outline(), world, origin);
    let pixel = region.pixel_area().sqrt().recip();
    poses.extend(triangle_poses(region.chart(), region.outline(), world, origin, pixel, budget));
    if prior.up.is_some() {
        poses.extend(facing(region.chart(), region.outline(), world, origin, prior.up.as_ref()));
    }
    // Of a single region, a wrong pose may fit where the rest of it is cut off.
    if region.border().is_some() && (starts == Starts::All || single) {
        poses.extend(cut_starts(problem, region, world, budget));
    }
    if starts == Starts::Likely && !single {
        poses = without_cost(pruned_by_cost(costs_of(problem.coarse(budget), poses, budget)));
        poses.truncate(STARTS_PER_REGION);
    }
    poses.iter().filter_map(|pose| cache.solved(problem, index, pose, budget)).collect()
}

/// Starts of single regions and the minima reached from them: likely ones are followed first, and are among all of them.
#[derive(Debug, Default)]
pub struct SingleRegionCache(BTreeMap<usize, Vec<(Pose, Pose)>>);

impl SingleRegionCache {
    /// The minimum of one region's unweighted equations near a start; `None` once the budget is exhausted.
    fn solved(&mut self, problem: &Problem, index: usize, start: &Pose, budget: &Budget) -> Option<Pose> {
        let followed = self.0.get(&index).into_iter().flatten();
        if let Some((_, found)) = followed.into_iter().find(|(from, _)| from == start) {
            return Some(*found);
        }
        // Each start costs an evaluation at least: none is followed once the budget is exhausted.
        if budget.is_exhausted() && !self.0.is_empty() {
            return None;
        }
        let region = &problem.coarse(budget)[index..=index];
        let found = minimize(region, start, Weighting::Uniform, CANDIDATE, budget).pose;
        self.0.entry(index).or_default().push((*start, found));
        Some(found)
    }
}

/// The starts of a region that the image's border cuts, at which the cut prediction fits best: those of its world region
/// cut by lines from all sides.
fn cut_starts(problem: &Problem, region: &RegionEquations, world: &WorldRegion, budget: &Budget) -> Vec<Pose> {
    let poses = costs_of(std::slice::from_ref(region), cut_forms(problem, region, world, budget), budget);
    sorted(poses).into_iter().take(STARTS_OF_CUT).map(|(_, pose)| pose).collect()
}

/// Closed forms of every region that has hidden edges, its world region cut from all sides as what hides it may have
/// cut it.
pub fn hidden_region_poses(problem: &Problem, budget: &Budget) -> Vec<Pose> {
    let pairs = problem.regions().iter().zip(problem.worlds());
    let hidden = pairs.filter(|(region, _)| region.hides_edges());
    hidden.flat_map(|(region, world)| cut_forms(problem, region, world, budget)).collect()
}

fn cut_forms(problem: &Problem, region: &RegionEquations, world: &WorldRegion, budget: &Budget) -> Vec<Pose> {
    let closed = |cut: &WorldRegion| closed_form(region.chart(), region.outline(), cut, problem.origin());
    cut_worlds(world, budget).iter().flat_map(closed).collect()
}

/// Minima from the paper's start (its section 2.1.1 and 2.2.1), or from a given pose alone.
pub fn paper_poses(problem: &Problem, prior: &Prior, budget: &Budget) -> Vec<Pose> {
    let regions = problem.regions();
    let solved =
        |regions: &[RegionEquations], pose: &Pose| minimize(regions, pose, Weighting::Uniform, FINAL, budget).pose;
    let starts = match &prior.initial {
        Some(initial) => vec![solved(regions, &problem.centered(initial))],
        None => {
            let (first, world, origin) = (&regions[..1], &problem.worlds()[0], problem.origin());
            let facing = facing(first[0].chart(), first[0].outline(), world, origin, prior.up.as_ref());
            let both = |pose: &Pose| {
                let pose = solved(first, pose);
                [pose, solved(first, &conjugate(&pose, world, origin))]
            };
            facing.iter().flat_map(both).collect()
        }
    };
    without_cost(narrowed(solved_together(problem, starts, budget)))
}

/// Minima of all regions' unweighted equations near the starts, with their cost.
fn solved_together(problem: &Problem, starts: Vec<Pose>, budget: &Budget) -> Vec<(f64, Pose)> {
    let regions = problem.regions();
    let found = narrowed(starts.into_iter().map(|pose| (cost(regions, &pose, budget), pose)).collect());
    if regions.len() == 1 {
        return found;
    }
    found.iter().map(|(_, pose)| solved_jointly(problem, pose, budget)).collect()
}

/// The minimum of all regions' unweighted equations near a start, with its cost.
fn solved_jointly(problem: &Problem, start: &Pose, budget: &Budget) -> (f64, Pose) {
    let minimum = minimize(problem.regions(), start, Weighting::Uniform, CANDIDATE, budget);
    (minimum.cost, minimum.pose)
}

/// Distinct poses by their cost, best first, as many as are refined further.
fn narrowed(costs: Vec<(f64, Pose)>) -> Vec<(f64, Pose)> {
    pruned_by_cost(distinct(costs, MOST_CANDIDATES, SAME, |pose| pose))
}

/// The poses by their cost, best first, without those that are far from the best.
fn pruned_by_cost(costs: Vec<(f64, Pose)>) -> Vec<(f64, Pose)> {
    let mut costs = sorted(costs);
    let limit = costs.first().map_or(0.0, |(least, _)| least * MAX_COST_RATIO + SMALL_COST);
    costs.retain(|(cost, _)| *cost <= limit);
    costs
}

fn without_cost(costs: Vec<(f64, Pose)>) -> Vec<Pose> {
    costs.into_iter().map(|(_, pose)| pose).collect()
}

/// Poses with their joint unweighted cost, the largest of all where they show a region out of view.
fn costs_of(regions: &[RegionEquations], poses: Vec<Pose>, budget: &Budget) -> Vec<(f64, Pose)> {
    poses.into_iter().map(|pose| (cost(regions, &pose, budget).min(f64::MAX), pose)).collect()
}

/// Sum of the squared unweighted residuals; infinite where a region is out of view, and the largest number where the budget is
/// exhausted.
fn cost(regions: &[RegionEquations], pose: &Pose, budget: &Budget) -> f64 {
    if budget.is_exhausted() {
        return f64::MAX;
    }
    residual::cost(regions, pose, Weighting::Uniform, budget).unwrap_or(f64::INFINITY)
}
