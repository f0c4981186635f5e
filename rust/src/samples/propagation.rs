//! Expectation propagation (Minka 2001): the normal distribution of a pose that samples on their sides of a contour leave
//! possible (`docs/math.md`, eq. 17.5 to 17.7).

use nalgebra::{SVector, Vector6};

use super::belief::{Belief, JOINT, JointGaussian, OFFSET};
use super::normal::{cumulative, density};
use super::stretch::{KINDS, Stretch, View};
use crate::prior::Gaussian;

/// Sweeps over all sites at most.
const SWEEPS: usize = 6;

/// A sweep that moves the mean by less than this many of its standard deviations, in all directions together, is the last.
const SETTLED: f64 = 0.05;

/// How far the labels of a region's samples are to be trusted.
///
/// A label is right with the probability `mislabelled + (1 - 2 mislabelled) ((1 - disturbed) Phi(margin / blur) + disturbed
/// Phi(margin / wide))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trust {
    /// Blur of the contour where it is clean, pixels.
    pub blur: f64,
    /// Blur where it is disturbed, pixels.
    pub wide: f64,
    /// Share of the contour that is disturbed.
    pub disturbed: f64,
    /// Share of labels that are wrong, however far from the contour.
    pub mislabelled: f64,
}

impl Trust {
    /// Weights and blurs of the clean and the disturbed parts.
    fn parts(&self) -> [(f64, f64); 2] {
        let labelled = 1.0 - 2.0 * self.mislabelled;
        [(labelled * (1.0 - self.disturbed), self.blur), (labelled * self.disturbed, self.wide)]
    }

    /// Logarithm of the probability of a label, and the probabilities that it is wrong for its own sake or as the contour is
    /// disturbed; of a margin with a normal distribution.
    pub fn label(&self, mean: f64, variance: f64) -> Label {
        let [clean, wide] =
            self.parts().map(|(weight, blur)| weight * cumulative(mean / (blur * blur + variance).sqrt()));
        let all = self.mislabelled + clean + wide;
        // Of a margin that is certain to be right a label that was drawn at random agrees by half.
        let beyond = self.mislabelled * cumulative(-mean / (self.blur * self.blur + variance).sqrt());
        Label { log_probability: all.ln(), mislabelled: beyond / all, disturbed: wide / all }
    }
}

/// What a label shows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Label {
    /// Logarithm of its probability.
    pub log_probability: f64,
    /// Probability that it is wrong for its own sake.
    pub mislabelled: f64,
    /// Probability that the contour is disturbed where it lies.
    pub disturbed: f64,
}

impl std::ops::Mul<f64> for Label {
    type Output = Self;

    /// What it shows as far as it is believed.
    fn mul(self, share: f64) -> Self {
        Self {
            log_probability: share * self.log_probability,
            mislabelled: share * self.mislabelled,
            disturbed: share * self.disturbed,
        }
    }
}

impl std::ops::Add for Label {
    type Output = Self;

    /// What both show.
    fn add(self, other: Self) -> Self {
        Self {
            log_probability: self.log_probability + other.log_probability,
            mislabelled: self.mislabelled + other.mislabelled,
            disturbed: self.disturbed + other.disturbed,
        }
    }
}

/// A sample: its margin on the right side of the contour is `margin + slope . x` pixels, linear in the left increment and the
/// offset of the stretch that it lies beside, together `x`.
#[derive(Debug, Clone, Copy)]
pub struct Site {
    /// Derivative of the margin.
    pub slope: SVector<f64, JOINT>,
    /// The margin at zero, pixels.
    pub margin: f64,
    /// Variance of the margin about that line, squared pixels, which adds to the blur's.
    pub bent: f64,
    /// How far labels are to be trusted.
    pub trust: Trust,
    /// The normal factors of the margin that stand for the label, for each kind of stretch that it may lie beside.
    pub factors: [Factor; KINDS],
}

/// Natural parameters of a normal factor of a margin.
#[derive(Debug, Clone, Copy, Default)]
pub struct Factor {
    /// Inverse variance.
    pub precision: f64,
    /// The same times the mean.
    pub pull: f64,
}

/// What a normal distribution of a margin shows of a label.
struct Tilted {
    /// Logarithm of the label's probability.
    log_probability: f64,
    /// Its first derivative by the mean, and minus its second.
    first: f64,
    second: f64,
}

impl Tilted {
    /// The label of a margin with a normal distribution (`docs/math.md`, eq. 17.6).
    fn new(mean: f64, variance: f64, trust: &Trust) -> Self {
        let (mut probability, mut slope, mut bend) = (trust.mislabelled, 0.0, 0.0);
        for (weight, blur) in trust.parts() {
            let width = (blur * blur + variance).sqrt();
            let u = mean / width;
            let height = weight * density(u) / width;
            probability += weight * cumulative(u);
            slope += height;
            bend += height * u / width;
        }
        let first = slope / probability;
        Self { log_probability: probability.ln(), first, second: first * first + bend / probability }
    }
}

impl AsRef<Site> for Site {
    fn as_ref(&self) -> &Site {
        self
    }
}

impl AsMut<Site> for Site {
    fn as_mut(&mut self) -> &mut Site {
        self
    }
}

impl Site {
    /// A sample whose factor is not known yet; its margin grows by `outwards` for each pixel that its stretch is off.
    pub fn new(slope: &Vector6<f64>, outwards: f64, margin: f64, trust: Trust) -> Self {
        Self { slope: slope.push(outwards), margin, bent: 0.0, trust, factors: Default::default() }
    }

    /// The same with the derivative by the increment and the margin that it has from there.
    pub fn with_line(self, slope: &Vector6<f64>, margin: f64) -> Self {
        Self { slope: slope.push(self.slope[OFFSET]), margin, ..self }
    }

    /// The site with the factors of another one.
    pub fn with_factors_of(self, other: &Self) -> Self {
        Self { factors: other.factors, ..self }
    }

    /// Mean and variance of the margin under a distribution of the increment and the offset.
    pub fn margin_under(&self, belief: &Belief<JOINT>) -> (f64, f64) {
        let variance = self.slope.dot(&(belief.covariance * self.slope));
        (self.margin + self.slope.dot(&belief.mean), variance)
    }

    /// What the label shows under a belief.
    pub fn label(&self, belief: &Belief<JOINT>) -> Label {
        let (mean, variance) = self.margin_under(belief);
        self.trust.label(mean, variance + self.bent)
    }

    /// Moment matching of the factor for a kind of stretch, in place in the belief.
    pub(super) fn update(&mut self, kind: usize, belief: &mut Belief<JOINT>) {
        let spread = belief.covariance * self.slope;
        let (mean, variance) = (self.margin + self.slope.dot(&belief.mean), self.slope.dot(&spread));
        let before = self.factors[kind];
        let Some((mean_without, variance_without)) = before.left_out(mean, variance) else { return };
        let tilted = Tilted::new(mean_without, variance_without + self.bent, &self.trust);
        let left = 1.0 - variance_without * tilted.second;
        // A sample that contradicts the others would make the belief wider than they leave it: it says nothing.
        let after = match tilted.second > 0.0 {
            true => {
                Factor { precision: tilted.second / left, pull: (tilted.first + mean_without * tilted.second) / left }
            }
            false => Factor::default(),
        };
        let (more, farther) = (after.precision - before.precision, after.pull - before.pull);
        let held = 1.0 + more * variance;
        // The comparison fails for what is not finite, too.
        if !(held > f64::EPSILON && held.is_finite() && farther.is_finite()) {
            return;
        }
        belief.covariance.ger(-more / held, &spread, &spread, 1.0);
        belief.mean += spread * ((farther - more * mean) / held);
        self.factors[kind] = after;
    }

    /// The site's factor for a kind of stretch, without what makes it as large as the label's probability.
    pub(super) fn factor_into(&self, kind: usize, factor: &mut JointGaussian) {
        let Factor { precision, pull } = self.factors[kind];
        factor.information.ger(precision, &self.slope, &self.slope, 1.0);
        factor.vector += self.slope * (pull - precision * self.margin);
        factor.offset += self.margin * (pull - 0.5 * precision * self.margin);
    }

    /// Logarithm of what the factor is multiplied by so that it integrates, without the site, to the label's probability.
    pub(super) fn log_scale(&self, kind: usize, belief: &Belief<JOINT>) -> f64 {
        let (mean, variance) = self.margin_under(belief);
        let Some((mean_without, variance_without)) = self.factors[kind].left_out(mean, variance) else { return 0.0 };
        let label = Tilted::new(mean_without, variance_without + self.bent, &self.trust).log_probability;
        let potential = |mean: f64, variance: f64| 0.5 * (variance.ln() + mean * mean / variance);
        label + potential(mean_without, variance_without) - potential(mean, variance)
    }
}

impl Factor {
    /// Mean and variance of a margin without the factor; `None` where nothing is left.
    fn left_out(&self, mean: f64, variance: f64) -> Option<(f64, f64)> {
        let left = 1.0 - variance * self.precision;
        (left > f64::EPSILON).then(|| ((mean - variance * self.pull) / left, variance / left))
    }
}

/// What samples and other factors leave possible.
#[derive(Debug, Clone)]
pub struct Propagated {
    /// Of the increment.
    pub belief: Belief,
    /// Of the increment and the offset of each stretch, for each kind that it may be.
    pub views: Vec<Vec<View>>,
    /// Logarithm of the evidence.
    pub log_evidence: f64,
}

/// What samples beside stretches and other factors leave possible; sites and stretches keep their factors, from which the next
/// call goes on. In the first sweep a `guard` stands in for the factors that
/// sites do not have yet: without it the first of them would meet a belief so wide that they contradict one another. `None`
/// where a direction is left free.
///
/// The offsets meet in the increment alone: what each stretch says of that is a message, and without its own the sum of all
/// messages is what the others say.
pub fn propagated<S: AsMut<Site> + AsRef<Site>>(
    others: &Gaussian,
    guard: &Gaussian,
    sites: &mut [S],
    stretches: &mut [Stretch],
) -> Option<Propagated> {
    let mut messages: Vec<Gaussian> = stretches.iter().map(|stretch| stretch.first_message(sites)).collect();
    let sum = |known: Gaussian, messages: &[Gaussian]| messages.iter().fold(known, |sum, message| sum + *message);
    let mut all = sum(*others + *guard, &messages);
    let mut belief = all.belief()?.0;
    for _ in 0..SWEEPS {
        let before = belief.mean;
        for (stretch, message) in stretches.iter_mut().zip(&mut messages) {
            let rest = all - *message;
            if let Some(new) = stretch.sweep(&rest, sites) {
                (*message, all) = (new, rest + new);
            }
        }
        // Anew from all factors: the updates' rounding errors add up.
        all = sum(*others, &messages);
        belief = all.belief()?.0;
        let way = belief.mean - before;
        if way.dot(&belief.covariance.cholesky()?.solve(&way)) < SETTLED * SETTLED {
            break;
        }
    }
    judged(&all, &messages, sites, stretches)
}

/// The beliefs and the evidence where `all` is the product of all messages and other factors.
fn judged<S: AsRef<Site>>(
    all: &Gaussian,
    messages: &[Gaussian],
    sites: &[S],
    stretches: &[Stretch],
) -> Option<Propagated> {
    let (belief, integral) = all.belief()?;
    let mut log_evidence = integral;
    let mut views = Vec::with_capacity(stretches.len());
    for (stretch, message) in stretches.iter().zip(messages) {
        let own = stretch.views(&(*all - *message), sites)?;
        log_evidence += stretch.judged(&own).0 - integral;
        views.push(own);
    }
    Some(Propagated { belief, views, log_evidence })
}
