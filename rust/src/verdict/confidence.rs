//! How likely a pose is right, from what its fit shows (`docs/math.md`, section 15).

/// Weights of [`Evidence::features`], of a logistic regression on the synthetic problems of `benchmarks/confidence.py`.
const WEIGHTS: [f64; 5] = [-5.623, -1.185, 1.984, -0.738, 2.904];

/// Bounds of the spread, beyond which no problem was.
const SPREAD: (f64, f64) = (1e-5, 10.0);

/// What a fit shows of the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Largest standard deviation of the translation along any direction, as a share of the distance to the regions.
    pub spread: f64,
    /// Whether nothing had to be given up: the moments of the whole regions decided, no part of them being disturbed so much that
    /// the contours had to; or no region's samples contradict the pose.
    pub whole: bool,
    /// Scatter of the clean pieces of the contours, or the blur of samples, pixels.
    pub scatter: f64,
    /// Number of regions that the pose contradicts: the others say all the same, and the spread is theirs.
    pub contradicted: usize,
}

impl Evidence {
    /// What the probability's logarithm of odds is a weighted sum of: 1, the logarithm of the spread, whether it is whole,
    /// the logarithm of the scatter, and the number of contradicted regions.
    pub fn features(&self) -> [f64; 5] {
        let (least, most) = SPREAD;
        // The comparison's order makes a spread that is not known the largest.
        let spread = self.spread.min(most).max(least);
        [1.0, spread.ln(), f64::from(u8::from(self.whole)), self.scatter.ln(), self.contradicted as f64]
    }

    /// Probability that the pose, or one that fits alike, is within 5 degrees of the true one.
    pub fn probability(&self) -> f64 {
        let odds: f64 = self.features().iter().zip(WEIGHTS).map(|(feature, weight)| feature * weight).sum();
        1.0 / (1.0 + (-odds).exp())
    }
}
