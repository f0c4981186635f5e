//! Stretches of an observed contour, each of which is off as a whole (`docs/math.md`, eq. 17.8).

use std::f64::consts::PI;

use super::belief::{Belief, JOINT, JointGaussian, OFFSET};

/// How far stretches of a contour are off: most of them by `clean` pixels, a share that is `disturbed` by `wide` (standard
/// deviations).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scatter {
    /// Of a clean stretch, pixels.
    pub clean: f64,
    /// Of a disturbed one, pixels.
    pub wide: f64,
    /// Share of those that are disturbed.
    pub disturbed: f64,
}

impl Scatter {
    /// Of what no margin depends on.
    const NONE: Self = Self { clean: 1.0, wide: 1.0, disturbed: 0.0 };
}

/// A stretch of a contour: the samples that lie beside it, and the normal factor that stands for how far it may be off.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Numbers of the samples.
    pub members: Vec<usize>,
    /// What is known of its offset.
    pub scatter: Scatter,
    /// Natural parameters of the factor that stands for it: precision, and precision times mean.
    pub precision: f64,
    /// See `precision`.
    pub pull: f64,
}

/// What a normal distribution leaves of an offset.
struct Tilted {
    log_integral: f64,
    mean: f64,
    variance: f64,
    disturbed: f64,
}

impl Scatter {
    /// The product with `exp(pull d - precision d^2 / 2)` of an offset `d`.
    fn tilted(&self, precision: f64, pull: f64) -> Tilted {
        let part = |share: f64, deviation: f64| {
            let held = 1.0 + deviation * deviation * precision;
            let variance = deviation * deviation / held;
            (share.ln() - 0.5 * held.ln() + 0.5 * pull * pull * variance, variance)
        };
        let [(clean, narrow), (wide, broad)] =
            [part(1.0 - self.disturbed, self.clean), part(self.disturbed, self.wide)];
        let most = clean.max(wide);
        let log_integral = most + ((clean - most).exp() + (wide - most).exp()).ln();
        let disturbed = (wide - log_integral).exp();
        let mean = pull * (narrow + disturbed * (broad - narrow));
        let square = |variance: f64| variance + (pull * variance - mean).powi(2);
        let variance = (1.0 - disturbed) * square(narrow) + disturbed * square(broad);
        Tilted { log_integral, mean, variance, disturbed }
    }
}

impl Stretch {
    /// Samples beside a stretch of which nothing but its scatter is known yet.
    pub fn new(members: Vec<usize>, scatter: Scatter) -> Self {
        let Scatter { clean, wide, disturbed } = scatter;
        let variance = (1.0 - disturbed) * clean * clean + disturbed * wide * wide;
        Self { members, scatter, precision: 1.0 / variance, pull: 0.0 }
    }

    /// So many samples, each beside a stretch of its own.
    pub fn apart(count: usize) -> Self {
        Self::new((0..count).collect(), Scatter::NONE)
    }

    /// The factor of the offset that stands for what is known of it, but for a multiple.
    pub fn factor(&self) -> JointGaussian {
        let mut factor = JointGaussian::default();
        factor.information[(OFFSET, OFFSET)] = self.precision;
        factor.vector[OFFSET] = self.pull;
        factor
    }

    /// What everything else leaves of the offset.
    fn others(&self, belief: &Belief<JOINT>) -> (f64, f64) {
        let variance = belief.covariance[(OFFSET, OFFSET)];
        ((1.0 / variance - self.precision).max(0.0), belief.mean[OFFSET] / variance - self.pull)
    }

    /// Moment matching of the factor under a belief that holds it.
    pub fn update(&mut self, belief: &Belief<JOINT>) {
        let (precision, pull) = self.others(belief);
        let tilted = self.scatter.tilted(precision, pull);
        // What is either clean or disturbed may seem to vary by more than both: it varies by no more than what is disturbed.
        let own = (1.0 / tilted.variance - precision).max(self.scatter.wide.powi(-2));
        if own.is_finite() {
            (self.precision, self.pull) = (own, tilted.mean * (precision + own) - pull);
        }
    }

    /// Logarithm of what the factor is multiplied by so that it integrates to what the scatter does.
    pub fn log_scale(&self, belief: &Belief<JOINT>) -> f64 {
        let (precision, pull) = self.others(belief);
        let (mean, variance) = (belief.mean[OFFSET], belief.covariance[(OFFSET, OFFSET)]);
        self.scatter.tilted(precision, pull).log_integral - 0.5 * ((2.0 * PI * variance).ln() + mean * mean / variance)
    }

    /// Probability that the stretch is disturbed.
    pub fn disturbed(&self, belief: &Belief<JOINT>) -> f64 {
        let (precision, pull) = self.others(belief);
        self.scatter.tilted(precision, pull).disturbed
    }
}
