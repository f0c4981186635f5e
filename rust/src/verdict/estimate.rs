//! The result: the best pose, the others that fit, its covariance and overlap, and the warnings.

use std::borrow::Cow;
use std::cell::OnceCell;

use nalgebra::{Matrix6, Vector3};

use super::confidence::Evidence;
use super::coverage::region_overlap;
use super::frame_error::{RegionFactor, focal_shift, with_frame_error};
use super::outliers::{Outlier, outliers};
use super::shares::{shares, together};
use super::warning::{Warning, Way};
use super::weakness::weak_geometry;
use crate::contour::covariance::covariance;
use crate::contour::fit::ContourFit;
use crate::contour::members::contradicted;
use crate::contour::numbers::telling;
use crate::contour::votes::Vote;
use crate::effort;
use crate::equations::information::honest;
use crate::equations::least_squares::{Minimum, Termination};
use crate::error::Result;
use crate::geometry::overlap::OverlapAreas;
use crate::geometry::pose::{Pose, Tangent};
use crate::math::gaussian::Gaussian;
use crate::options::{FrameSigma, Options};
use crate::prior::{BELIEVED, FromInitial, FromNear, FromUp, Prior};
use crate::problem::Problem;
use crate::samples::labels::ALIKE;
use crate::samples::posterior::Posterior;
use crate::samples::readings::SampledRegion;
use crate::search::candidates::{AMBIGUITY, Answers, LOOSE, SAME_PLACE, Search};
use crate::search::poses::{apart, distinct, sorted};

/// Overlap error above which a solution does not count as solved (paper section 3).
pub(super) const POOR_OVERLAP: f64 = 0.05;

/// Overlap error of a region of which a pose shows nothing: no trust bears more.
const NOT_SHOWN: f64 = 1.0;

/// Probability of a pose above which a region that is seen elsewhere is not warned of; every pose of less has a warning. Above 0.95,
/// 3 of 10,008 poses are wrong without a warning, above 0.97 none is, and 9 right ones more have one
/// (`regionpose evaluate trust --scenes 556`).
pub const TRUSTED: f64 = 0.97;

/// Poses within this many variances of the best are equally good, as turns of symmetric shapes are: what differs is where the contours'
/// pieces lie (`cargo test symmetry::`).
const TIE: f64 = 0.6;

/// A pose and how well its projected regions cover the observed ones.
#[derive(Debug, Clone)]
pub struct Solution {
    /// `camera_from_world`.
    pub pose: Pose,
    /// The minimum of the moments' equations that it is; `None` where it was led onto the contours.
    pub minimum: Option<Minimum>,
    /// What the contours show at the pose.
    pub fit: ContourFit,
    /// What the samples show there; `None` where no region has any.
    pub posterior: Option<Posterior>,
    /// Area of the symmetric difference over the observed area, all regions together (the paper's delta).
    pub overlap_error: f64,
    /// The same, region by region.
    pub region_overlap_errors: Vec<f64>,
    /// Covariance of the left increment `[omega (rad), tau (meters)]`, with what errors of the whole exposure add.
    pub covariance: Matrix6<f64>,
    /// The pose's derivative by the logarithm of the focal lengths; not a number where a direction is left free.
    pub focal_shift: Tangent,
    /// Probability that the true pose is within 5 degrees (`docs/math.md`, section 15).
    pub confidence: f64,
    /// Probability that this answer is the place, each answer being one of its own.
    pub share: f64,
}

impl Solution {
    /// What ended its least squares before a minimum, if anything did.
    fn unconverged(&self) -> Option<&Termination> {
        self.minimum.as_ref().filter(|minimum| !minimum.converged).map(|minimum| &minimum.termination)
    }
}

/// The pose of a camera, and what is known of it.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// The best pose.
    pub best: Solution,
    /// Noise of the boundary that the fit shows, in pixels along the normal.
    pub boundary_noise: f64,
    /// The other poses that fit as well and that the prior leaves, best first.
    pub alternatives: Vec<Solution>,
    /// Edges that two regions share, used as evidence beside samples: the regions, and the ends in the world.
    pub creases: Vec<([usize; 2], [Vector3<f64>; 2])>,
    /// What to be warned of.
    pub warnings: Vec<Warning>,
    /// What the fit shows of the best pose, whatever else fits alike.
    pub evidence: Evidence,
    /// Evaluations of the equations in the final least squares.
    pub evaluations: usize,
    /// Median distance of the regions from the camera at the best pose.
    pub distance: f64,
    /// Angle of a pixel where the regions are seen, rad: the root of its mean square over them.
    pub pixel_angle: f64,
}

/// Candidate poses, and the problem without the samples that do not constrain any of them.
struct Hypotheses<'a> {
    problem: Cow<'a, Problem>,
    places: Vec<Place>,
    /// Whether samples constrain the pose, and none of their modes was found.
    samples_unused: bool,
}

/// A pose that may be the answer.
#[derive(Debug, Clone)]
struct Place {
    pose: Pose,
    minimum: Option<Minimum>,
    fit: ContourFit,
    posterior: Option<Posterior>,
    /// Covariance of the left increment, once it is asked for.
    covariance: OnceCell<Matrix6<f64>>,
    /// How each projected region covers the observed one, once it is asked for.
    overlaps: OnceCell<Vec<OverlapAreas>>,
    /// What counts against it: how much worse than the best it fits, and the prior, in variances.
    against: f64,
}

impl Problem {
    /// The pose from nothing but the regions, by the native solver.
    ///
    /// `None` where no pose shows every region in its chart.
    pub fn estimate(&self) -> Option<Estimate> {
        self.estimated(&Options::default())
    }

    /// The pose by the native solver, with options.
    ///
    /// `None` where no pose shows every region in its chart.
    ///
    /// # Errors
    /// A prior that [`Prior::check`] refuses.
    pub fn estimate_with(&self, options: &Options) -> Result<Option<Estimate>> {
        options.prior.check()?;
        Ok(self.estimated(options))
    }

    fn estimated(&self, options: &Options) -> Option<Estimate> {
        let search = self.checked_search(options);
        let solved = || search.candidates().iter().map(|candidate| search.solve_from(candidate)).collect();
        let (minima, _) = effort::bounded(self.most_work(), solved);
        search.judged(minima)
    }
}

impl Search {
    /// The verdict, with the minima that any driver found from the candidates.
    pub fn judged(self, minima: Vec<Minimum>) -> Option<Estimate> {
        let evaluations = minima.iter().map(|minimum| minimum.evaluations).sum();
        let (Hypotheses { problem, places, samples_unused }, exhausted) =
            effort::bounded(self.problem.most_work(), || self.hypotheses(minima));
        let problem = &*problem;
        let places = stated(likely(problem, places, &self.options.prior), &self.options.prior);
        let (best, _) = places.first()?;
        let evidence = best.evidence(problem, places.len() > 1);
        let noise = match (&best.posterior, &best.minimum) {
            (Some(posterior), _) => posterior.blur,
            (None, Some(minimum)) => problem.noise_variance(minimum.cost).sqrt(),
            (None, None) => best.fit.mixture.sigma,
        };
        let probability = evidence.probability();
        let mut solutions = places.into_iter().map(|(place, stated)| {
            solution(problem, place, stated.map(|share| probability * share), &self.options.frame_sigma)
        });
        let best = solutions.next()?;
        let alternatives: Vec<Solution> = solutions.collect();
        let ended = if self.exhausted || exhausted { Some(&Termination::WorkLimit) } else { best.unconverged() };
        let unused = samples_unused.then_some(Warning::SamplesUnused);
        let warnings = warnings(problem, &best, &alternatives, &evidence, &self.options, ended);
        let warnings = unused.into_iter().chain(warnings).collect();
        let creases = if best.posterior.is_some() { self.creases(&best.pose) } else { Vec::new() };
        let (distance, pixel_angle) = (self.problem.distance(&best.pose), self.problem.pixel_angle());
        Some(Estimate {
            best,
            boundary_noise: noise,
            alternatives,
            creases,
            warnings,
            evidence,
            evaluations,
            distance,
            pixel_angle,
        })
    }

    /// The creases as a pose shows them.
    fn creases(&self, pose: &Pose) -> Vec<([usize; 2], [Vector3<f64>; 2])> {
        let creases = self.problem.creases();
        creases.iter().map(|crease| (crease.regions, self.problem.crease_segment(crease, pose))).collect()
    }

    /// The poses that may be the answer: where regions have samples, what these leave possible about the outlines' answers.
    fn hypotheses(&self, minima: Vec<Minimum>) -> Hypotheses<'_> {
        let places = self.places(minima);
        let starts: Vec<Pose> = places.iter().map(|place| place.fit.pose).chain(self.starts.iter().copied()).collect();
        let mut problem = Cow::Borrowed(&self.problem);
        while !problem.sampled().is_empty() {
            let sampled = self.places_by_samples(&problem, &starts);
            let Some(silent) = problem.without_silent_at(&sampled.iter().filter_map(Place::answer).collect::<Vec<_>>())
            else {
                // Samples that hold nothing leave the outlines' answers, and regions that are judged by these.
                return match sampled.is_empty() {
                    true => Hypotheses { problem: Cow::Owned(problem.with_sampled(&[])), places, samples_unused: true },
                    false => Hypotheses { problem, places: sampled, samples_unused: false },
                };
            };
            problem = Cow::Owned(silent);
        }
        Hypotheses { problem, places, samples_unused: false }
    }

    /// The modes of the samples' posterior about starts.
    fn places_by_samples(&self, problem: &Problem, starts: &[Pose]) -> Vec<Place> {
        let place = |posterior: Posterior| {
            let fit = ContourFit::at(problem.contours(), &posterior.pose, problem.few())?;
            let (pose, covariance) = (problem.uncentered(&posterior.pose), honest(&posterior.covariance));
            Some(Place { posterior: Some(posterior), covariance: covariance.into(), ..Place::new(pose, None, fit) })
        };
        problem.posteriors(starts, &self.options.prior).into_iter().filter_map(place).collect()
    }

    /// The poses that the outlines leave, those that fit best first.
    fn places(&self, minima: Vec<Minimum>) -> Vec<Place> {
        let (problem, contours) = (&self.problem, self.problem.contours());
        // What is clean and fits from one pose alone shows it by a few pieces.
        let few = if minima.len() > 1 { 1 } else { problem.few() };
        let minima = minima.into_iter().filter_map(|minimum| {
            let pose = problem.centered(&minimum.pose);
            let fit = ContourFit::at(contours, &pose, few)?;
            let fit = if few > 1 && !fit.is_clean() { ContourFit::at(contours, &pose, 1)? } else { fit };
            Some(Place::new(minimum.pose, Some(minimum), fit))
        });
        let led = match &self.answers {
            Answers::Contours(fits) => fits.as_slice(),
            Answers::Moments(_) => &[],
        };
        let led = led.iter().map(|fit| Place::new(problem.uncentered(&fit.pose), None, fit.clone()));
        let scored = minima.chain(led).map(|place| (place.cost(), place)).collect();
        distinct(scored, usize::MAX, SAME_PLACE, |place| &place.fit.pose).into_iter().map(|(_, place)| place).collect()
    }
}

/// The places that fit about as well as the best once the prior is weighed in, best first, and what counts against each
/// (`docs/math.md`, eq. 10.6).
///
/// An initial pose without an uncertainty chooses the first among them.
fn likely(problem: &Problem, places: Vec<Place>, prior: &Prior) -> Vec<Place> {
    let [first, _, ..] = places.as_slice() else { return places };
    let first = first.clone();
    let numbers = telling(problem.contours(), 1);
    let against = |place: &Place| {
        let worse = first.outdoes(place, problem, numbers);
        let behind = BELIEVED * problem.seen_from_behind(&place.pose).len() as f64;
        // The evidence of samples holds the prior already.
        let weighed = place.posterior.is_none() && prior.most() > 0.0;
        let unlikely = if weighed { prior.penalty(&place.pose, place.covariance(problem)) } else { 0.0 };
        (if worse.abs() <= TIE { 0.0 } else { worse }) + unlikely + behind
    };
    let mut places = by_against(places.into_iter().map(|place| Place { against: against(&place), ..place }).collect());
    let least = places.first().map_or(0.0, |best| best.against);
    places.retain(|place| place.against <= least + AMBIGUITY);
    // Sorting is stable: what the prior does not decide, the fit does, and the rotation where that does not either.
    if let Some(best) = places.first().cloned() {
        let ties =
            |place: &Place| place.against == least && best.votes(place).iter().all(|&vote| vote == Vote::Neither);
        places.sort_by_key(|place| if ties(place) { order(&place.pose) } else { [i64::MAX; 3] });
    }
    if let (Some(initial), true) = (prior.initial, chooses(prior)) {
        places.sort_by(|a, b| a.pose.angle_to(&initial).total_cmp(&b.pose.angle_to(&initial)));
    }
    places.into_iter().map(|place| Place { against: place.against - least, ..place }).collect()
}

/// The places, the likeliest first.
fn by_against(places: Vec<Place>) -> Vec<Place> {
    sorted(places.into_iter().map(|place| (place.against, place)).collect())
        .into_iter()
        .map(|(_, place)| place)
        .collect()
}

/// The places that fit about as well as the best, with the share and the confidence of each, if any place found is the place, the
/// largest confidence first, but where the prior has chosen.
fn stated(places: Vec<Place>, prior: &Prior) -> Vec<(Place, [f64; 2])> {
    let Some(best) = places.first() else { return Vec::new() };
    let against: Vec<f64> = places.iter().map(|place| place.against).collect();
    let poses: Vec<Pose> = places.iter().map(|place| place.pose).collect();
    let votes: Vec<Vec<Vote>> = places.iter().map(|place| best.votes(place)).collect();
    let shares = shares(&against, &poses, &votes);
    let confidences = together(&poses, &shares);
    let stated = shares.into_iter().zip(confidences).map(|(share, confidence)| [share, confidence]);
    let mut places: Vec<(Place, [f64; 2])> = places.into_iter().zip(stated).collect();
    // Those by samples that are less likely have their shares, too.
    places.retain(|(place, _)| place.posterior.is_none() || place.against <= ALIKE);
    if !chooses(prior) {
        places.sort_by(|(_, [_, a]), (_, [_, b])| b.total_cmp(a));
    }
    places
}

/// Whether an initial pose without an uncertainty chooses among what fits alike.
fn chooses(prior: &Prior) -> bool {
    prior.initial.is_some() && prior.initial_sigma.is_none()
}

/// Where a pose comes among those that fit equally: by its rotation vector, in steps that round-off does not cross but by
/// chance.
fn order(pose: &Pose) -> [i64; 3] {
    let turn = pose.rotation.scaled_axis();
    [turn.x, turn.y, turn.z].map(|component| (component / SAME_PLACE).round() as i64)
}

impl Place {
    /// The answer of its samples about the problem's origin, its covariance and how far contours are blurred and grown, pixels.
    fn answer(&self) -> Option<(Pose, Matrix6<f64>, f64)> {
        let Posterior { pose, covariance, blur, growth, .. } = self.posterior.as_ref()?;
        Some((*pose, *covariance, blur.hypot(*growth)))
    }

    /// A place against which nothing counts yet.
    fn new(pose: Pose, minimum: Option<Minimum>, fit: ContourFit) -> Self {
        let (covariance, overlaps) = (OnceCell::new(), OnceCell::new());
        Self { pose, minimum, fit, posterior: None, covariance, overlaps, against: 0.0 }
    }

    /// That of the samples, or else of the contours.
    fn covariance(&self, problem: &Problem) -> &Matrix6<f64> {
        self.covariance.get_or_init(|| covariance(problem.contours(), &self.fit))
    }

    /// How each projected region covers the observed one.
    fn overlaps(&self, problem: &Problem) -> &[OverlapAreas] {
        self.overlaps.get_or_init(|| region_overlaps(problem, &self.pose))
    }

    /// What each region says of the left increment: its samples, or its contour where it has none.
    fn region_factors(&self, problem: &Problem) -> Vec<RegionFactor> {
        let none = || vec![Gaussian::default(); problem.worlds().len()];
        let mut factors = self.fit.region_gaussians(problem.contours()).unwrap_or_else(none);
        let mut is_scanned = vec![false; factors.len()];
        if let Some(posterior) = &self.posterior {
            for region in problem.sampled() {
                (factors[region.index()], is_scanned[region.index()]) = (Gaussian::default(), true);
            }
            posterior.messages.iter().for_each(|(region, message)| factors[*region] = *message);
        }
        let places = problem.worlds().iter().map(|world| self.pose.transform(&world.frame().origin));
        let regions = factors.into_iter().zip(places).zip(is_scanned);
        regions.map(|((factor, place), is_scanned)| RegionFactor { factor, place, is_scanned }).collect()
    }

    /// How much worse another place fits, in variances: by the contours, and by the moments where they decide.
    fn outdoes(&self, other: &Self, problem: &Problem, numbers: f64) -> f64 {
        if !apart(&self.fit.pose, &other.fit.pose, 0.0) {
            return 0.0;
        }
        if let (Some(own), Some(posterior)) = (&self.posterior, &other.posterior) {
            return own.against(posterior, problem.sampled()).max(0.0);
        }
        let by_contours = self.fit.against(&other.fit, numbers);
        match (&self.minimum, &other.minimum) {
            (Some(own), Some(minimum)) => by_contours.max(problem.worse_by_moments(minimum.cost, own.cost, numbers)),
            _ => by_contours,
        }
    }

    /// Which of this place and another each region belongs to, by the contours where these decide.
    fn votes(&self, other: &Self) -> Vec<Vote> {
        match (&self.posterior, &other.posterior) {
            (None, None) => self.fit.votes(&other.fit),
            _ => vec![Vote::Neither; self.fit.regions().count()],
        }
    }

    /// What the fit shows of the pose; `ambiguous` where others fit as well.
    fn evidence(&self, problem: &Problem, ambiguous: bool) -> Evidence {
        let (covariance, overlaps) = (self.covariance(problem), self.overlaps(problem));
        match &self.posterior {
            Some(posterior) => {
                let unseen = |region: &SampledRegion| overlaps[region.index()].uncovered();
                let unseen: Vec<f64> = problem.sampled().iter().map(unseen).collect();
                Evidence::from_samples(posterior, problem.sampled(), &self.fit, covariance, &unseen)
            }
            None => {
                let errors: Vec<f64> = overlaps.iter().map(OverlapAreas::error).collect();
                Evidence::from_outlines(&self.fit, covariance, &errors, self.minimum.is_some(), ambiguous)
            }
        }
    }

    /// What places are sorted by: the moments' cost, or how unlikely the contours are.
    fn cost(&self) -> f64 {
        self.minimum.as_ref().map_or(-self.fit.mixture.likelihood, |minimum| minimum.cost)
    }
}

fn solution(problem: &Problem, place: Place, [share, confidence]: [f64; 2], frame_sigma: &FrameSigma) -> Solution {
    let (noise, factors) = (place.covariance(problem), place.region_factors(problem));
    let focal_shift = focal_shift(noise, &factors);
    let covariance = with_frame_error(noise, &factors, &focal_shift, problem.pixel_angle(), frame_sigma);
    let (overlap_error, region_overlap_errors) = errors_of(place.overlaps(problem));
    let Place { pose, minimum, fit, posterior, .. } = place;
    Solution {
        pose,
        minimum,
        fit,
        posterior,
        overlap_error,
        region_overlap_errors,
        covariance,
        focal_shift,
        confidence,
        share,
    }
}

/// Area of the symmetric difference over the observed area, of all regions together and of each.
pub fn overlap_errors(problem: &Problem, pose: &Pose) -> (f64, Vec<f64>) {
    errors_of(&region_overlaps(problem, pose))
}

fn errors_of(areas: &[OverlapAreas]) -> (f64, Vec<f64>) {
    let total = areas.iter().fold(OverlapAreas::default(), |sum, areas| sum + *areas);
    (total.error(), areas.iter().map(OverlapAreas::error).collect())
}

/// How each projected region covers the observed one.
fn region_overlaps(problem: &Problem, pose: &Pose) -> Vec<OverlapAreas> {
    let pairs = problem.regions().iter().zip(problem.worlds());
    pairs.map(|(region, world)| region_overlap(region, world, pose)).collect()
}

fn warnings(
    problem: &Problem,
    best: &Solution,
    alternatives: &[Solution],
    evidence: &Evidence,
    options: &Options,
    ended: Option<&Termination>,
) -> Vec<Warning> {
    let mut warnings = Vec::new();
    warnings.extend(ended.map(|termination| Warning::NotConverged { termination: termination.clone() }));
    let mut others: Vec<Way> = alternatives.iter().map(|other| way(&best.pose, &other.pose)).collect();
    others.sort_by(|a, b| a.degrees.total_cmp(&b.degrees));
    if !others.is_empty() {
        warnings.push(Warning::Ambiguous { others });
    }
    // Samples that leave a contour blurred do not agree on a place.
    let blurred = best.posterior.as_ref().is_some_and(|posterior| posterior.blur >= LOOSE);
    let trusted = evidence.probability() > TRUSTED && !blurred;
    let sampled: Vec<usize> = problem.sampled().iter().map(SampledRegion::index).collect();
    warnings.extend(region_warnings(best, alternatives, &sampled, trusted));
    warnings.extend(weak_geometry(problem, &best.pose, &best.covariance, &options.limits));
    warnings.extend(contradictions(problem, best, &options.prior));
    // Answers that are too unlikely to be named have their shares all the same.
    if warnings.is_empty() && !(trusted && best.confidence > TRUSTED) {
        warnings.push(Warning::LowConfidence { percent: 100.0 * best.confidence });
    }
    warnings
}

/// The warnings of regions that do not belong to the best pose, of those that fit no better than nothing and, unless the pose is
/// trusted, of those of which a part lies elsewhere; and of those that do not belong to a pose that fits alike.
fn region_warnings(best: &Solution, alternatives: &[Solution], sampled: &[usize], trusted: bool) -> Vec<Warning> {
    let contradicted = contradicted(&best.fit);
    let mut warnings: Vec<Warning> = outliers(best, sampled)
        .into_iter()
        .map(|Outlier { region, percent, others }| Warning::OutlierRegion { region, percent, others })
        .collect();
    let mut named: Vec<usize> = warnings.iter().filter_map(Warning::region).collect();
    for (region, &error) in best.region_overlap_errors.iter().enumerate() {
        let borne = trusted && error < NOT_SHOWN && !contradicted[region];
        if error >= POOR_OVERLAP && !borne && !sampled.contains(&region) && !named.contains(&region) {
            warnings.push(Warning::PoorOverlap { region, percent: 100.0 * error });
            named.push(region);
        }
    }
    for other in alternatives {
        let degrees = way(&best.pose, &other.pose).degrees;
        for Outlier { region, percent, others } in outliers(other, sampled) {
            if !named.contains(&region) {
                warnings.push(Warning::AmbiguousRegion { region, degrees, percent, others });
                named.push(region);
            }
        }
    }
    warnings
}

/// What was known beforehand and is not so at the pose.
fn contradictions(problem: &Problem, best: &Solution, prior: &Prior) -> Vec<Warning> {
    let (pose, covariance) = (&best.pose, &best.covariance);
    let initial = prior.from_initial(pose, covariance).filter(FromInitial::is_contradiction);
    let initial = initial.map(|from| Warning::InitialContradicted {
        degrees: from.rotation.to_degrees(),
        shift: from.place,
        sigmas: from.sigmas,
    });
    let up = prior.from_up(pose, covariance).filter(FromUp::is_contradiction);
    let up = up.map(|from| Warning::UpContradicted { degrees: from.angle.to_degrees(), sigmas: from.sigmas });
    let near = prior.from_near(pose, covariance).filter(FromNear::is_contradiction);
    let near = near.map(|from| Warning::PlaceContradicted { shift: from.place, sigmas: from.sigmas });
    let sides = problem.seen_from_behind(pose).into_iter().map(|region| Warning::SideContradicted { region });
    initial.into_iter().chain(up).chain(near).chain(sides).collect()
}

/// From a pose to another: the turn in the camera's axes, and how far the camera goes.
fn way(from: &Pose, to: &Pose) -> Way {
    let increment = from.increment_to(to);
    let (turn, shift) = (increment.fixed_rows::<3>(0).into_owned(), increment.fixed_rows::<3>(3).norm());
    Way { degrees: turn.norm().to_degrees(), axis: turn.try_normalize(0.0).unwrap_or_else(Vector3::zeros), shift }
}
