//! From minima to the poses that fit alike: by their moments, or led onto the contours where those speak for it.

use crate::contour::{Contour, ContourFit, contour_fit, refined};
use crate::equations::Weighting;
use crate::least_squares::Minimum;
use crate::pose::Pose;
use crate::solve::{Prior, Problem};

/// Costs nearer than this many variances of the noise are equal: symmetries of a shape differ by round-off alone.
const TIE_COST: f64 = 1e-3;

/// Step, in radians, in which poses of equal cost are put in order.
const TIE_STEP: f64 = 1e-3;

/// Difference of log likelihood over independent parts of the contour below which poses fit alike: five standard deviations.
const AMBIGUITY_LIKELIHOOD: f64 = 12.5;

/// Gain of log likelihood over independent parts of the contour below which a refined pose isn't preferred to the moments':
/// six parameters gain 3 by chance, and 7 more stand for odds of a thousand to one.
const DECISIVE_LIKELIHOOD: f64 = 10.0;

/// Minima that are led onto the contours at most, those of the least cost.
const MOST_REFINED: usize = 12;

/// Poses nearer than this, rad and share of the distance, are one place on the contours: both were led there.
const SAME_PLACE: f64 = 1e-3;

/// Poses of single regions that are led onto a few pieces of the contours at most, the likeliest ones, and those of them that
/// are led onto all.
const MOST_SINGLE: usize = 16;
const BEST_SINGLE: usize = 3;

/// Share of a region's contour on its projection below which the poses of single regions are tried as well: one region that
/// is wrong spoils the moments of all.
const LOST_SHARE: f64 = 0.25;

/// Scatter of the clean pieces, pixels, above which nothing counts as found yet.
const LOOSE: f64 = 2.0;

/// One piece in so many is looked at to tell whether contours are clean.
const CHECKED: usize = 4;

/// A minimum of the moment equations and the pose that it led to.
pub struct Place {
    /// The pose.
    pub pose: Pose,
    /// Where it was found from.
    pub minimum: Minimum,
    /// What the contours show there, where it was led onto them.
    pub contour: Option<ContourFit>,
}

impl Place {
    fn likelihood(&self) -> f64 {
        self.contour.as_ref().map_or(f64::NEG_INFINITY, |fit| fit.mixture.likelihood)
    }
}

impl Problem {
    /// The minima whose moments fit as well as the best one's, best first, those of equal cost by their rotations.
    pub fn by_moments(&self, minima: Vec<Minimum>) -> Vec<Place> {
        let least = minima.first().map_or(0.0, |minimum| minimum.cost);
        let limit = self.ambiguity_limit(least);
        let mut fitting: Vec<Minimum> = minima.into_iter().take_while(|minimum| minimum.cost <= limit).collect();
        let tie = least + TIE_COST * self.boundary_noise(least).powi(2);
        fitting.sort_by_key(|minimum| if minimum.cost <= tie { order(&minimum.pose) } else { [i64::MAX; 3] });
        fitting.into_iter().map(|minimum| Place { pose: minimum.pose, minimum, contour: None }).collect()
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
        let start = contour_fit(&contours, &first)?.mixture.likelihood;
        let known = prior.initial.map(|pose| self.given(pose));
        let mut places = self.led_onto(&contours, minima.iter().take(MOST_REFINED).cloned().chain(known));
        let lost =
            |fit: &ContourFit| fit.mixture.sigma > LOOSE || fit.clean_shares.iter().any(|&share| share < LOST_SHARE);
        if self.regions().len() > 1 && places.iter().all(|place| place.contour.as_ref().is_none_or(lost)) {
            places.extend(self.led_onto(&contours, self.of_single_regions(&few).into_iter()));
        }
        places.sort_by(|a, b| b.likelihood().total_cmp(&a.likelihood()));
        let greatest = places.first()?.likelihood();
        let independent = places.first()?.contour.as_ref()?.independent;
        if independent * (greatest - start) < DECISIVE_LIKELIHOOD {
            return None;
        }
        let least = greatest - AMBIGUITY_LIKELIHOOD / independent;
        let mut kept: Vec<Place> = Vec::new();
        for place in places {
            let new = kept.iter().all(|other| self.apart(&other.pose, &place.pose, SAME_PLACE));
            if place.likelihood() >= least && new {
                kept.push(place);
            }
        }
        Some(kept)
    }

    fn led_onto(&self, contours: &[Contour], minima: impl Iterator<Item = Minimum>) -> Vec<Place> {
        let led = |minimum: Minimum| {
            let fit = refined(contours, &self.centred(&minimum.pose))?;
            Some(Place { pose: self.uncentred(&fit.pose), minimum, contour: Some(fit) })
        };
        minima.filter_map(led).collect()
    }

    /// The poses of single regions that the contours of all find likeliest once they are led onto those.
    fn of_single_regions(&self, contours: &[Contour]) -> Vec<Minimum> {
        let single = self.single_region_poses().into_iter();
        let starts = likeliest(single.filter_map(|pose| contour_fit(contours, &pose)).collect(), MOST_SINGLE);
        let poses = likeliest(starts.iter().filter_map(|fit| refined(contours, &fit.pose)).collect(), BEST_SINGLE);
        poses.into_iter().map(|fit| self.given(self.uncentred(&fit.pose))).collect()
    }

    /// A pose that no least squares of the moments led to, as if it had.
    fn given(&self, pose: Pose) -> Minimum {
        let evaluation = self.evaluate(&pose, Weighting::Whitened);
        Minimum {
            pose,
            cost: evaluation.map_or(f64::INFINITY, |evaluation| evaluation.residual.norm_squared()),
            converged: true,
            termination: "led onto the contours from a start of its own".into(),
            evaluations: 1,
        }
    }
}

/// The likeliest fits, at most so many, the best first.
fn likeliest(mut fits: Vec<ContourFit>, most: usize) -> Vec<ContourFit> {
    fits.sort_by(|a, b| b.mixture.likelihood.total_cmp(&a.mixture.likelihood));
    fits.truncate(most);
    fits
}

/// Where a pose comes among those of equal cost: by its rotation vector, in steps that round-off does not cross but by chance.
fn order(pose: &Pose) -> [i64; 3] {
    let turn = pose.rotation.scaled_axis();
    [turn.x, turn.y, turn.z].map(|component| (component / TIE_STEP).round() as i64)
}
