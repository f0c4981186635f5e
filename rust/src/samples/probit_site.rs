//! A sample's label as a site of expectation propagation: its linearized margin, and the normal factor that stands for the label where
//! samples are independent, by moment matching in closed form (`docs/math.md`, eq. 17.5 to 17.8).

use nalgebra::Vector6;

use super::label_model::{LabelModel, LabelPosterior};
use super::margin::{EdgeKind, Margin};
use crate::math::gaussian::{Gaussian, Normal};

/// A sample whose margin is `margin + gradient . x + outward (g + (1 - along) d + along e)` pixels, linear in the left increment `x`, the
/// dilation `g` of its contour and the offsets `d` and `e` of the ends of the contour segment beside it.
#[derive(Debug, Clone, Copy)]
pub struct LabelSite {
    /// Derivative of the margin by the increment.
    pub gradient: Vector6<f64>,
    /// Derivative of the margin by an outward offset of the contour.
    pub outward: f64,
    /// Position along the segment, from 0 at the start to 1 at the end.
    pub along: f64,
    /// The margin at zero, pixels.
    pub margin: f64,
    /// Variance of the margin about its linearization, squared pixels, which adds to that of the label model.
    pub linearization_variance: f64,
    /// Kind of the nearest edge.
    pub edge: EdgeKind,
    /// Noise of the label.
    pub model: LabelModel,
    /// The site's factor, of independent samples.
    pub factor: MarginFactor,
}

/// A normal factor of a margin, by its natural parameters.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MarginFactor {
    /// Inverse variance.
    pub precision: f64,
    /// Precision times mean.
    pub precision_mean: f64,
}

impl LabelSite {
    /// The site of a projected sample, with a constant factor.
    pub fn new(margin: &Margin, model: LabelModel) -> Self {
        let Margin { value, gradient, outward, along, edge, .. } = *margin;
        let (linearization_variance, factor) = (0.0, MarginFactor::default());
        Self { gradient, outward, along, margin: value, linearization_variance, edge, model, factor }
    }

    /// The site with another linearization: the margin at zero and its derivative by the increment.
    pub fn with_line(self, gradient: &Vector6<f64>, margin: f64) -> Self {
        Self { gradient: *gradient, margin, ..self }
    }

    /// Whether the nearest point is an end of the segment, which the next segment shares.
    pub fn is_at_corner(&self) -> bool {
        self.along <= 0.0 || self.along >= 1.0
    }

    /// Mean and variance of the margin under a distribution of the increment.
    pub fn margin_under(&self, increment: &Normal) -> (f64, f64) {
        let variance = self.gradient.dot(&(increment.covariance * self.gradient));
        (self.margin + self.gradient.dot(&increment.mean), variance)
    }

    /// The label's posterior under a distribution of the increment.
    pub fn posterior(&self, increment: &Normal) -> LabelPosterior {
        let (mean, variance) = self.margin_under(increment);
        self.model.posterior(self.edge, mean, variance + self.linearization_variance)
    }

    /// Updates the factor by moment matching, and the distribution of the increment with it (eq. 17.7).
    pub(super) fn update(&mut self, increment: &mut Normal) {
        let spread = increment.covariance * self.gradient;
        let (mean, variance) = (self.margin + self.gradient.dot(&increment.mean), self.gradient.dot(&spread));
        let before = self.factor;
        let Some((cavity_mean, cavity_variance)) = before.cavity(mean, variance) else { return };
        let after = self.matched(cavity_mean, cavity_variance);
        let (precision, precision_mean) =
            (after.precision - before.precision, after.precision_mean - before.precision_mean);
        let ratio = 1.0 + precision * variance;
        // The comparison fails for what is not finite, too.
        if !(ratio > f64::EPSILON && ratio.is_finite() && precision_mean.is_finite()) {
            return;
        }
        increment.covariance.ger(-precision / ratio, &spread, &spread, 1.0);
        increment.mean += spread * ((precision_mean - precision * mean) / ratio);
        self.factor = after;
    }

    /// The factor that gives the cavity the mean and variance of the tilted distribution; constant where that is wider than the cavity,
    /// as of a label that contradicts the others.
    fn matched(&self, cavity_mean: f64, cavity_variance: f64) -> MarginFactor {
        let moment = self.model.log_moment(self.edge, cavity_mean, cavity_variance + self.linearization_variance);
        let ratio = 1.0 - cavity_variance * moment.second;
        match moment.second > 0.0 {
            true => MarginFactor {
                precision: moment.second / ratio,
                precision_mean: (moment.first + cavity_mean * moment.second) / ratio,
            },
            false => MarginFactor::default(),
        }
    }

    /// Multiplies a factor of the increment by the site's.
    pub(super) fn multiply_into(&self, product: &mut Gaussian) {
        let MarginFactor { precision, precision_mean } = self.factor;
        product.information.ger(precision, &self.gradient, &self.gradient, 1.0);
        product.information_vector += self.gradient * (precision_mean - precision * self.margin);
        product.offset += self.margin * (precision_mean - 0.5 * precision * self.margin);
    }

    /// Logarithm of the factor's scale: with it the factor integrates, times the cavity, to the label's probability (eq. 17.8).
    pub(super) fn log_scale(&self, increment: &Normal) -> f64 {
        let (mean, variance) = self.margin_under(increment);
        let Some((cavity_mean, cavity_variance)) = self.factor.cavity(mean, variance) else { return 0.0 };
        let label_variance = cavity_variance + self.linearization_variance;
        let log_probability = self.model.log_moment(self.edge, cavity_mean, label_variance).value;
        let potential = |mean: f64, variance: f64| 0.5 * (variance.ln() + mean * mean / variance);
        log_probability + potential(cavity_mean, cavity_variance) - potential(mean, variance)
    }
}

impl AsRef<LabelSite> for LabelSite {
    fn as_ref(&self) -> &LabelSite {
        self
    }
}

impl AsMut<LabelSite> for LabelSite {
    fn as_mut(&mut self) -> &mut LabelSite {
        self
    }
}

impl MarginFactor {
    /// Mean and variance of the margin's cavity distribution (eq. 17.5); `None` where it is not normalizable.
    fn cavity(&self, mean: f64, variance: f64) -> Option<(f64, f64)> {
        let left = 1.0 - variance * self.precision;
        (left > f64::EPSILON).then(|| ((mean - variance * self.precision_mean) / left, variance / left))
    }
}
