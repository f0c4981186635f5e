//! Multi-start pose search: starts are screened, refined and ranked by the likelihood of the contours.

pub mod acceptance;
pub mod candidates;
pub mod centroids;
pub mod closed_form;
pub mod corners;
pub mod cuts;
pub mod decision;
pub mod directions;
mod further;
pub mod moments;
mod outlined;
pub mod p3p;
pub mod poses;
mod ranking;
pub mod sampled;
mod screen;
pub mod symmetry;
mod turns;

use candidates::{Candidates, refined_on_contours, whitened_minima};
use centroids::centroid_poses;
use closed_form::closed_form;
use moments::{FINAL, SingleRegionCache, Starts, moment_poses, paper_poses};
use screen::CandidateScreen;

use crate::budget::Budget;
use crate::contour::covariance::covariance;
use crate::contour::fit::ContourFit;
use crate::equations::least_squares::{Minimum, minimize};
use crate::equations::system::Weighting;
use crate::equations::whitening::Orders;
use crate::geometry::pose::Pose;
use crate::options::{Options, Refinement, Start};
use crate::problem::Problem;

/// The result of a search: candidate poses about the problem's origin, and the data to assess them.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::{ObservedRegion, Options, Problem, WorldRegion};
/// # let corners = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)];
/// # let sign: Vec<_> = corners.iter().map(|&(x, y)| Vector3::new(x, y, 0.7 * y)).collect();
/// # let bearings = sign.iter().map(|x| (x + Vector3::new(-0.2, 0.1, 4.0)).normalize()).collect();
/// # let observed = [ObservedRegion::new(vec![bearings], 20_000.0)];
/// # let worlds = [WorldRegion::from_rings(&[sign])?];
/// let search = Problem::new(&observed, &worlds)?.search(&Options::default());
/// // Any least squares may run here; this one is `Problem::estimate`'s.
/// let minima = search.candidates().iter().map(|pose| search.solve_from(pose)).collect();
/// assert!(search.assess(minima).is_ok_and(|estimate| estimate.alternatives.is_empty()));
/// # Ok::<(), regionpose::Error>(())
/// ```
#[derive(Debug, Clone)]
#[must_use]
pub struct Search {
    /// The problem, whitened for the boundary noise of its best candidate.
    pub(crate) problem: Problem,
    /// Options of the search.
    pub(crate) options: Options,
    pub(crate) found: Candidates,
    /// Starts of the inference from samples, about the problem's origin.
    pub(crate) starts: Vec<Pose>,
    /// Whether the budget was exhausted.
    pub(crate) exhausted: bool,
}

impl Problem {
    /// The candidate poses; those found by then where the budget is exhausted.
    ///
    /// Regions whose samples are uninformative at all of them are compared by their outlines alone.
    pub fn search(&self, options: &Options) -> Search {
        self.search_within(options, &Budget::unlimited())
    }

    /// The same within a budget.
    #[doc(hidden)]
    pub fn search_within(&self, options: &Options, budget: &Budget) -> Search {
        let search = self.bounded_search(options, budget);
        match search.with_informative_samples(budget) {
            Some(problem) => problem.bounded_search(options, budget),
            None => search,
        }
    }

    fn bounded_search(&self, options: &Options, budget: &Budget) -> Search {
        let sketch = self.by_boundary();
        let first = sketch.as_ref().unwrap_or(self);
        // Where several regions have samples, poses by outlines are starts: refining them gains nothing. A single outline may be
        // disturbed so much that its moments have no minimum near the pose.
        let is_sampled = self.regions().len() > 1 && self.has_samples_on_all_edges();
        let refinement = if is_sampled { Refinement::Off } else { options.refinement };
        let options = Options { refinement, ..*options };
        let (search, exhausted) = budget.limited(first.most_work(), |budget| first.searched(&options, budget));
        Search { exhausted, problem: search.problem.integrated_as(self), ..search }
    }

    fn searched(&self, options: &Options, budget: &Budget) -> Search {
        let (mut screen, mut cache) = (CandidateScreen::new(self, options, budget), SingleRegionCache::default());
        let poses = match options.start {
            Start::Global => self.global_poses(options, &mut screen, &mut cache, budget),
            Start::Paper => paper_poses(self, &options.prior, budget),
        };
        let first = poses.first().and_then(|pose| screen.at(pose));
        let (noise, clean) = first.map_or((0.0, false), |fit| (fit.noise(), fit.is_clean()));
        // The moments of a region of which a part is hidden are wrong, however clean the rest of its contour.
        let clean = clean && !self.hides_edges();
        let orders = if clean { Orders::All } else { Orders::Low };
        let problem = self.whitened(noise, orders);
        let starts =
            if self.sampled().is_empty() { Vec::new() } else { self.starts(&screen.prior_poses, &poses, budget) };
        let found = match options.refinement {
            Refinement::Contour if !clean => {
                refined_on_contours(&problem, poses, &options.prior, &screen, &mut cache, budget)
            }
            _ => Candidates::NearMinima(whitened_minima(&problem, poses, &options.prior, budget)),
        };
        Search { problem, options: *options, found, starts, exhausted: false }
    }

    fn global_poses(
        &self,
        options: &Options,
        screen: &mut CandidateScreen,
        cache: &mut SingleRegionCache,
        budget: &Budget,
    ) -> Vec<Pose> {
        let prior_poses = screen.prior_poses.clone();
        let explains = |pose: &Pose| screen.explains(pose);
        let poses = moment_poses(self, &options.prior, &prior_poses, Starts::Likely, cache, explains, budget);
        let cut = self.regions().iter().any(|region| region.border().is_some());
        // Of several disturbed regions, candidates are refined on the contours.
        let enough = self.regions().len() > 1 && !cut && options.refinement == Refinement::Contour;
        match poses.first() {
            Some(pose) if enough || screen.explains(pose) => poses,
            _ => moment_poses(self, &options.prior, &prior_poses, Starts::All, cache, |_| false, budget),
        }
    }

    /// Starts of the inference from samples: poses of the prior, of centroids, and of the outlines, and closed forms of the regions
    /// with samples, unrefined, since disturbed outlines may pull these away.
    fn starts(&self, prior_poses: &[Pose], found: &[Pose], budget: &Budget) -> Vec<Pose> {
        let closed = self.sampled().iter().flat_map(|sampled| {
            let (region, world) = (&self.regions()[sampled.index()], &self.worlds()[sampled.index()]);
            closed_form(region.chart(), region.outline(), world, self.origin())
        });
        let centroids = centroid_poses(self, budget);
        prior_poses.iter().copied().chain(centroids).chain(found.iter().copied()).chain(closed).collect()
    }
}

impl Search {
    /// The poses near which the moments' equations are to be solved, best first; none where the contours determine the pose.
    pub fn candidates(&self) -> Vec<Pose> {
        match &self.found {
            Candidates::NearMinima(poses) => poses.iter().map(|pose| self.problem.uncentered(pose)).collect(),
            Candidates::OnContours(_) => Vec::new(),
        }
    }

    /// The problem on the scale of the boundary noise that was found.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The minimum of the whitened equations that is reached from a candidate, `camera_from_world`; over a mesh from that along
    /// the boundary, where there is one.
    pub fn solve_from(&self, candidate: &Pose) -> Minimum {
        self.solve_within(candidate, &Budget::unlimited())
    }

    /// The same within a budget.
    pub(crate) fn solve_within(&self, candidate: &Pose, budget: &Budget) -> Minimum {
        let solved = |problem: &Problem, start| minimize(problem.regions(), start, Weighting::Whitened, FINAL, budget);
        let start = self.problem.centered(candidate);
        let along = self.problem.by_boundary().map(|sketch| solved(&sketch, &start));
        let minimum = match along {
            // What doesn't converge along the boundary doesn't over its mesh, at a hundred times the price.
            Some(along) if !along.converged => along,
            along => solved(&self.problem, along.as_ref().map_or(&start, |minimum| &minimum.pose)),
        };
        Minimum { pose: self.problem.uncentered(&minimum.pose), ..minimum }
    }

    /// The problem without the samples of regions that are uninformative at every candidate pose of the outlines; `None` where
    /// those of all regions are informative.
    fn with_informative_samples(&self, budget: &Budget) -> Option<Problem> {
        let (problem, contours) = (&self.problem, self.problem.contours());
        if problem.sampled().is_empty() {
            return None;
        }
        let fits: Vec<ContourFit> = match &self.found {
            Candidates::OnContours(fits) => fits.clone(),
            Candidates::NearMinima(poses) => {
                let at = |pose: &Pose| ContourFit::at(contours, pose, problem.coarse_stride(), budget);
                poses.iter().filter_map(at).collect()
            }
        };
        let answer = |fit: &ContourFit| (fit.pose, covariance(contours, fit, budget), fit.mixture.sigma);
        problem.with_informative_samples_at(&fits.iter().map(answer).collect::<Vec<_>>(), budget)
    }
}
