//! A contour segment: a site of expectation propagation for all labels beside it, in the offsets of its two ends, which is a mixture over
//! the segment's states (`docs/math.md`, eq. 17.4, 17.10).

use nalgebra::{Matrix2, Matrix6, SMatrix, Vector2, Vector6};

use super::label_model::LabelPosterior;
use super::probit_site::LabelSite;
use super::quadrature::{ENDS, SegmentLabel, TiltedMoments, tilted_moments};
use crate::math::gaussian::{Gaussian, Normal};

/// Components of a left increment.
pub(super) const INCREMENT: usize = 6;

/// Components of a left increment and of the dilation of a contour, pixels outward.
pub(super) const DILATED: usize = INCREMENT + 1;

/// Weight of the penalty on a tilt of the segment in the fit of its ends, against one label: labels at one place move both ends alike.
const TILT_PENALTY: f64 = 1e-6;

/// Rotations of the eigenvalue iteration at most; two dimensions need one.
const MAX_ROTATIONS: usize = 10;

/// States of a segment: clean and disturbed.
pub const STATES: usize = 2;

/// Prior of a segment's state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentState {
    /// Stationary probability: the fraction of the contour in this state.
    pub probability: f64,
    /// Standard deviation of the offset of either end from its corner, pixels; 0 in the clean state.
    pub sigma: f64,
}

/// A segment of a contour, and the samples beside it.
#[derive(Debug, Clone)]
pub struct ContourSegment {
    /// Number on the contour.
    pub number: usize,
    /// Unit normal in the contour's plane.
    pub normal: Vector2<f64>,
    /// Length, pixels.
    pub length: f64,
    /// Indices of the samples beside it.
    pub members: Vec<usize>,
    /// Priors of its states.
    pub states: [SegmentState; STATES],
    /// Its site, which stays as samples are linearized again.
    pub site: SegmentSite,
    /// Derivative of its ends' outward offsets by increment and dilation.
    ends: SMatrix<f64, ENDS, DILATED>,
    /// The labels of its samples.
    labels: Vec<SegmentLabel>,
    /// Its moments when its message was last updated, with these labels.
    updated: Option<SegmentMoments>,
}

/// Moments of a segment's ends in each state, and the logarithm of the integral of its message times its cavity.
pub(super) type SegmentMoments = ([StateMoments; STATES], f64);

/// The site of a segment: its message to the offsets of the ends and to the chain of states.
#[derive(Debug, Clone, Copy)]
pub struct SegmentSite {
    /// Posterior probability of each state.
    pub probabilities: [f64; STATES],
    /// Log probability of the labels in each state.
    pub(super) log_likelihoods: [f64; STATES],
    /// Normal factor of the ends that stands for all labels, up to a multiple.
    pub(super) message: Gaussian<ENDS>,
    /// Tilted moments of the ends in each state, which seed the next quadrature.
    seeds: [Option<Normal<ENDS>>; STATES],
}

/// Moments of a segment's ends in one state.
#[derive(Debug, Clone, Copy)]
pub struct StateMoments {
    /// Of the ends with the state's own offsets.
    pub ends: Normal<ENDS>,
    /// Of the ends without these.
    without_offsets: Normal<ENDS>,
    /// Mean square of the state's offsets of both ends.
    pub mean_square: f64,
    /// Log probability of the labels.
    log_probability: f64,
    /// Whether the quadrature has converged; the moments are invalid otherwise.
    pub(super) has_converged: bool,
}

impl ContourSegment {
    /// A segment with these priors of its states, before any message.
    pub fn new(
        number: usize,
        normal: Vector2<f64>,
        length: f64,
        members: Vec<usize>,
        states: [SegmentState; STATES],
    ) -> Self {
        let site = SegmentSite {
            probabilities: states.map(|state| state.probability),
            log_likelihoods: [0.0; STATES],
            message: Gaussian::default(),
            seeds: [None; STATES],
        };
        Self {
            number,
            normal,
            length,
            members,
            states,
            site,
            ends: SMatrix::zeros(),
            labels: Vec::new(),
            updated: None,
        }
    }

    /// Fits the derivative of its ends to the gradients of its samples by least squares, without those at corners if there are others.
    pub(super) fn fit_ends<S: AsRef<LabelSite>>(&mut self, sites: &[S]) {
        let members = || self.members.iter().map(|&member| sites[member].as_ref());
        let only_corners = members().all(|site| site.is_at_corner());
        let (mut products, mut gradients) = (Matrix2::zeros(), SMatrix::<f64, ENDS, INCREMENT>::zeros());
        for site in members().filter(|site| only_corners || !site.is_at_corner()) {
            let weights = Vector2::new(1.0 - site.along, site.along);
            let tilt = Vector2::new(1.0, -1.0);
            products += weights * weights.transpose() + tilt * tilt.transpose() * TILT_PENALTY;
            gradients += weights * site.gradient.transpose() * site.outward;
        }
        let ends = products.try_inverse().map_or(gradients, |inverse| inverse * gradients);
        self.ends.fixed_view_mut::<ENDS, INCREMENT>(0, 0).copy_from(&ends);
        self.ends.set_column(INCREMENT, &Vector2::repeat(1.0));
    }

    /// Takes the labels of its samples as functions of its ends. What the ends don't explain of a margin adds variance, under a
    /// covariance of the increment.
    pub(super) fn set_labels<S: AsRef<LabelSite>>(&mut self, sites: &[S], covariance: &Matrix6<f64>) {
        let ends = self.ends.fixed_columns::<INCREMENT>(0);
        let label = |&member: &usize| {
            let site = sites[member].as_ref();
            let weights = Vector2::new(1.0 - site.along, site.along) * site.outward;
            let residual: Vector6<f64> = site.gradient - ends.transpose() * weights;
            let variance = site.linearization_variance + residual.dot(&(covariance * residual));
            SegmentLabel { margin: site.margin, weights, variance, edge: site.edge, model: site.model }
        };
        self.labels = self.members.iter().map(label).collect();
        self.updated = None;
    }

    /// Derivative of its ends' outward offsets by increment and dilation.
    pub(super) fn ends(&self) -> &SMatrix<f64, ENDS, DILATED> {
        &self.ends
    }

    /// Cavity distribution of its ends, whose distribution by all messages is `ends`; `None` where it is not normalizable.
    fn cavity(&self, ends: &Normal<ENDS>) -> Option<Normal<ENDS>> {
        Some((ends.density()? - self.site.message).normalize()?.0)
    }

    /// Moments in each state, with this cavity distribution.
    fn state_moments(&mut self, cavity: &Normal<ENDS>) -> Option<[StateMoments; STATES]> {
        let mut moments = Vec::with_capacity(STATES);
        for (state, seed) in self.states.iter().zip(&mut self.site.seeds) {
            let offsets = Matrix2::identity() * state.sigma.powi(2);
            let prior = Normal { covariance: cavity.covariance + offsets, ..*cavity };
            let tilted = tilted_moments(&self.labels, &prior, &seed.unwrap_or(prior))?;
            *seed = Some(tilted.ends);
            moments.push(StateMoments::new(cavity, &offsets, &prior, &tilted)?);
        }
        moments.try_into().ok()
    }

    /// Sets the posterior of the states, whose cavity probabilities are those of all other segments.
    fn set_state_posterior(&mut self, moments: &[StateMoments; STATES], cavity: &[f64; STATES]) {
        let log_likelihoods: [f64; STATES] = std::array::from_fn(|state| moments[state].log_probability);
        let most = log_likelihoods.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let weights: [f64; STATES] = std::array::from_fn(|state| cavity[state] * (log_likelihoods[state] - most).exp());
        let sum: f64 = weights.iter().sum();
        (self.site.log_likelihoods, self.site.probabilities) = (log_likelihoods, weights.map(|weight| weight / sum));
    }

    /// Updates the message by moment matching (eq. 17.10), where all messages give the ends this distribution and the states these cavity
    /// probabilities. The message stays as it is, with `None`, where there is no proper one.
    pub(super) fn update(&mut self, ends: &Normal<ENDS>, states: &[f64; STATES]) -> Option<()> {
        self.updated = None;
        let cavity = self.cavity(ends)?;
        let moments = self.state_moments(&cavity)?;
        self.set_state_posterior(&moments, states);
        let parts = || self.site.probabilities.iter().zip(&moments);
        let mean: Vector2<f64> = parts().map(|(weight, state)| state.without_offsets.mean * *weight).sum();
        let spread = |part: &Normal<ENDS>| part.covariance + (part.mean - mean) * (part.mean - mean).transpose();
        let covariance: Matrix2<f64> = parts().map(|(weight, state)| spread(&state.without_offsets) * *weight).sum();
        let message = matching_factor(&cavity.density()?, &mean, &covariance)?;
        let is_finite = message.information.iter().chain(&message.information_vector).all(|entry| entry.is_finite());
        if !is_finite {
            return None;
        }
        self.site.message = message;
        self.updated = Some((moments, self.log_integral(&cavity)?));
        Some(())
    }

    /// The moments of the last update with its labels; `None` where that found no proper message.
    pub(super) fn updated_moments(&self) -> Option<SegmentMoments> {
        self.updated
    }

    /// Moments with this distribution of the ends by all messages and these cavity probabilities of the states.
    pub(super) fn moments(&mut self, ends: &Normal<ENDS>, states: &[f64; STATES]) -> Option<SegmentMoments> {
        let cavity = self.cavity(ends)?;
        let moments = self.state_moments(&cavity)?;
        self.set_state_posterior(&moments, states);
        Some((moments, self.log_integral(&cavity)?))
    }

    /// Logarithm of the integral of the message times a cavity distribution.
    fn log_integral(&self, cavity: &Normal<ENDS>) -> Option<f64> {
        Some((cavity.density()? + self.site.message).normalize()?.1)
    }

    /// Posteriors of its labels over all states, each with the probability that the segment is disturbed.
    pub(super) fn label_posteriors(
        &self,
        moments: &[StateMoments; STATES],
    ) -> impl Iterator<Item = (f64, LabelPosterior)> {
        let over_states = move |label: &SegmentLabel| {
            let add = |sum, (weight, state): (&f64, &StateMoments)| sum + label.posterior(&state.ends) * *weight;
            self.site.probabilities.iter().zip(moments).fold(LabelPosterior::default(), add)
        };
        self.labels.iter().map(move |label| (self.site.probabilities[1], over_states(label)))
    }

    /// Shifts its site to increments about a pose that lies farther by `increment`.
    pub(super) fn retract(&mut self, increment: &Vector6<f64>) {
        let shift = self.ends.fixed_columns::<INCREMENT>(0) * increment;
        self.site.message.information_vector -= self.site.message.information * shift;
        self.site.seeds.iter_mut().flatten().for_each(|ends| ends.mean -= shift);
    }
}

impl StateMoments {
    /// Splits the tilted moments of the ends between the cavity and the state's offsets, whose covariances add to that of `prior`.
    fn new(
        cavity: &Normal<ENDS>,
        offsets: &Matrix2<f64>,
        prior: &Normal<ENDS>,
        tilted: &TiltedMoments,
    ) -> Option<Self> {
        let inverse = prior.covariance.try_inverse()?;
        let residual = tilted.ends.mean - prior.mean;
        let split = |part: &Matrix2<f64>| {
            let gain = part * inverse;
            (gain * residual, gain * tilted.ends.covariance * gain.transpose() + part - gain * part.transpose())
        };
        let (shift, covariance) = split(&cavity.covariance);
        let (offset, around) = split(offsets);
        Some(Self {
            ends: tilted.ends,
            without_offsets: Normal { mean: cavity.mean + shift, covariance },
            mean_square: 0.5 * (offset.norm_squared() + around.trace()),
            log_probability: tilted.log_probability,
            has_converged: tilted.has_converged,
        })
    }
}

/// The factor that turns a density into one with this mean and covariance; constant along axes where that would be wider.
fn matching_factor(density: &Gaussian<ENDS>, mean: &Vector2<f64>, covariance: &Matrix2<f64>) -> Option<Gaussian<ENDS>> {
    // In coordinates that whiten the density.
    let root = density.information.cholesky()?.unpack();
    let mut eigen = (root.transpose() * covariance * root).try_symmetric_eigen(f64::EPSILON, MAX_ROTATIONS)?;
    eigen.eigenvalues.apply(|ratio| *ratio = (1.0 / *ratio - 1.0).max(0.0));
    let information = root * eigen.recompose() * root.transpose();
    let information_vector = (information + density.information) * mean - density.information_vector;
    Some(Gaussian { information, information_vector, offset: 0.0 })
}
