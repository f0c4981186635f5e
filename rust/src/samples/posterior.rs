//! From a start to what the samples leave possible about it, with a falling blur (`docs/math.md`, section 17).

use nalgebra::Matrix6;

use super::belief::Belief;
use super::labels::{ALIKE, Compared, SHARP, first_blur, leading_step};
use super::propagation::Trust;
use super::readings::SampledRegion;
use super::telling::{FINEST, SIGMA_POINTS, Samples, State};
use crate::effort;
use crate::geometry::pose::{Pose, Tangent};
use crate::prior::Gaussian;

/// From blur to blur.
const STEP: f64 = 0.5;

/// Standard deviations of how far contours are grown and clean stretches of them are off, pixels: from the quality of
/// calibrations to a hand's error, and half the width of a lidar's beam beside a region of a few meters.
const SCALES: [f64; 4] = [0.1, 0.3, 1.0, 3.0];

/// Logarithm of odds from which a setting that is farther on tells nothing.
const NOTHING: f64 = 10.0;

/// Relinearizations at one blur at most: on the way, and where they end.
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
    /// How far the labels of each region are trusted.
    trust: Vec<Trust>,
    /// Logarithm of what else is known at the pose.
    log_known: f64,
}

impl Posterior {
    /// Twice the logarithm of the odds against another one (`docs/math.md`, eq. 17.11).
    pub fn against(&self, other: &Self, regions: &[SampledRegion]) -> f64 {
        self.compared().against(&other.compared(), regions)
    }

    /// The same where what is known speaks for it by so much more, as a logarithm.
    pub fn with_known(self, log_known: f64) -> Self {
        Self { log_evidence: self.log_evidence + log_known, log_known: self.log_known + log_known, ..self }
    }

    /// Squared distance to another one, in variances of both together; infinite where these are none.
    pub fn squared_sigmas_to(&self, other: &Self) -> f64 {
        let way = self.pose.increment_to(&other.pose);
        let root = (self.covariance + other.covariance).cholesky();
        root.map_or(f64::INFINITY, |root| way.dot(&root.solve(&way)))
    }

    /// Starts at its sigma points, with what is believed of it.
    pub fn sigma_points(&self) -> Vec<Led> {
        let Some(root) = self.covariance.cholesky().map(|root| root.unpack()) else { return Vec::new() };
        let belief = Belief { mean: Tangent::zeros(), covariance: self.covariance };
        let (trust, log_evidence) = (&self.trust, self.log_evidence);
        let led = |way: Tangent| Led { pose: self.pose.moved(&way), log_evidence, belief, trust: trust.clone() };
        (0..6).flat_map(|axis| [SIGMA_POINTS, -SIGMA_POINTS].map(|far| root.column(axis) * far)).map(led).collect()
    }

    /// The same answer where its modes, of which the first is the likeliest, leave it possible, by the odds against each
    /// (`docs/math.md`, eq. 17.11). It is compared with others by its own evidence, as these were not looked for as closely.
    pub fn over_modes(self, modes: &[Self], regions: &[SampledRegion]) -> Self {
        let Some((best, rest)) = modes.split_first() else { return self };
        // Odds beyond a number's range are as good as its largest.
        let log_odds = |mode: &Self| (-0.5 * best.against(mode, regions)).min(f64::MAX.ln());
        let odds = rest.iter().map(|mode| (log_odds(mode), mode.pose, mode.covariance));
        let all: Vec<_> = std::iter::once((0.0, best.pose, best.covariance)).chain(odds).collect();
        let (pose, covariance) = mixed(&best.pose, &all);
        Self { pose, covariance, ..self }
    }

    fn compared(&self) -> Compared<'_> {
        let Self { pose, trust, log_evidence, log_known, .. } = self;
        Compared { pose, trust, log_evidence: *log_evidence, log_known: *log_known }
    }
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

/// Where some of the samples lead a start, while their blur falls by halves from as far as they lie on the wrong side;
/// `others` gives what else is known at a pose. `None` where a direction is left free.
pub fn led(regions: &[SampledRegion], others: &impl Fn(&Pose) -> Gaussian, start: &Pose) -> Option<Led> {
    let step = leading_step(regions);
    let free = Belief { mean: Tangent::zeros(), covariance: Matrix6::zeros() };
    let mut samples = Samples::some(regions, others, *start, step);
    let mut state = State { pose: *start, belief: free, log_evidence: f64::NEG_INFINITY, log_following: 0.0 };
    let mut blur = first_blur(regions, start, step);
    loop {
        state = samples.settled(state, Setting { blur, growth: 0.0, off: 0.0 }, ROUNDS, false)?;
        if blur <= SHARP {
            let State { pose, log_evidence, belief, .. } = state;
            return Some(Led { pose, log_evidence, belief, trust: samples.trust });
        }
        blur = if effort::is_spent() { SHARP } else { (blur * STEP).max(SHARP) };
    }
}

/// What all samples leave possible about starts that some of them led on, whatever the blur and whatever contours are
/// off. First the blur falls on from there, then contours may be grown farther and farther. What is off looks blurred
/// to those who do not know of it: where the finest blur is not the likeliest, it falls once more from the start with
/// stretches that are off as far as they may be. Then stretches are off more and more, and where anything is off the
/// blur falls again. A start that is behind the best by more than `hopeless`, in logarithms of the evidence, goes no
/// farther.
pub fn posteriors(
    regions: &[SampledRegion],
    others: &impl Fn(&Pose) -> Gaussian,
    led: &[Led],
    hopeless: f64,
) -> Vec<Posterior> {
    let mut all: Vec<_> = led.iter().map(|from| Going::new(regions, others, from)).collect();
    let [least, more @ ..] = SCALES;
    let most = more[more.len() - 1];
    for blur in blurs() {
        go_on(&mut all, hopeless, |_| Some(Setting { blur, growth: least, off: least }));
    }
    all.retain_mut(|one| one.go_back().is_some());
    for growth in more {
        go_on(&mut all, hopeless, |one| Some(Setting { growth, ..one.likeliest()? }));
    }
    all.iter_mut().for_each(Going::start_again);
    for blur in blurs() {
        go_on(&mut all, hopeless, |one| Some(Setting { blur, growth: one.again?, off: most }));
    }
    all.retain_mut(|one| one.go_back().is_some());
    for off in more {
        let next = |one: &Going<_>| Some(Setting { off, ..one.likeliest()? });
        go_on(&mut all, hopeless, |one| next(one).filter(|setting| !one.was_at(setting)));
    }
    all.retain_mut(|one| one.go_back().is_some());
    for blur in blurs() {
        let is_new = |likeliest: &Setting| likeliest.growth.max(likeliest.off) > least && blur < likeliest.blur;
        go_on(&mut all, hopeless, |one| Some(Setting { blur, ..one.likeliest().filter(is_new)? }));
    }
    all.into_iter().filter_map(Going::ended).collect()
}

/// The blurs with all samples, falling.
fn blurs() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(SHARP), |blur| Some(blur * STEP)).take_while(|blur| *blur >= FINEST)
}

/// Takes all starts to their next settings, those that have one, and leaves out those that are hopeless; where no effort is
/// left, those alone that have not been anywhere yet.
fn go_on<F: Fn(&Pose) -> Gaussian>(
    all: &mut Vec<Going<F>>,
    hopeless: f64,
    next: impl Fn(&Going<F>) -> Option<Setting>,
) {
    all.retain_mut(|one| {
        let enough = effort::is_spent() && one.best.is_some();
        enough || next(one).is_none_or(|setting| one.go_to(setting).is_some())
    });
    let Some(best) = (0..all.len()).max_by(|&a, &b| all[a].heard().total_cmp(&all[b].heard())) else { return };
    let is_behind = |one: &Going<F>| all[best].heard() - one.heard() > hopeless && !all[best].may_lead_by_chance(one);
    let behind: Vec<bool> = all.iter().map(is_behind).collect();
    let mut behind = behind.into_iter();
    all.retain(|_| behind.next() == Some(false));
}

/// Blur of labels, and how far contours are grown and clean stretches of them are off at least (standard deviations),
/// pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Setting {
    pub(super) blur: f64,
    pub(super) growth: f64,
    pub(super) off: f64,
}

/// A start on its way with all samples.
struct Going<'a, F> {
    samples: Samples<'a, F>,
    state: State,
    /// What it started from, and how far contours are grown where the blur falls once more from there.
    first: (State, Samples<'a, F>),
    again: Option<f64>,
    /// Where it was with each setting.
    found: Vec<(State, Setting)>,
    /// The likeliest of these, and the samples then.
    best: Option<(State, Setting, Samples<'a, F>)>,
}

impl<'a, F: Fn(&Pose) -> Gaussian> Going<'a, F> {
    fn new(regions: &'a [SampledRegion], others: &'a F, from: &Led) -> Self {
        let state = State { pose: from.pose, belief: from.belief, log_evidence: f64::NEG_INFINITY, log_following: 0.0 };
        let samples = Samples::all(regions, others, from.pose, from.trust.clone());
        Self { first: (state, samples.clone()), again: None, samples, state, found: Vec::new(), best: None }
    }

    /// Goes back to its start where something looks blurred.
    fn start_again(&mut self) {
        let blurred = self.best.as_ref().filter(|(_, setting, _)| setting.blur > FINEST);
        self.again = blurred.map(|(_, setting, _)| setting.growth);
        if self.again.is_some() {
            (self.state, self.samples) = self.first.clone();
        }
    }

    /// Whether it was there with a setting.
    fn was_at(&self, setting: &Setting) -> bool {
        self.found.iter().any(|(_, other)| other == setting)
    }

    /// The greatest logarithm of the evidence so far.
    fn most(&self) -> f64 {
        self.best.as_ref().map_or(f64::NEG_INFINITY, |(state, ..)| state.log_evidence)
    }

    /// The greatest logarithm of the evidence of the labels that follow from no others: where a mean is not settled, it puts those
    /// that do on the wrong side together.
    fn heard(&self) -> f64 {
        self.found.iter().map(|(state, _)| state.heard()).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether chance may have decided between the likeliest states of both.
    fn may_lead_by_chance(&self, other: &Self) -> bool {
        let (Some(own), Some(other)) = (self.compared(), other.compared()) else { return false };
        own.against(&other, self.samples.regions) <= ALIKE
    }

    fn compared(&self) -> Option<Compared<'_>> {
        let (state, _, samples) = self.best.as_ref()?;
        let (trust, log_known) = (&samples.trust, samples.log_known(&state.pose));
        Some(Compared { pose: &state.pose, trust, log_evidence: state.log_evidence, log_known })
    }

    /// The likeliest setting, unless the last one is so much less likely that farther ones tell nothing.
    fn likeliest(&self) -> Option<Setting> {
        let is_likely = self.most() - self.state.log_evidence <= NOTHING;
        self.best.as_ref().filter(|_| is_likely).map(|(_, setting, _)| *setting)
    }

    /// The state with a setting; `None` where a direction is left free.
    fn go_to(&mut self, setting: Setting) -> Option<()> {
        self.state = self.samples.settled(self.state, setting, ROUNDS, false)?;
        if self.state.log_evidence > self.most() {
            self.best = Some((self.state, setting, self.samples.clone()));
        }
        self.found.push((self.state, setting));
        Some(())
    }

    /// Goes back to the likeliest setting; `None` where there is none.
    fn go_back(&mut self) -> Option<Setting> {
        let (state, setting, samples) = self.best.as_ref()?;
        (self.state, self.samples) = (*state, samples.clone());
        Some(*setting)
    }

    /// The likeliest setting's state over the whole of its belief, and those of all settings together.
    fn ended(mut self) -> Option<Posterior> {
        let setting = self.go_back()?;
        let likeliest = self.state;
        let last = self.samples.settled(likeliest, setting, LAST_ROUNDS, true)?;
        let wrong = self.samples.wrong(&last);
        let rest = self.found.iter().filter(|(_, other)| *other != setting);
        // What follows from other labels may be right for one reason with them: it has no say in how far contours are off.
        let odds = rest.map(|(state, _)| (state.heard(), state)).chain([(likeliest.heard(), &last)]);
        let states = odds.map(|(weight, state)| (weight, state.pose, state.belief.covariance));
        let (pose, covariance) = mixed(&last.pose, &states.collect::<Vec<_>>());
        let (trust, log_known) = (self.samples.trust.clone(), self.samples.log_known(&pose));
        let State { log_evidence, .. } = last;
        Some(Posterior { pose, covariance, log_evidence, blur: setting.blur, wrong, trust, log_known })
    }
}

impl State {
    /// Logarithm of the evidence of the labels that follow from no others.
    fn heard(&self) -> f64 {
        self.log_evidence - self.log_following
    }
}

/// Mean and covariance of several distributions together, each with the logarithm of its weight, about a pose that is near to
/// all.
fn mixed(about: &Pose, all: &[(f64, Pose, Matrix6<f64>)]) -> (Pose, Matrix6<f64>) {
    // The largest weight may be out of a number's range.
    let most = all.iter().map(|(weight, ..)| *weight).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = all.iter().map(|(weight, ..)| (weight - most).exp()).sum();
    let ways: Vec<_> =
        all.iter().map(|(weight, pose, _)| ((weight - most).exp() / sum, about.increment_to(pose))).collect();
    let mean: Tangent = ways.iter().map(|(weight, way)| way * *weight).sum();
    let spread = |(weight, way): &(f64, Tangent), covariance: &Matrix6<f64>| {
        (covariance + (way - mean) * (way - mean).transpose()) * *weight
    };
    let covariance = ways.iter().zip(all).map(|(way, (.., covariance))| spread(way, covariance)).sum();
    (about.moved(&mean), covariance)
}
