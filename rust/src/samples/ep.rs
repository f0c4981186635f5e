//! Expectation propagation (Minka 2001): the normal posterior of the increment given labels, and the evidence (`docs/math.md`, eq. 17.4 to
//! 17.8, 17.10).

use std::f64::consts::PI;

use nalgebra::{Matrix6, Vector6};

use super::chain::SegmentRing;
use super::margin::{EDGES_PER_PROJECTION, SampledRegion};
use super::probit_site::LabelSite;
use super::quadrature::EDGES_PER_LABEL;
use super::segment::{ContourSegment, DILATED, INCREMENT, STATES, StateMoments};
use crate::budget::Budget;
use crate::math::gaussian::{Gaussian, Normal};

/// Sweeps over all sites at most.
const MAX_SWEEPS: usize = 6;

/// Work of a sweep for each label, in edges: a quadrature for each state of its segment.
const EDGES_PER_SWEEP: usize = EDGES_PER_LABEL * STATES;

/// A sweep that moves the mean by less than this many of its standard deviations, in all directions together, is the last; or by less
/// than this share of how far the mean lies from the pose of the linearization, which is made anew there: that far off, its own error is
/// larger. With none of that share answers are as good and take 1.3 times as long (`python -m benchmarks trust --only model=combined`).
const CONVERGED_SIGMAS: f64 = 0.05;
const CONVERGED_SHARE: f64 = 0.25;

/// By how much the log evidence may exceed that of certain labels, since it is approximate: a convention. Where factors diverge it is off by
/// hundreds and more.
const EVIDENCE_TOLERANCE: f64 = 1.0;

/// Sweeps have diverged where the last one still moves the mean by more than this many standard deviations: a convention.
const DIVERGED_SIGMAS: f64 = 0.5;

/// The contour of a region with samples beside it: dilated all around, and off at its corners (`docs/math.md`, eq. 17.4).
#[derive(Debug, Clone)]
pub struct ContourFactor {
    /// Index among the regions with samples.
    pub region: usize,
    /// Standard deviation of its dilation, pixels.
    pub dilation_sigma: f64,
    /// Its rings with samples beside them.
    pub rings: Vec<SegmentRing>,
}

/// Moments of a contour's segments.
#[derive(Debug, Clone)]
pub struct ContourMoments {
    /// Of each segment with samples, in each state.
    pub segments: Vec<[StateMoments; STATES]>,
    /// Log probability of the labels.
    pub log_probability: f64,
    /// Whether all quadratures have converged; the moments are invalid otherwise.
    pub has_converged: bool,
}

impl ContourFactor {
    /// Its segments with samples.
    pub fn segments(&self) -> impl Iterator<Item = &ContourSegment> {
        self.rings.iter().flat_map(|ring| &ring.segments).filter(|segment| !segment.members.is_empty())
    }

    /// Its segments with samples, mutable.
    pub fn segments_mut(&mut self) -> impl Iterator<Item = &mut ContourSegment> {
        let segments = self.rings.iter_mut().flat_map(|ring| &mut ring.segments);
        segments.filter(|segment| !segment.members.is_empty())
    }

    /// Shifts its sites to increments about a pose that lies farther by `increment`.
    pub fn retract(&mut self, increment: &Vector6<f64>) {
        self.segments_mut().for_each(|segment| segment.retract(increment));
    }

    /// Its message to the increment, up to a multiple.
    pub fn message(&self) -> Gaussian {
        self.message_of(&self.factors())
    }

    /// Fits the ends of its segments to linearized samples.
    fn fit_ends<S: AsRef<LabelSite>>(&mut self, sites: &[S]) {
        self.segments_mut().for_each(|segment| segment.fit_ends(sites));
    }

    /// Takes the labels of the samples beside its segments, under a covariance of the increment.
    fn set_labels<S: AsRef<LabelSite>>(&mut self, sites: &[S], covariance: &Matrix6<f64>) {
        self.segments_mut().for_each(|segment| segment.set_labels(sites, covariance));
    }

    /// Updates its segments one by one, with this cavity of the increment; returns its message then, or `None` where a distribution is
    /// not normalizable.
    fn sweep(&mut self, cavity: &Gaussian) -> Option<Gaussian> {
        let (product, mut factors) = (cavity.embed() + self.dilation(), self.factors());
        let (behind, mut before) = (suffix_products(&factors), product);
        for (number, ring) in self.rings.iter_mut().enumerate() {
            factors[number] = ring.sweep(&(before + behind[number]))?;
            before = before + factors[number];
        }
        Some(self.message_of(&factors))
    }

    /// Moments of its segments, with this cavity of the increment; `None` where a distribution is not normalizable. Those of the last
    /// sweep where it `has_settled`: the evidence is stationary in each segment's cavity, at which its moments are matched.
    fn moments(&mut self, cavity: &Gaussian, has_settled: bool) -> Option<ContourMoments> {
        let (product, factors) = (cavity.embed() + self.dilation(), self.factors());
        let (_, mut log_probability) = factors.iter().fold(product, |all, factor| all + *factor).normalize()?;
        let (behind, mut before, mut segments) = (suffix_products(&factors), product, Vec::new());
        for (number, ring) in self.rings.iter_mut().enumerate() {
            let updated = if has_settled { ring.updated_moments() } else { None };
            let (moments, log_scale) = match updated {
                Some(updated) => updated,
                None => ring.moments(&(before + behind[number]))?,
            };
            before = before + factors[number];
            segments.extend(moments);
            log_probability += log_scale;
        }
        let has_converged = segments.iter().flatten().all(|moments| moments.has_converged);
        Some(ContourMoments { segments, log_probability, has_converged })
    }

    /// Factors of increment and dilation of its rings.
    fn factors(&self) -> Vec<Gaussian<DILATED>> {
        self.rings.iter().map(SegmentRing::factor).collect()
    }

    fn message_of(&self, factors: &[Gaussian<DILATED>]) -> Gaussian {
        let product = factors.iter().fold(self.dilation(), |product, factor| product + *factor);
        Gaussian { offset: 0.0, ..product.marginal() }
    }

    /// Density of its dilation.
    fn dilation(&self) -> Gaussian<DILATED> {
        let offset = -self.dilation_sigma.ln() - 0.5 * (2.0 * PI).ln();
        let mut factor = Gaussian { offset, ..Gaussian::default() };
        factor.information[(INCREMENT, INCREMENT)] = self.dilation_sigma.powi(-2);
        factor
    }
}

/// The product of the factors behind each.
fn suffix_products(factors: &[Gaussian<DILATED>]) -> Vec<Gaussian<DILATED>> {
    let mut behind = vec![Gaussian::default(); factors.len()];
    for number in (1..factors.len()).rev() {
        behind[number - 1] = behind[number] + factors[number];
    }
    behind
}

/// Posterior of the increment by expectation propagation.
#[derive(Debug, Clone)]
pub struct EpPosterior {
    /// Of the increment.
    pub increment: Normal,
    /// Moments of each contour; none of independent samples.
    pub contours: Vec<ContourMoments>,
    /// Log evidence; invalid where sweeps have not converged.
    pub log_evidence: f64,
    /// Whether the last sweep moved the mean by little, and all quadratures have converged.
    pub has_converged: bool,
}

/// Posterior of the increment given labels whose samples share the offsets of contour segments; the segments keep their sites, which
/// start the next call.
///
/// In the first sweep `guard` stands in for messages that segments don't have yet: without it the cavity of the first one would be so wide
/// that its labels contradict one another. `None` where a direction is left free, or the evidence exceeds that of certain labels.
///
/// Contours meet in the increment alone, and segments of one contour in increment and dilation: the cavity of each is the product of all
/// other messages.
pub fn run_ep<S: AsRef<LabelSite>>(
    prior: &Gaussian,
    guard: &Gaussian,
    sites: &[S],
    contours: &mut [ContourFactor],
    budget: &Budget,
) -> Option<EpPosterior> {
    contours.iter_mut().for_each(|contour| contour.fit_ends(sites));
    let mut messages: Vec<Gaussian> = contours.iter().map(ContourFactor::message).collect();
    let product_of = |messages: &[Gaussian]| messages.iter().fold(*prior, |product, message| product + *message);
    let mut product = product_of(&messages) + *guard;
    let start = product.normalize()?.0;
    contours.iter_mut().for_each(|contour| contour.set_labels(sites, &start.covariance));
    let sweep = |_| {
        for (contour, message) in contours.iter_mut().zip(&mut messages) {
            let cavity = product - *message;
            *message = contour.sweep(&cavity)?;
            product = cavity + *message;
        }
        // Recomputed from all messages: rounding errors of differences add up.
        product = product_of(&messages);
        Some(product.normalize()?.0)
    };
    let sweeps = run_sweeps(start, sites.len(), sweep, budget)?;
    let (increment, log_integral) = product.normalize()?;
    // The guard is in the cavities of the first sweep.
    let has_settled = sweeps.have_settled && (sweeps.count > 1 || *guard == Gaussian::default());
    let pairs = contours.iter_mut().zip(&messages);
    let moments = pairs.map(|(contour, message)| contour.moments(&(product - *message), has_settled));
    let moments: Vec<ContourMoments> = moments.collect::<Option<_>>()?;
    let log_evidence = log_integral + moments.iter().map(|contour| contour.log_probability - log_integral).sum::<f64>();
    // No labels are likelier than certain ones: where factors diverge, the evidence may be any number.
    let (_, log_evidence_of_certain) = prior.normalize()?;
    if log_evidence > log_evidence_of_certain + EVIDENCE_TOLERANCE {
        return None;
    }
    let has_converged = sweeps.shift < DIVERGED_SIGMAS && moments.iter().all(|contour| contour.has_converged);
    Some(EpPosterior { increment, contours: moments, log_evidence, has_converged })
}

/// Posterior of the increment given independent labels, whose sites keep their factors; `guard` as of [`run_ep`].
///
/// The tilted moments of one label have a closed form, without the quadrature of a segment's two ends: 200 labels take a hundredth of the
/// time that as many segments of one sample do.
pub fn run_ep_independent<S: AsMut<LabelSite> + AsRef<LabelSite>>(
    prior: &Gaussian,
    guard: &Gaussian,
    sites: &mut [S],
    budget: &Budget,
) -> Option<EpPosterior> {
    let product_of = |sites: &[S]| {
        let mut product = *prior;
        sites.iter().for_each(|site| site.as_ref().multiply_into(&mut product));
        product
    };
    let start = (product_of(sites) + *guard).normalize()?.0;
    let count = sites.len();
    let sweep = |mut increment: Normal| {
        sites.iter_mut().for_each(|site| site.as_mut().update(&mut increment));
        Some(product_of(sites).normalize()?.0)
    };
    let Sweeps { shift, .. } = run_sweeps(start, count, sweep, budget)?;
    let (increment, log_integral) = product_of(sites).normalize()?;
    let log_evidence = log_integral + sites.iter().map(|site| site.as_ref().log_scale(&increment)).sum::<f64>();
    Some(EpPosterior { increment, contours: Vec::new(), log_evidence, has_converged: shift < DIVERGED_SIGMAS })
}

/// How sweeps ended.
struct Sweeps {
    count: usize,
    /// How far the last one moved the mean, in standard deviations.
    shift: f64,
    /// Whether that is so little that it is the last.
    have_settled: bool,
}

/// Sweeps from a distribution of the increment to the next one until the mean stays; `None` where a direction is left free, or the
/// search is stopped.
fn run_sweeps(
    start: Normal,
    labels: usize,
    mut sweep: impl FnMut(Normal) -> Option<Normal>,
    budget: &Budget,
) -> Option<Sweeps> {
    let (mut increment, mut shift) = (start, f64::INFINITY);
    for count in 1..=MAX_SWEEPS {
        budget.charge(EDGES_PER_SWEEP * labels);
        if budget.is_canceled() {
            return None;
        }
        let before = increment.mean;
        increment = sweep(increment)?;
        shift = sigmas_between(&increment, &before)?;
        let from_pose = sigmas_between(&increment, &Vector6::zeros())?;
        if shift < CONVERGED_SIGMAS.max(CONVERGED_SHARE * from_pose) {
            return Some(Sweeps { count, shift, have_settled: true });
        }
    }
    Some(Sweeps { count: MAX_SWEEPS, shift, have_settled: false })
}

/// Mahalanobis distance of a point from the mean; `None` where a direction is left free.
fn sigmas_between(increment: &Normal, point: &Vector6<f64>) -> Option<f64> {
    let offset = increment.mean - point;
    Some(offset.dot(&increment.covariance.cholesky()?.solve(&offset)).sqrt())
}

/// Work of one run over all samples of a region, in edges: their projection and all sweeps.
pub fn work(region: &SampledRegion) -> usize {
    region.count() * (EDGES_PER_PROJECTION + MAX_SWEEPS * EDGES_PER_SWEEP)
}
