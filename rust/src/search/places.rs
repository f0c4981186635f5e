//! From minima to the poses that fit alike: by their moments, or led onto the contours where those speak for it.

use nalgebra::Matrix6;

use crate::contour::distance::{Contour, ContourFit, contour_fit, misfit, refined};
use crate::equations::least_squares::{Minimum, Termination};
use crate::equations::system::Weighting;
use crate::geometry::pose::Pose;
use crate::prior::Prior;
use crate::region::WorldRegion;
use crate::search::candidates::{AMBIGUITY_COST, Problem, apart};
use crate::search::corners::{corner_poses, is_plausible, projected_area};

/// Costs nearer than this many variances of the noise are equal: symmetries of a shape differ by round-off alone.
const TIE_COST: f64 = 1e-3;

/// Step, in radians, in which poses of equal cost are put in order.
const TIE_STEP: f64 = 1e-3;

/// Gain of log likelihood over independent parts of the contour below which a refined pose isn't preferred to the moments':
/// six parameters gain 3 by chance, and 7 more stand for odds of a thousand to one.
const DECISIVE_LIKELIHOOD: f64 = 10.0;

/// Standard deviations of chance by which a pose is likelier than another for these not to fit alike: above what the turns of
/// symmetric shapes differ by, below what poses do that fit worse.
const UNDECIDED: f64 = 1.2;

/// Share of the contours that a pose must fit less of than the best to be told from it: more than the turns of symmetric shapes
/// differ by where a part is hidden.
const LEAST_LOST: f64 = 0.1;

/// Twice the gain of log likelihood up to which chance may decide.
const MOST_UNDECIDED: f64 = 100.0;

/// Minima that are led onto the contours at most, those of the least cost.
const MOST_REFINED: usize = 12;

/// Poses nearer than this, rad and share of the distance, are one place on the contours: both were led there.
const SAME_PLACE: f64 = 1e-3;

/// Poses nearer than this, rad and share of the distance, are one start for all pieces.
const SAME_START: f64 = 0.01;

/// Places that are led from few pieces onto all: the likeliest ones, and others that could be as likely.
const FEWEST_LED: usize = 3;
const MOST_LED: usize = 16;

/// Share of a region's contour on its projection below which further starts are tried.
const LOST_SHARE: f64 = 0.25;

/// The same of a region alone.
const LOST_ALONE: f64 = 0.9;

/// Share of each contour on its projection from which a pose is found where its start is not.
const FIRM_SHARE: f64 = 0.5;

/// Pairs of triples of corners at most, over all regions.
const MOST_PAIRS: usize = 4000;

/// Pieces of all contours, and of one at least, on which further poses are compared.
const SKETCHED: usize = 80;
const FEWEST_SKETCHED: usize = 40;

/// Distance of a boundary's vertex from its neighbours' line, as a share of the square root of the area, that a comparison
/// leaves out.
const SKETCH_TOLERANCE: f64 = 0.005;

/// Distance, pixels, at which a piece no longer speaks for a pose: that of corners' noise.
const MISFIT_SCALE: f64 = 3.0;

/// Further poses of the first comparison, of a part of the pieces, that go into the second.
const FIRST_LOOK: usize = 250;

/// Kinds of further poses that are led onto the contours, and how far they are apart at least, rad and share of the
/// distance.
const MOST_FURTHER: usize = 16;
const SAME_FURTHER: f64 = 0.05;

/// Difference of the misfits of one kind: that of round-off.
const SAME_MISFIT: f64 = 1e-7;

/// Scatter of the clean pieces, pixels, above which nothing counts as found yet.
const LOOSE: f64 = 2.0;

/// One piece in so many is looked at to tell whether contours are clean.
pub(crate) const CHECKED: usize = 4;

/// A minimum of the moment equations and the pose that it led to.
pub struct Place {
    /// The pose.
    pub pose: Pose,
    /// Where it was found from.
    pub minimum: Minimum,
    /// What the contours show there, where it was led onto them.
    pub contour: Option<ContourFit>,
    /// How much worse than the best it fits, in variances of the noise.
    pub misfit: f64,
}

impl Place {
    /// Likelihood against that of the best place.
    pub fn weight(&self) -> f64 {
        (-0.5 * self.misfit).exp()
    }

    fn likelihood(&self) -> f64 {
        self.contour.as_ref().map_or(f64::NEG_INFINITY, |fit| fit.mixture.likelihood)
    }
}

impl Problem {
    /// The minima whose moments fit as well as the best one's, or could with the prior, best first, those of equal cost by
    /// their rotations.
    pub fn by_moments(&self, minima: Vec<Minimum>, prior: &Prior) -> Vec<Place> {
        let least = minima.first().map_or(0.0, |minimum| minimum.cost);
        let limit = self.ambiguity_limit(least, self.most_penalty(prior));
        let fitting = minima.into_iter().take_while(|minimum| minimum.cost <= limit);
        let variance = self.boundary_noise(least).powi(2);
        let misfit = |minimum: &Minimum| (minimum.cost - least) / variance;
        let tied = |misfit: f64| if misfit <= TIE_COST { 0.0 } else { misfit };
        let place = |minimum: Minimum| {
            let misfit = tied(misfit(&minimum));
            Place { pose: minimum.pose, minimum, contour: None, misfit }
        };
        let mut places: Vec<Place> = fitting.map(place).collect();
        places.sort_by_key(|place| if place.misfit == 0.0 { order(&place.pose) } else { [i64::MAX; 3] });
        places
    }

    /// The minima led onto the observed contours, those that fit as well as the best; `None` where the contours are clean or
    /// disturbed all over: the moments, which average over the whole region, are then the better measure.
    pub fn on_contours(&self, minima: &[Minimum], prior: &Prior) -> Option<Vec<Place>> {
        let contours = self.contours();
        let few: Vec<Contour> = contours.iter().map(|contour| contour.thinned(CHECKED)).collect();
        let first = self.centred(&minima.first()?.pose);
        if contour_fit(&few, &first)?.is_clean {
            return None;
        }
        let start = contour_fit(&contours, &first)?;
        let mut places = by_likelihood(self.led_onto(&contours, self.likeliest_starts(&contours, &few, minima, prior)));
        let turned = self.led_onto(&few, self.turned_starts(&contours, places.first()?));
        places.extend(self.led_onto(&contours, self.likely_starts(turned, MOST_UNDECIDED, prior)));
        let places = by_likelihood(places);
        let best = places.first()?.contour.as_ref()?;
        let gain = best.independent * (best.mixture.likelihood - start.mixture.likelihood);
        // Parts hidden as one leave few that are independent, however well the others are found.
        let found = gain > 0.0 && is_firm(best) && !is_firm(&start);
        if gain < DECISIVE_LIKELIHOOD && !found {
            return None;
        }
        let best = best.clone();
        let misfit = |place: &Place| place.contour.as_ref().map_or(f64::INFINITY, |fit| misfit_against(&best, fit));
        let places = places.into_iter().map(|place| Place { misfit: misfit(&place), ..place }).collect();
        let worst = AMBIGUITY_COST + self.most_penalty(prior);
        Some(self.each_once(places, SAME_PLACE, |place, _| place.misfit <= worst))
    }

    /// Where to lead poses onto all pieces from: the minima, and further starts where none of these is found, each led onto
    /// few pieces and kept if it could be as likely as the best.
    fn likeliest_starts(
        &self,
        contours: &[Contour],
        few: &[Contour],
        minima: &[Minimum],
        prior: &Prior,
    ) -> Vec<Minimum> {
        let known = prior.initial.map(|pose| self.given(pose));
        let mut places = self.led_onto(few, self.likeliest_minima(minima, prior).into_iter().chain(known));
        if places.iter().all(|place| place.contour.as_ref().is_none_or(is_lost)) {
            let further = self.further_poses(contours);
            places.extend(self.led_onto(few, further.iter().map(|pose| self.given(self.uncentred(pose)))));
        }
        self.likely_starts(places, AMBIGUITY_COST, prior)
    }

    /// The places that could be as likely as the best, each once, as starts.
    fn likely_starts(&self, places: Vec<Place>, most: f64, prior: &Prior) -> Vec<Minimum> {
        let places = by_likelihood(places);
        let best = places.first().and_then(|place| place.contour.as_ref());
        let worst = 0.5 * (most + self.most_penalty(prior));
        let least = best.map_or(0.0, |fit| fit.mixture.likelihood - worst / fit.independent);
        let wanted = |place: &Place, kept: usize| kept < FEWEST_LED || (kept < MOST_LED && place.likelihood() >= least);
        let kept = self.each_once(places, SAME_START, wanted);
        kept.into_iter().map(|place| Minimum { pose: place.pose, ..place.minimum }).collect()
    }

    /// A place turned in the plane of all regions to wherever they look much the same.
    fn turned_starts(&self, contours: &[Contour], place: &Place) -> Vec<Minimum> {
        let sketches: Vec<Contour> = self.sketches(contours).iter().map(|sketch| sketch.thinned(2)).collect();
        let turned = self.turned_poses(&sketches, &self.centred(&place.pose), MISFIT_SCALE);
        turned.iter().map(|pose| self.given(self.uncentred(pose))).collect()
    }

    /// Places in their order that are wanted, beside how many are kept already, each pose once.
    fn each_once(&self, places: Vec<Place>, limit: f64, wanted: impl Fn(&Place, usize) -> bool) -> Vec<Place> {
        let mut kept: Vec<Place> = Vec::new();
        for place in places {
            let new = kept.iter().all(|other| self.apart(&other.pose, &place.pose, limit));
            if new && wanted(&place, kept.len()) {
                kept.push(place);
            }
        }
        kept
    }

    /// The minima of the least cost, the prior weighed in.
    fn likeliest_minima(&self, minima: &[Minimum], prior: &Prior) -> Vec<Minimum> {
        let variance = self.boundary_noise(minima.first().map_or(0.0, |minimum| minimum.cost)).powi(2);
        let known = Matrix6::zeros();
        let score = |minimum: &Minimum| minimum.cost / variance + self.penalty(&minimum.pose, &known, prior);
        let mut scored: Vec<(f64, &Minimum)> = minima.iter().map(|minimum| (score(minimum), minimum)).collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        scored.into_iter().take(MOST_REFINED).map(|(_, minimum)| minimum.clone()).collect()
    }

    fn led_onto(&self, contours: &[Contour], minima: impl IntoIterator<Item = Minimum>) -> Vec<Place> {
        let led = |minimum: Minimum| {
            let fit = refined(contours, &self.centred(&minimum.pose))?;
            let plausible = self.is_plausible(&self.uncentred(&fit.pose));
            plausible.then(|| Place { pose: self.uncentred(&fit.pose), minimum, contour: Some(fit), misfit: 0.0 })
        };
        minima.into_iter().filter_map(led).collect()
    }

    /// Poses from corners and, of several regions, from each by itself, that lie nearest to the contours of all, led onto few
    /// pieces of them; about the problem's origin.
    fn further_poses(&self, contours: &[Contour]) -> Vec<Pose> {
        let sketch = self.sketches(contours);
        let rough: Vec<Contour> = sketch.iter().map(|contour| contour.thinned(CHECKED)).collect();
        let corners = nearest(&rough, self.poses_of_corners(), FIRST_LOOK).into_iter().map(|(_, pose)| pose).collect();
        let mut kinds = alike(nearest(&sketch, corners, FIRST_LOOK));
        if contours.len() > 1 {
            kinds.extend(alike(nearest(&sketch, self.single_region_poses(), FIRST_LOOK)));
        }
        let led = |kind: Vec<Pose>| Some((refined(&sketch, kind.first()?)?, kind));
        let mut fits: Vec<(ContourFit, Vec<Pose>)> = kinds.into_iter().filter_map(led).collect();
        fits.sort_by(|a, b| b.0.mixture.likelihood.total_cmp(&a.0.mixture.likelihood));
        let symmetric: Vec<Pose> = fits.iter().flat_map(|(_, kind)| kind[1..].iter().copied()).collect();
        let mut poses = distinct_poses(fits.into_iter().map(|(fit, _)| fit.pose), MOST_REFINED, SAME_START);
        poses.extend(distinct_poses(symmetric.into_iter(), MOST_LED, SAME_FURTHER));
        poses
    }

    /// A part of the contours' pieces and of the boundaries' vertices, for a first look.
    fn sketches(&self, contours: &[Contour]) -> Vec<Contour> {
        let pieces = (SKETCHED / contours.len()).max(FEWEST_SKETCHED);
        let tolerance = |world: &WorldRegion| SKETCH_TOLERANCE * world.outline().area().sqrt();
        let pairs = contours.iter().zip(self.worlds());
        pairs.map(|(contour, world)| contour.sketched(pieces, tolerance(world))).collect()
    }

    /// Whether a region by itself is seen about as large as it is observed; of several, one may be wrong.
    fn is_plausible(&self, pose: &Pose) -> bool {
        let ([region], [world]) = (self.regions(), self.worlds()) else { return true };
        projected_area(region.chart(), &world.rings(), pose).is_some_and(is_plausible)
    }

    /// The poses of every region's corners, about the problem's origin.
    fn poses_of_corners(&self) -> Vec<Pose> {
        let most = MOST_PAIRS / self.regions().len();
        let pairs = self.regions().iter().zip(self.worlds());
        let poses = pairs.flat_map(|(region, world)| {
            let pixel = region.pixel_area().sqrt().recip();
            corner_poses(region.chart(), region.outline(), world, self.origin(), pixel, most)
        });
        poses.collect()
    }

    /// A pose that no least squares of the moments led to, as if it had.
    fn given(&self, pose: Pose) -> Minimum {
        let evaluation = self.evaluate(&pose, Weighting::Whitened);
        Minimum {
            pose,
            cost: evaluation.map_or(f64::INFINITY, |evaluation| evaluation.residual.norm_squared()),
            converged: true,
            termination: Termination::Foreign("led onto the contours from a start of its own".into()),
            evaluations: 1,
        }
    }
}

fn by_likelihood(mut places: Vec<Place>) -> Vec<Place> {
    places.sort_by(|a, b| b.likelihood().total_cmp(&a.likelihood()));
    places
}

/// How much worse a place fits than the best one, in variances: twice the gain of log likelihood, or what is left of that where
/// chance may have decided; but no less than the share of the contours tells that it doesn't fit.
fn misfit_against(best: &ContourFit, fit: &ContourFit) -> f64 {
    let gain = 2.0 * best.independent * (best.mixture.likelihood - fit.mixture.likelihood);
    let by_chance = AMBIGUITY_COST * (best.sigmas_above(fit) / UNDECIDED).powi(2);
    let lost = (best.share_at(best) - best.share_at(fit)) / LEAST_LOST;
    gain.min(by_chance).max(AMBIGUITY_COST * lost.max(0.0).powi(2))
}

/// Whether too little of the contours is clean to take a place for the true one: of one region that is lost the moments of
/// all are spoilt, and three sides of a region alone can be led onto any three lines.
fn is_lost(fit: &ContourFit) -> bool {
    let least = if fit.clean_shares.len() > 1 { LOST_SHARE } else { LOST_ALONE };
    fit.mixture.sigma > LOOSE || fit.clean_shares.iter().any(|&share| share < least)
}

/// Whether at least half of every contour is clean.
fn is_firm(fit: &ContourFit) -> bool {
    fit.mixture.sigma < LOOSE && fit.clean_shares.iter().all(|&share| share >= FIRM_SHARE)
}

/// The poses nearest to the contours, at most so many, and their misfits, the best first.
fn nearest(contours: &[Contour], poses: Vec<Pose>, most: usize) -> Vec<(f64, Pose)> {
    let scored = |pose: Pose| Some((misfit(contours, &pose, MISFIT_SCALE)?, pose));
    let mut scores: Vec<(f64, Pose)> = poses.into_iter().filter_map(scored).collect();
    scores.sort_by(|a, b| a.0.total_cmp(&b.0));
    scores.truncate(most);
    scores
}

/// The first kinds of poses: a symmetric region looks the same from several, which are one kind.
fn alike(scores: Vec<(f64, Pose)>) -> Vec<Vec<Pose>> {
    let mut kinds: Vec<(f64, Vec<Pose>)> = Vec::new();
    for (score, pose) in scores {
        let known = |kind: &(f64, Vec<Pose>)| kind.1.iter().any(|other| !apart(other, &pose, SAME_FURTHER));
        if kinds.iter().any(known) {
            continue;
        }
        let count = kinds.len();
        match kinds.last_mut() {
            Some((last, kind)) if score - *last < SAME_MISFIT => kind.push(pose),
            _ if count < MOST_FURTHER => kinds.push((score, vec![pose])),
            _ => break,
        }
    }
    kinds.into_iter().map(|(_, kind)| kind).collect()
}

/// The first poses, at most so many, that are farther apart than a limit.
fn distinct_poses(poses: impl Iterator<Item = Pose>, most: usize, limit: f64) -> Vec<Pose> {
    let mut kept: Vec<Pose> = Vec::new();
    for pose in poses {
        if kept.len() < most && kept.iter().all(|other| apart(other, &pose, limit)) {
            kept.push(pose);
        }
    }
    kept
}

/// Where a pose comes among those of equal cost: by its rotation vector, in steps that round-off does not cross but by chance.
fn order(pose: &Pose) -> [i64; 3] {
    let turn = pose.rotation.scaled_axis();
    [turn.x, turn.y, turn.z].map(|component| (component / TIE_STEP).round() as i64)
}
