//! From a problem to the poses that may be its answer: candidates in, refined and ranked by the likelihood of the contours.

use std::iter;

use super::centroids::centroid_poses;
use super::closed_form::closed_form;
use super::corners::corner_poses;
use super::decision::{DECISIVE, decides};
use super::directions::direction_poses;
use super::moments::{
    Alone, CANDIDATE, FINAL, MOST_CANDIDATES, SAME_CANDIDATE, Starts, hidden_region_poses, moment_poses, paper_poses,
    single_region_poses,
};
use super::poses::{apart, distinct, sorted};
use super::symmetry::turned_poses;
pub use crate::contour::fit::AMBIGUITY;
use crate::contour::fit::{ContourFit, MOSTLY, Sketch, refined, refined_again};
use crate::contour::members::least_evidence;
use crate::contour::readings::Contour;
use crate::effort;
use crate::equations::least_squares::{Minimum, minimize};
use crate::equations::residual::RegionEquations;
use crate::equations::system::Weighting;
use crate::equations::whitening::Orders;
use crate::error::Result;
use crate::geometry::pose::Pose;
use crate::options::{Options, Refinement, Start};
use crate::prior::{BELIEVED, Prior};
use crate::problem::Problem;

/// A candidate stays while it is worse by less than so many times what would count as fitting: a convention.
const COARSE_AMBIGUITY: f64 = 4.0;

/// Scatter of the clean pieces, pixels, above which nothing counts as found yet: several times that of any mask or drawing.
pub const LOOSE: f64 = 2.0;

/// Log likelihood of a piece, in the mean, by which a pose of several regions is behind the best that no refinement makes up:
/// over 120 pieces, odds of e to the 120.
pub(super) const HOPELESS: f64 = 1.0;

/// Poses from corners that are compared on more than a few pieces: a convention.
const FIRST_LOOK: usize = 250;

/// Pairs of triples of corners at most, over all regions: a convention.
const MOST_PAIRS: usize = 4000;

/// Poses of one kind that are led onto the contours at most, those that are likeliest: a convention.
const MOST_LED: usize = 16;

/// How many times as many pieces follow a refinement on few: a convention.
const MORE_PIECES: usize = 5;

/// Poses nearer than this, rad and share of the distance, are one place on the contours: both were led there.
pub const SAME_PLACE: f64 = 1e-3;

/// What a search found: the poses that may be the answer, about the problem's origin, and what decides between them.
///
/// ```
/// # use nalgebra::Vector3;
/// # use regionpose::{ObservedRegion, Options, Problem, WorldRegion};
/// # let corners = [(0.0, 0.0), (0.6, 0.0), (0.6, 0.3), (0.3, 0.3), (0.3, 1.0), (0.0, 1.0)];
/// # let sign: Vec<_> = corners.iter().map(|&(x, y)| Vector3::new(x, y, 0.7 * y)).collect();
/// # let bearings = sign.iter().map(|x| (x + Vector3::new(-0.2, 0.1, 4.0)).normalize()).collect();
/// # let observed = [ObservedRegion::new(vec![bearings], 20_000.0)];
/// # let worlds = [WorldRegion::from_rings(&[sign])?];
/// let search = Problem::new(&observed, &worlds)?.search(&Options::default())?;
/// // Any least squares may run here; this one is `Problem::estimate`'s.
/// let minima = search.candidates().iter().map(|pose| search.solve_from(pose)).collect();
/// assert!(search.judged(minima).is_some_and(|estimate| estimate.alternatives.is_empty()));
/// # Ok::<(), regionpose::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Search {
    /// The problem, whitened for the boundary noise of its best candidate.
    pub(crate) problem: Problem,
    /// How it was searched.
    pub(crate) options: Options,
    pub(crate) answers: Answers,
    /// Where samples of regions are to be led from, about the problem's origin.
    pub(crate) starts: Vec<Pose>,
    /// Whether it made do with what it had found by the limit of its work.
    pub(crate) exhausted: bool,
}

/// Poses about the problem's origin.
#[derive(Debug, Clone)]
pub(crate) enum Answers {
    /// Near minima of the moments' equations, which average the noise of the whole outlines.
    Moments(Vec<Pose>),
    /// Led onto the clean pieces of the contours.
    Contours(Vec<ContourFit>),
}

impl Problem {
    /// The poses that may be the answer; those found by the limit of its work where that is reached.
    ///
    /// Samples that tell nothing at any of them change nothing: their regions are known by their outlines alone.
    ///
    /// # Errors
    /// A prior that [`Prior::check`] refuses.
    pub fn search(&self, options: &Options) -> Result<Search> {
        options.prior.check()?;
        Ok(self.checked_search(options))
    }

    /// The same with a prior that is known to be one.
    pub(crate) fn checked_search(&self, options: &Options) -> Search {
        let search = self.bounded_search(options);
        match search.without_silent() {
            Some(problem) => problem.bounded_search(options),
            None => search,
        }
    }

    fn bounded_search(&self, options: &Options) -> Search {
        let sketch = self.by_boundary();
        let first = sketch.as_ref().unwrap_or(self);
        // Where samples decide of several regions, outlines are starts: to lead these on gains nothing. One alone may be disturbed so
        // much that its moments lead nowhere near.
        let is_sampled = self.regions().len() > 1 && self.has_samples_all_over();
        let refinement = if is_sampled { Refinement::Off } else { options.refinement };
        let options = Options { refinement, ..*options };
        let (search, exhausted) = effort::bounded(first.most_work(), || first.searched(&options));
        Search { exhausted, problem: search.problem.integrated_as(self), ..search }
    }

    fn searched(&self, options: &Options) -> Search {
        let (mut looks, mut alone) = (Looks::new(self, options), Alone::default());
        let poses = match options.start {
            Start::Global => self.global_poses(options, &mut looks, &mut alone),
            Start::Paper => paper_poses(self, &options.prior),
        };
        let first = poses.first().and_then(|pose| looks.at(pose));
        let (noise, clean) = first.map_or((0.0, false), |fit| (fit.noise(), fit.is_clean()));
        // The moments of a region of which a part is hidden are wrong, however clean the rest of its contour.
        let clean = clean && !self.hides_edges();
        let orders = if clean { Orders::All } else { Orders::Low };
        let problem = self.whitened(noise, orders);
        let starts = if self.sampled().is_empty() { Vec::new() } else { self.starts(&looks.known, &poses) };
        let answers = match options.refinement {
            Refinement::Contour if !clean => on_contours(&problem, poses, &options.prior, &looks, &mut alone),
            _ => Answers::Moments(by_moments(&problem, poses, &options.prior)),
        };
        Search { problem, options: *options, answers, starts, exhausted: false }
    }

    fn global_poses(&self, options: &Options, looks: &mut Looks, alone: &mut Alone) -> Vec<Pose> {
        let known = looks.known.clone();
        let explains = |pose: &Pose| looks.explains(pose);
        let poses = moment_poses(self, &options.prior, &known, Starts::Likely, alone, explains);
        let cut = self.regions().iter().any(|region| region.border().is_some());
        // Several regions that are disturbed are looked at further on their contours.
        let enough = self.regions().len() > 1 && !cut && options.refinement == Refinement::Contour;
        match poses.first() {
            Some(pose) if enough || looks.explains(pose) => poses,
            _ => moment_poses(self, &options.prior, &known, Starts::All, alone, |_| false),
        }
    }

    /// Where samples are led from: what is known beforehand, poses of centroids and closed forms of the regions with samples, as
    /// they are, since their outlines may lead these astray, and those that the outlines gave.
    fn starts(&self, known: &[Pose], found: &[Pose]) -> Vec<Pose> {
        let closed = self.sampled().iter().flat_map(|sampled| {
            let (region, world) = (&self.regions()[sampled.index()], &self.worlds()[sampled.index()]);
            closed_form(region.chart(), region.outline(), world, self.origin())
        });
        known.iter().copied().chain(centroid_poses(self)).chain(found.iter().copied()).chain(closed).collect()
    }

    /// Whether any region has hidden edges.
    fn hides_edges(&self) -> bool {
        self.regions().iter().any(RegionEquations::hides_edges)
    }

    /// The most that a prior and the regions' visible sides count against a pose, in variances.
    pub(crate) fn most_penalty(&self, prior: &Prior) -> f64 {
        let sides = self.worlds().iter().filter(|world| world.viewpoint().is_some()).count();
        prior.most() + BELIEVED * sides as f64
    }
}

/// What was seen of poses on a few pieces while the search went on.
struct Looks<'a> {
    contours: &'a [Contour],
    /// One piece in so many is looked at.
    step: usize,
    /// Whether poses may be led onto the contours: of several regions, whose contours tell a wrong one.
    leads: bool,
    /// Poses that the prior gives.
    known: Vec<Pose>,
    last: Option<ContourFit>,
    /// Starts that were led onto the contours, and where they came to.
    led: Vec<(Pose, ContourFit)>,
}

impl<'a> Looks<'a> {
    fn new(problem: &'a Problem, options: &Options) -> Self {
        let contours = problem.contours();
        let leads = contours.len() > 1 && options.refinement == Refinement::Contour;
        let known = known_poses(problem, &options.prior);
        Self { contours, step: problem.few(), leads, known, last: None, led: Vec::new() }
    }

    /// The fit at a pose that is not moved.
    fn at(&mut self, pose: &Pose) -> Option<&ContourFit> {
        if self.last.as_ref().is_none_or(|fit| fit.pose != *pose) {
            self.last = ContourFit::at(self.contours, pose, self.step);
        }
        self.last.as_ref()
    }

    /// Whether all regions are where a pose shows them, or most of each once it is led onto the contours.
    fn explains(&mut self, pose: &Pose) -> bool {
        if self.at(pose).is_some_and(ContourFit::is_clean) {
            return true;
        }
        let led = if self.leads { self.led_from(pose) } else { None };
        let explains = led.as_ref().is_some_and(is_mostly_clean);
        self.led.extend(led.map(|fit| (*pose, fit)));
        explains
    }

    /// Where a start leads on the contours, looked up where it was led before.
    fn led_from(&self, start: &Pose) -> Option<ContourFit> {
        match self.led.iter().find(|(pose, _)| pose == start) {
            Some((_, fit)) => Some(fit.clone()),
            None => refined(self.contours, start, self.step),
        }
    }
}

impl Search {
    /// The poses near which the moments' equations are to be solved, best first; none where the contours have decided.
    pub fn candidates(&self) -> Vec<Pose> {
        match &self.answers {
            Answers::Moments(poses) => poses.iter().map(|pose| self.problem.uncentered(pose)).collect(),
            Answers::Contours(_) => Vec::new(),
        }
    }

    /// The problem on the scale of the boundary noise that was found.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The minimum of the whitened equations that is reached from a candidate, `camera_from_world`; over a mesh from that along
    /// the boundary, where there is one.
    pub fn solve_from(&self, candidate: &Pose) -> Minimum {
        let solved = |problem: &Problem, start| minimize(problem.regions(), start, Weighting::Whitened, FINAL);
        let start = self.problem.centered(candidate);
        let along = self.problem.by_boundary().map(|sketch| solved(&sketch, &start));
        let minimum = match along {
            // What doesn't converge along the boundary doesn't over its mesh, at a hundred times the price.
            Some(along) if !along.converged => along,
            along => solved(&self.problem, along.as_ref().map_or(&start, |minimum| &minimum.pose)),
        };
        Minimum { pose: self.problem.uncentered(&minimum.pose), ..minimum }
    }
}

/// Poses that the prior gives, about the problem's origin: the initial one, and those of directions from the camera's
/// place.
fn known_poses(problem: &Problem, prior: &Prior) -> Vec<Pose> {
    let initial = prior.initial.map(|pose| problem.centered(&pose));
    initial.into_iter().chain(direction_poses(problem, prior, problem.few())).collect()
}

/// Minima of the whitened equations near the likeliest poses, those that could fit as well as the best: by the equations, which
/// know what a pose shows beyond the observed contours, and by these.
fn by_moments(problem: &Problem, poses: Vec<Pose>, prior: &Prior) -> Vec<Pose> {
    if poses.len() <= 1 {
        return poses;
    }
    let few = problem.few();
    let poses = likeliest(problem.contours(), poses, few, MOST_CANDIDATES);
    let solved = |pose: Pose| minimize(problem.regions(), &pose, Weighting::Whitened, CANDIDATE);
    let minima: Vec<Minimum> = poses.into_iter().map(solved).collect();
    let least = minima.iter().map(|minimum| minimum.cost).fold(f64::INFINITY, f64::min);
    let limit = COARSE_AMBIGUITY * (least + (AMBIGUITY + problem.most_penalty(prior)) * problem.noise_variance(least));
    let fitting = minima.into_iter().filter(|minimum| minimum.cost <= limit);
    let fits = fitting.filter_map(|minimum| ContourFit::at(problem.contours(), &minimum.pose, few));
    let fits = could_be(problem, once(fits.collect(), usize::MAX, SAME_CANDIDATE), prior);
    fits.into_iter().map(|fit| fit.pose).collect()
}

/// The likeliest fits, each pose once.
fn once(fits: Vec<ContourFit>, most: usize, limit: f64) -> Vec<ContourFit> {
    let scored = fits.into_iter().map(|fit| (-fit.mixture.likelihood, fit)).collect();
    distinct(scored, most, limit, |fit| &fit.pose).into_iter().map(|(_, fit)| fit).collect()
}

/// The fits, sorted, that could be as likely as the first once they are solved.
fn could_be(problem: &Problem, fits: Vec<ContourFit>, prior: &Prior) -> Vec<ContourFit> {
    let limit = COARSE_AMBIGUITY * (AMBIGUITY + problem.most_penalty(prior));
    let mut fits = fits.into_iter();
    let Some(best) = fits.next() else { return Vec::new() };
    // By all pieces: where no more than tell of the noise count, more follow, and of 120 problems with two regions swapped of three two
    // end at a wrong pose in place of the right one (`benchmarks/confidence.py`).
    let others: Vec<ContourFit> = fits.filter(|fit| best.against(fit, f64::INFINITY) <= limit).collect();
    iter::once(best).chain(others).collect()
}

/// The likeliest poses on every `step`-th piece, without any being moved.
fn likeliest(contours: &[Contour], poses: Vec<Pose>, step: usize, most: usize) -> Vec<Pose> {
    if poses.len() <= 1 {
        return poses;
    }
    let sketch = Sketch::new(contours, step);
    let scored = sorted(poses.into_iter().map(|pose| (sketch.misfit(&pose), pose)).collect());
    // A region alone may be disturbed so much that its moments lead nowhere near; several tell a wrong pose at a glance.
    let worst = if contours.len() > 1 { HOPELESS } else { f64::INFINITY };
    let least = scored.first().map_or(0.0, |(misfit, _)| *misfit);
    scored.into_iter().take(most).take_while(|(misfit, _)| *misfit <= least + worst).map(|(_, pose)| pose).collect()
}

/// The candidates led onto the contours, or the minima of the moments where these do not decide.
fn on_contours(problem: &Problem, poses: Vec<Pose>, prior: &Prior, looks: &Looks, alone: &mut Alone) -> Answers {
    let (contours, few) = (problem.contours(), problem.few());
    let places = places(problem, poses, prior, looks, alone);
    if problem.hides_edges() {
        return Answers::Contours(places);
    }
    let Some(place) = places.first() else { return Answers::Moments(Vec::new()) };
    let solved = |place: &ContourFit| minimize(problem.regions(), &place.pose, Weighting::Whitened, CANDIDATE).pose;
    let own = solved(place);
    let minima = iter::once(own).chain(places[1..].iter().map(solved)).collect();
    let minima = by_moments(problem, minima, prior);
    let Some(minimum) = minima.first() else { return Answers::Contours(places) };
    // A few pieces decide where they tell enough; all of them tell more.
    let decided = [few, 1].into_iter().any(|step| decides(contours, &place.pose, minimum, &own, step));
    if decided { Answers::Contours(places) } else { Answers::Moments(minima) }
}

/// The likeliest poses on the contours: the candidates, further ones where none of these is found, and other turns of a
/// plane, each refined on few pieces, then on all.
fn places(problem: &Problem, poses: Vec<Pose>, prior: &Prior, looks: &Looks, alone: &mut Alone) -> Vec<ContourFit> {
    let contours = problem.contours();
    let few = problem.few();
    let led = |poses: Vec<Pose>| poses.iter().filter_map(|pose| looks.led_from(pose)).collect::<Vec<_>>();
    let known = looks.known.iter().copied();
    let starts = likeliest(contours, poses, few, MOST_LED).into_iter().chain(known).collect();
    let mut found = led(starts);
    if problem.hides_edges() || !found.iter().any(is_found) {
        let single = single_region_poses(problem, alone);
        found.extend(led(further_poses(problem, &single)));
        found.extend(own_fits(problem, &single));
    }
    let mut all = sharpened(problem, found, few, prior);
    if let Some(best) = all.first() {
        let turned = led(turned_poses(problem, &best.pose, few));
        all.extend(sharpened(problem, turned, few, prior));
    }
    could_be(problem, once(all, usize::MAX, SAME_PLACE), prior)
}

/// The fits led on from every `step`-th piece to all, those that could be as likely as the best.
fn sharpened(problem: &Problem, mut fits: Vec<ContourFit>, mut step: usize, prior: &Prior) -> Vec<ContourFit> {
    while step > 1 {
        let likely = likely(problem, fits, prior);
        step = (step / MORE_PIECES).max(1);
        fits = likely.iter().flat_map(|fit| led_on(problem.contours(), fit, step)).collect();
    }
    once(fits, usize::MAX, SAME_PLACE)
}

/// Where a fit leads on more pieces from a wide scale and, where that is away from it and of several regions some may be elsewhere,
/// from its own scatter.
fn led_on(contours: &[Contour], fit: &ContourFit, step: usize) -> Vec<ContourFit> {
    let led = refined(contours, &fit.pose, step);
    let away = led.as_ref().is_none_or(|led| apart(&led.pose, &fit.pose, SAME_CANDIDATE));
    let beside = if away && contours.len() > 1 { refined_again(contours, fit, step) } else { None };
    led.into_iter().chain(beside).collect()
}

/// The fits that could be as likely as the best, each once.
fn likely(problem: &Problem, fits: Vec<ContourFit>, prior: &Prior) -> Vec<ContourFit> {
    could_be(problem, once(fits, MOST_LED, SAME_CANDIDATE), prior)
}

/// Whether the contours of several regions tell that all are where a pose shows them. That of one alone does not: three of its sides
/// can be led onto any three lines.
fn is_found(fit: &ContourFit) -> bool {
    fit.regions().count() > 1 && fit.mixture.sigma < LOOSE && least_evidence(fit) >= DECISIVE
}

/// Whether most of every region's contour is explained.
pub(super) fn is_mostly_clean(fit: &ContourFit) -> bool {
    fit.mixture.sigma < LOOSE && fit.clean_shares().iter().all(|&share| share >= MOSTLY)
}

/// Poses from corners, of regions with hidden edges, and `single`, from each by itself: those that lie nearest to the contours of
/// all.
pub(crate) fn further_poses(problem: &Problem, single: &[Vec<Pose>]) -> Vec<Pose> {
    let (contours, few) = (problem.contours(), problem.few());
    let corners = likeliest(contours, poses_of_corners(problem), 2 * few, FIRST_LOOK);
    let hidden = likeliest(contours, hidden_region_poses(problem), 2 * few, FIRST_LOOK);
    let of_all = [corners, single.concat(), hidden];
    of_all.into_iter().flat_map(|poses| nearest(contours, poses, few, MOST_LED)).collect()
}

/// Each pose once, those that lie nearest to the contours.
fn nearest(contours: &[Contour], poses: Vec<Pose>, step: usize, most: usize) -> Vec<Pose> {
    let sketch = Sketch::new(contours, step);
    let scored = poses.into_iter().map(|pose| (sketch.misfit(&pose), pose)).collect();
    distinct(scored, most, SAME_CANDIDATE, |pose| pose).into_iter().map(|(_, pose)| pose).collect()
}

/// The fits of poses that single regions give, led onto their own contours whatever the others show, since these may be elsewhere.
fn own_fits(problem: &Problem, single: &[Vec<Pose>]) -> Vec<ContourFit> {
    let (contours, few) = (problem.contours(), problem.few());
    let own = single.iter().zip(contours).flat_map(|(poses, contour)| {
        let contour = std::slice::from_ref(contour);
        let poses = nearest(contour, poses.clone(), few, (MOST_LED / contours.len()).max(1));
        poses.into_iter().filter_map(move |pose| refined(contour, &pose, few))
    });
    own.filter_map(|fit| ContourFit::at(contours, &fit.pose, few)).collect()
}

/// The poses of every region's corners, about the problem's origin.
fn poses_of_corners(problem: &Problem) -> Vec<Pose> {
    let most = MOST_PAIRS / problem.regions().len();
    let pairs = problem.regions().iter().zip(problem.worlds());
    let poses = pairs.flat_map(|(region, world)| {
        let pixel = region.pixel_area().sqrt().recip();
        corner_poses(region.chart(), region.outline(), world, problem.origin(), pixel, most)
    });
    poses.collect()
}
