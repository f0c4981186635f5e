//! From a start to what the samples leave possible about it, with a falling blur (`docs/math.md`, section 17).

use nalgebra::Matrix6;

use super::belief::Belief;
use super::labels::{SHARP, first_blur, leading_step};
use super::propagation::Trust;
use super::readings::SampledRegion;
use super::telling::{FINEST, Samples, State};
use crate::geometry::pose::{Pose, Tangent};
use crate::prior::Gaussian;

/// From blur to blur.
const STEP: f64 = 0.5;

/// Relinearisations at one blur at most: on the way, and where they end.
const ROUNDS: usize = 2;
const LAST_ROUNDS: usize = 8;

/// What samples show at a pose.
#[derive(Debug, Clone)]
pub struct Posterior {
    /// The mean, about the problem's origin.
    pub pose: Pose,
    /// Covariance of the left increment.
    pub covariance: Matrix6<f64>,
    /// Logarithm of the evidence.
    pub log_evidence: f64,
    /// The likeliest blur of the margins, pixels.
    pub blur: f64,
    /// Share of each region's telling samples that lie on the wrong side of its contour.
    pub wrong: Vec<f64>,
    /// Number of samples near enough to the contours to tell anything.
    pub telling: usize,
}

/// A start led on by some of the samples, to a blur from which on all of them tell more.
#[derive(Debug, Clone)]
pub struct Led {
    /// About the problem's origin.
    pub pose: Pose,
    /// Logarithm of the evidence of the samples that led it.
    pub log_evidence: f64,
    belief: Belief,
    trust: Vec<Trust>,
}

/// Where some of the samples lead a start, while their blur falls by halves from as far as they lie on the wrong side; `others`
/// gives what else is known at a pose. `None` where a direction is left free.
pub fn led(regions: &[SampledRegion], others: &impl Fn(&Pose) -> Gaussian, start: &Pose) -> Option<Led> {
    let step = leading_step(regions);
    let free = Belief { mean: Tangent::zeros(), covariance: Matrix6::zeros() };
    let mut samples = Samples::some(regions, others, *start, step);
    let mut state = State { pose: *start, belief: free, log_evidence: f64::NEG_INFINITY };
    let mut blur = first_blur(regions, start, step);
    loop {
        state = samples.settled(state, blur, ROUNDS, false)?;
        if blur <= SHARP {
            let State { pose, log_evidence, belief } = state;
            return Some(Led { pose, log_evidence, belief, trust: samples.trust });
        }
        blur = (blur * STEP).max(SHARP);
    }
}

/// What all samples leave possible about starts that some of them led on, whatever the blur, which falls on from there. A start
/// that is behind the best at one blur by more than `hopeless`, in logarithms of the evidence, falls no farther.
pub fn posteriors(
    regions: &[SampledRegion],
    others: &impl Fn(&Pose) -> Gaussian,
    led: &[Led],
    hopeless: f64,
) -> Vec<Posterior> {
    let mut falling: Vec<_> = led.iter().map(|from| Falling::new(regions, others, from)).collect();
    let mut blur = SHARP;
    while blur >= FINEST {
        falling.retain_mut(|one| one.fall_to(blur).is_some());
        let most = falling.iter().map(|one| one.state.log_evidence).fold(f64::NEG_INFINITY, f64::max);
        falling.retain(|one| most - one.state.log_evidence <= hopeless);
        blur *= STEP;
    }
    falling.into_iter().filter_map(Falling::ended).collect()
}

/// A start on its way with all samples.
struct Falling<'a, F> {
    samples: Samples<'a, F>,
    state: State,
    /// Where it was at each blur.
    found: Vec<(State, f64)>,
}

impl<'a, F: Fn(&Pose) -> Gaussian> Falling<'a, F> {
    fn new(regions: &'a [SampledRegion], others: &'a F, from: &Led) -> Self {
        let state = State { pose: from.pose, belief: from.belief, log_evidence: f64::NEG_INFINITY };
        Self { samples: Samples::all(regions, others, from.pose, from.trust.clone()), state, found: Vec::new() }
    }

    /// The state at the next blur; `None` where a direction is left free.
    fn fall_to(&mut self, blur: f64) -> Option<()> {
        self.state = self.samples.settled(self.state, blur, ROUNDS, false)?;
        self.found.push((self.state, blur));
        Some(())
    }

    /// The likeliest blur's state over the whole of its belief, and those of all blurs together.
    fn ended(mut self) -> Option<Posterior> {
        let by_evidence = |(a, _): &&(State, f64), (b, _): &&(State, f64)| a.log_evidence.total_cmp(&b.log_evidence);
        let (likeliest, blur) = *self.found.iter().max_by(by_evidence)?;
        let last = self.samples.settled(likeliest, blur, LAST_ROUNDS, true)?;
        let (wrong, telling) = (self.samples.wrong(&last), self.samples.telling.len());
        let rest = self.found.iter().filter(|(_, other)| *other != blur);
        let states = rest.map(|(state, _)| (state.log_evidence - likeliest.log_evidence, *state)).chain([(0.0, last)]);
        let (pose, covariance) = mixed(&last.pose, &states.collect::<Vec<_>>());
        Some(Posterior { pose, covariance, log_evidence: last.log_evidence, blur, wrong, telling })
    }
}

/// Mean and covariance of several beliefs together, each with the logarithm of its weight, about a pose that is near to all.
fn mixed(about: &Pose, states: &[(f64, State)]) -> (Pose, Matrix6<f64>) {
    let all: f64 = states.iter().map(|(weight, _)| weight.exp()).sum();
    let ways: Vec<_> =
        states.iter().map(|(weight, state)| (weight.exp() / all, about.increment_to(&state.pose))).collect();
    let mean: Tangent = ways.iter().map(|(weight, way)| way * *weight).sum();
    let spread = |(weight, way): &(f64, Tangent), state: &State| {
        (state.belief.covariance + (way - mean) * (way - mean).transpose()) * *weight
    };
    let covariance = ways.iter().zip(states).map(|(way, (_, state))| spread(way, state)).sum();
    (about.moved(&mean), covariance)
}
