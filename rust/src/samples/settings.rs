//! How far labels are blurred, and contours grown and off: the settings that samples are heard with, and what each counts
//! (`docs/math.md`, section 17).

use super::labels::SHARP;
use super::telling::FINEST;

/// From setting to setting: of blurs, of how far contours are grown and of how far their corners are off. By halves poses are
/// about the same, and take half as long again (`regionpose evaluate lidar --only scan=samples`, `python benchmarks/speed.py --rows
/// samples`).
const STEP: f64 = 0.25;

/// Standard deviations of how far corners of contours are off, pixels: from a hand's error, and half the width of a lidar's beam beside a
/// region of a few meters, to about the quality of calibrations.
pub(super) const OFFS: [f64; 3] = [3.2, 3.2 * STEP, 3.2 * STEP * STEP];

/// The same of how far contours are grown.
pub(super) const GROWTHS: [f64; 3] = OFFS;

/// From the likeliest of how far corners are off to what lies beside it: half a step.
pub const BESIDE: f64 = 2.0;

/// Places between one setting and the next at which it is asked what lies between: mean squares are exact to 0.2 %
/// (`cargo test sampled::`).
const PLACES: u32 = 16;

/// The blurs with all samples, falling.
pub(super) fn blurs() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(SHARP), |blur| Some(blur * STEP)).take_while(|blur| *blur >= FINEST)
}

/// Blur of labels, and how far contours are grown and their corners are off at least (standard deviations),
/// pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setting {
    /// Of labels, one by one.
    pub blur: f64,
    /// Of a contour, all around.
    pub growth: f64,
    /// Of its corners.
    pub off: f64,
}

impl Setting {
    /// How far corners are off: what blurs labels beyond the finest does not average out along a stretch.
    pub fn clean(&self) -> f64 {
        (self.blur.powi(2) - FINEST.powi(2)).sqrt().max(self.off)
    }

    /// Whether another one means the same: one that its blur puts off farther does.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.blur == other.blur && self.growth == other.growth && self.clean() == other.clean()
    }

    /// How far labels are off in all, one by one: blurred, beside a stretch that is off and a contour that is grown.
    pub(super) fn spread(&self) -> f64 {
        self.blur.hypot(self.clean()).hypot(self.growth)
    }

    /// Logarithm of the prior, but for what is common to all: even in how far stretches are off (Gelman 2006), so that each of the
    /// scales, which grow by a factor, stands for as much as it is large. Where samples lie too far apart to tell, contours are
    /// rather off by pixels than exact.
    pub(super) fn log_prior(&self) -> f64 {
        self.clean().ln()
    }

    /// The same with corners that are off by so many times as much.
    pub(super) fn times_off(&self, factor: f64) -> Self {
        Self { off: self.off * factor, ..*self }
    }
}

/// What each setting of one blur counts, in all 1, by the logarithms of its evidence and prior. Each stands for a step about it, but
/// where those beside the likeliest are known, they and it stand for all that lies between.
pub fn shares(heard: &[(f64, Setting)]) -> Vec<f64> {
    let Some(best) = (0..heard.len()).max_by(|&a, &b| heard[a].0.total_cmp(&heard[b].0)) else { return Vec::new() };
    let (most, likeliest) = heard[best];
    let mut counts: Vec<f64> = heard.iter().map(|(log_evidence, _)| (log_evidence - most).exp()).collect();
    let beside = |factor: f64| {
        let is_beside =
            |other: &Setting| other.growth == likeliest.growth && other.clean() == likeliest.clean() * factor;
        heard.iter().position(|(_, other)| is_beside(other))
    };
    if let (Some(under), Some(over)) = (beside(1.0 / BESIDE), beside(BESIDE)) {
        [counts[under], counts[best], counts[over]] = interpolated(heard[under].0 - most, heard[over].0 - most);
    }
    let sum: f64 = counts.iter().sum();
    counts.iter().map(|count| count / sum).collect()
}

/// What the setting under the likeliest, this one and that over it count, in steps, where those beside it are so much less likely, as
/// logarithms. What lies between has its evidence by the parabola through these, over the logarithm of how far corners are off, and is
/// shared by its neighbors as squares of that are, with which covariances grow. Of steps by four alone the likeliest may be off by two,
/// and so would be all ellipsoids.
fn interpolated(under: f64, over: f64) -> [f64; 3] {
    let mut counts = [0.0; 3];
    for place in 0..2 * PLACES {
        let far = (f64::from(place) + 0.5) / f64::from(PLACES) - 1.0;
        let log_evidence = 0.5 * far * ((over - under) + far * (over + under));
        let count = log_evidence.exp() * BESIDE.ln() / (f64::from(PLACES) * -STEP.ln());
        let lower = usize::from(place >= PLACES);
        let [square, low, high] = [far, lower as f64 - 1.0, lower as f64].map(|far| BESIDE.powf(2.0 * far));
        let share = (square - low) / (high - low);
        counts[lower] += count * (1.0 - share);
        counts[lower + 1] += count * share;
    }
    counts
}
