//! How far labels are trusted, and what they show of it (`docs/math.md`, eq. 17.2 to 17.4).

use super::readings::{Edge, Reading};
use crate::math::normal::cumulative;

/// The coarsest blur, pixels.
pub(super) const COARSEST: f64 = 64.0;

/// Shares of wrong labels and of disturbed contour before anything is known, and the number of samples that they stand
/// for.
const MISLABELED: f64 = 0.01;
const DISTURBED: f64 = 0.03;
const WEIGHT: f64 = 30.0;

/// How far disturbed parts of a contour are off, as a share of the region's size, and in blurs at least.
pub(crate) const FAR_OFF: f64 = 0.1;
pub(super) const FAR_BLURS: f64 = 4.0;

/// Largest share of wrong labels: no more than a coin would err.
const MOST_WRONG: f64 = 0.5;

/// Probability of a label, right or wrong, of which the contour tells nothing.
pub const COIN: f64 = 0.5;

/// How far the labels of a region's samples are to be trusted.
///
/// A label is right with the probability `mislabeled + (1 - 2 mislabeled) ((1 - disturbed) Phi(margin / blur) +
/// disturbed Phi(margin / wide))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trust {
    /// Blur of the contour where it is clean, pixels.
    pub blur: f64,
    /// Blur where it is disturbed, pixels.
    pub wide: f64,
    /// Share of the contour that is disturbed.
    pub disturbed: f64,
    /// Share of labels that are wrong, however far from the contour.
    pub mislabeled: f64,
}

impl Trust {
    /// What is expected before anything is known.
    pub(super) fn unknown() -> Self {
        Self { blur: COARSEST, wide: FAR_BLURS * COARSEST, disturbed: DISTURBED, mislabeled: MISLABELED }
    }

    /// The same as far as labels show it, with what was expected beforehand.
    pub(super) fn learned(&self, shown: &Shown) -> Self {
        let share =
            |sum: f64, count: f64, expected: f64| ((sum + WEIGHT * expected) / (count + WEIGHT)).min(MOST_WRONG);
        Self {
            mislabeled: share(shown.mislabeled, shown.all, MISLABELED),
            disturbed: share(shown.disturbed, shown.near, DISTURBED),
            ..*self
        }
    }

    /// The probability of a label on its wrong side, and what it is more on its right one.
    pub(super) fn bounds(&self, edge: Edge) -> (f64, f64) {
        match edge {
            Edge::Own => (self.mislabeled, 1.0 - 2.0 * self.mislabeled),
            Edge::HidesInside => (COIN, COIN - self.mislabeled),
            Edge::HidesOutside => (self.mislabeled, COIN - self.mislabeled),
        }
    }

    /// Weights and blurs of the clean and the disturbed part.
    pub(super) fn parts(&self, edge: Edge) -> [(f64, f64); 2] {
        let (_, labeled) = self.bounds(edge);
        [(labeled * (1.0 - self.disturbed), self.blur), (labeled * self.disturbed, self.wide)]
    }

    /// Logarithm of the probability of a label, and the probabilities that it is wrong for its own sake or as the
    /// contour is disturbed; of a margin with a normal distribution.
    pub fn label(&self, edge: Edge, mean: f64, variance: f64) -> Label {
        let right = |blur: f64| cumulative(mean / (blur * blur + variance).sqrt());
        let [(clean, blur), (disturbed, wide)] = self.parts(edge);
        let on_side = right(blur);
        // Where stretches are of one kind or the other, there is no disturbed part.
        let far = if disturbed > 0.0 { disturbed * right(wide) } else { 0.0 };
        let all = self.bounds(edge).0 + clean * on_side + far;
        // Of a margin that is certain to be right a label that was drawn at random agrees by half.
        let beyond = match edge {
            Edge::HidesInside => 0.0,
            _ => self.mislabeled * (1.0 - on_side),
        };
        Label { log_probability: all.ln(), mislabeled: beyond / all, disturbed: far / all }
    }

    /// The label of a sample that is seen there.
    pub(super) fn reading(&self, reading: &Reading) -> Label {
        match reading {
            Reading::Seen(sight) => self.label(sight.edge, sight.margin, 0.0),
            Reading::Behind(right) => self.label_behind(*right),
        }
    }

    /// The label of a sample behind the camera, infinitely far on its right side or its wrong one.
    pub(super) fn label_behind(&self, right: bool) -> Label {
        self.label(Edge::Own, if right { f64::INFINITY } else { f64::NEG_INFINITY }, 0.0)
    }
}

/// What a label shows.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Label {
    /// Logarithm of its probability.
    pub log_probability: f64,
    /// Probability that it is wrong for its own sake.
    pub mislabeled: f64,
    /// Probability that the contour is disturbed where it lies.
    pub disturbed: f64,
}

impl std::ops::Mul<f64> for Label {
    type Output = Self;

    /// What it shows as far as it is believed.
    fn mul(self, share: f64) -> Self {
        Self {
            log_probability: share * self.log_probability,
            mislabeled: share * self.mislabeled,
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
            mislabeled: self.mislabeled + other.mislabeled,
            disturbed: self.disturbed + other.disturbed,
        }
    }
}

/// What labels show together.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Shown {
    pub(super) log_probability: f64,
    pub(super) mislabeled: f64,
    pub(super) disturbed: f64,
    /// Numbers of labels: all, and those that could show a disturbed contour.
    pub(super) all: f64,
    pub(super) near: f64,
}

impl Shown {
    pub(super) fn add(&mut self, label: &Label, is_near: bool) {
        let near = f64::from(u8::from(is_near));
        self.log_probability += label.log_probability;
        self.mislabeled += label.mislabeled;
        self.disturbed += near * label.disturbed;
        self.all += 1.0;
        self.near += near;
    }
}
