//! From a start to what the samples leave possible about it, with a falling blur (`docs/math.md`, section 17).

use nalgebra::Matrix6;

use super::labels::{ALIKE, Compared, SHARP, first_blur, leading_step};
use super::readings::SampledRegion;
use super::settings::{BESIDE, GROWTHS, OFFS, Setting, blurs, shares};
use super::telling::{Samples, State, WORSE};
use super::trust::Trust;
use crate::effort;
use crate::geometry::pose::{Pose, Tangent};
use crate::math::gaussian::{Gaussian, Normal};

/// From blur to blur, while some of the samples lead a start: a convention. Those with all samples are in `settings.rs`.
const STEP: f64 = 0.5;

/// Logarithm of odds from which a setting that is farther on tells nothing.
const NOTHING: f64 = 10.0;

/// Squared distance of two states, in variances of both together, and difference of their logarithms of evidence, up to which they are
/// one: a tenth of each, by convention.
const SAME_STATE: f64 = 0.01;
const SAME_EVIDENCE: f64 = 0.1;

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
    /// The likeliest blur of single labels, pixels.
    pub blur: f64,
    /// How far contours are likeliest grown, as a standard deviation, pixels.
    pub growth: f64,
    /// Share of each region's telling samples that lie on the wrong side of its contour.
    pub wrong: Vec<f64>,
    /// The factor of the left increment that stands for the samples of each region that tell something, by its place in the problem.
    pub messages: Vec<(usize, Gaussian)>,
    /// What is compared with others.
    compared: Compared,
}

impl Posterior {
    /// Logarithm of the evidence.
    pub fn log_evidence(&self) -> f64 {
        self.compared.log_evidence
    }

    /// Twice the logarithm of the odds against another one (`docs/math.md`, eq. 17.11).
    #[doc(hidden)]
    pub fn against(&self, other: &Self, regions: &[SampledRegion]) -> f64 {
        self.compared.against(&other.compared, regions)
    }

    /// The same where what is known speaks for it by so much more, as a logarithm.
    #[doc(hidden)]
    pub fn with_known(self, log_known: f64) -> Self {
        let Self { mut compared, .. } = self;
        compared.log_evidence += log_known;
        compared.log_known += log_known;
        Self { compared, ..self }
    }

    /// Squared distance to another one, in variances of both together; infinite where these are none.
    pub fn squared_sigmas_to(&self, other: &Self) -> f64 {
        let way = self.pose.increment_to(&other.pose);
        let root = (self.covariance + other.covariance).cholesky();
        root.map_or(f64::INFINITY, |root| way.dot(&root.solve(&way)))
    }

    /// The same answer where its modes, of which the first is the likeliest, leave it possible, by the odds against each
    /// (`docs/math.md`, eq. 17.11). It is compared with others by its own evidence.
    #[doc(hidden)]
    pub fn over_modes(self, modes: &[Self], regions: &[SampledRegion]) -> Self {
        let Some((best, rest)) = modes.split_first() else { return self };
        // Odds beyond a number's range are as good as a very large one.
        let odds = rest.iter().map(|mode| (-0.5 * best.against(mode, regions)).exp().min(f64::MAX.sqrt()));
        let odds: Vec<f64> = std::iter::once(1.0).chain(odds).collect();
        let sum: f64 = odds.iter().sum();
        let all: Vec<_> = odds.iter().zip(modes).map(|(odds, mode)| (odds / sum, mode.pose, mode.covariance)).collect();
        let (pose, covariance) = mixed(&best.pose, &all);
        Self { pose, covariance, ..self }
    }
}

/// A start led on by some of the samples, to a blur from which on all of them tell more.
#[derive(Debug, Clone)]
pub struct Led {
    /// About the problem's origin.
    pub pose: Pose,
    /// Logarithm of the evidence of the samples that led it.
    pub log_evidence: f64,
    belief: Normal,
    trust: Vec<Trust>,
}

/// Where some of the samples lead a start, while their blur falls by halves from as far as they lie on the wrong side;
/// `others` gives what else is known at a pose. `None` where a direction is left free.
pub fn led(regions: &[SampledRegion], others: &impl Fn(&Pose) -> Gaussian, start: &Pose) -> Option<Led> {
    let step = leading_step(regions);
    let free = Normal { mean: Tangent::zeros(), covariance: Matrix6::zeros() };
    let mut samples = Samples::some(regions, others, *start, step);
    let mut state = State { pose: *start, belief: free, log_evidence: f64::NEG_INFINITY, is_settled: false };
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
/// off. All falls from wide to fine: first the blur, with contours that may be grown and stretches that may be off as far as
/// they mostly are, then, with the likeliest blur, how far stretches are off with contours that are ever less grown, but for what
/// follows on what is hardly likely; last, stretches that are twice and half as far off as the likeliest. A start that is
/// behind the best by more than `hopeless`, in logarithms of the evidence, goes no farther, nor does one that comes to where one has
/// `passed`, of these or of earlier ones, with the same setting.
pub fn posteriors(
    regions: &[SampledRegion],
    others: &impl Fn(&Pose) -> Gaussian,
    led: &[Led],
    hopeless: f64,
    passed: &mut Passed,
) -> Vec<Posterior> {
    let mut all: Vec<_> = led.iter().map(|from| Going::new(regions, others, from)).collect();
    for blur in blurs() {
        go_on(&mut all, hopeless, passed, |_| Some(Setting { blur, growth: GROWTHS[0], off: OFFS[0] }));
    }
    for growth in GROWTHS {
        all.retain_mut(|one| one.go_back().is_some());
        for off in OFFS {
            go_on(&mut all, hopeless, passed, |one| one.likeliest_with(growth, off));
        }
    }
    for factor in [BESIDE, 1.0 / BESIDE] {
        all.retain_mut(|one| one.go_back().is_some());
        go_on(&mut all, hopeless, passed, |one| one.beside_likeliest(factor));
    }
    all.into_iter().filter_map(Going::ended).collect()
}

/// Where starts have been with each setting.
#[derive(Default)]
pub struct Passed(Vec<(State, Setting)>);

impl Passed {
    /// Adds a state; false where one was there already.
    fn is_new(&mut self, state: &State, setting: Setting) -> bool {
        let is_new = !self.0.iter().any(|(other, at)| *at == setting && other.is_same(state));
        self.0.extend(is_new.then_some((*state, setting)));
        is_new
    }
}

/// Takes all starts to their next settings, those that have one, and leaves out those that are hopeless or came to where one has
/// passed; where no effort is left, those alone that have not been anywhere yet.
fn go_on<F: Fn(&Pose) -> Gaussian>(
    all: &mut Vec<Going<F>>,
    hopeless: f64,
    passed: &mut Passed,
    next: impl Fn(&Going<F>) -> Option<Setting>,
) {
    all.retain_mut(|one| {
        let enough = effort::is_spent() && one.best.is_some();
        enough
            || next(one).is_none_or(|setting| match one.go_to(setting) {
                Some(()) => passed.is_new(&one.state, setting),
                // What leaves nothing with this setting is still where it was likeliest.
                None => one.go_back().is_some(),
            })
    });
    let Some(best) = (0..all.len()).max_by(|&a, &b| all[a].most().total_cmp(&all[b].most())) else { return };
    let is_behind = |one: &Going<F>| all[best].most() - one.most() > hopeless && !all[best].may_lead_by_chance(one);
    let behind: Vec<bool> = all.iter().map(is_behind).collect();
    let mut behind = behind.into_iter();
    all.retain(|_| behind.next() == Some(false));
}

/// A start on its way with all samples.
struct Going<'a, F> {
    samples: Samples<'a, F>,
    state: State,
    /// Where it was with each setting.
    found: Vec<(State, Setting)>,
    /// The likeliest of these, and the samples then.
    best: Option<(State, Setting, Samples<'a, F>)>,
}

impl<'a, F: Fn(&Pose) -> Gaussian> Going<'a, F> {
    fn new(regions: &'a [SampledRegion], others: &'a F, from: &Led) -> Self {
        let state = State { pose: from.pose, belief: from.belief, log_evidence: f64::NEG_INFINITY, is_settled: false };
        let samples = Samples::all(regions, others, from.pose, from.trust.clone());
        Self { samples, state, found: Vec::new(), best: None }
    }

    /// The greatest logarithm of the evidence so far.
    fn most(&self) -> f64 {
        self.best.as_ref().map_or(f64::NEG_INFINITY, |(state, ..)| state.log_evidence)
    }

    /// Whether chance may have decided between the likeliest states of both.
    fn may_lead_by_chance(&self, other: &Self) -> bool {
        let (Some(own), Some(other)) = (self.compared(), other.compared()) else { return false };
        own.against(&other, self.samples.regions) <= ALIKE
    }

    fn compared(&self) -> Option<Compared> {
        let (State { pose, log_evidence, .. }, _, samples) = self.best.as_ref()?;
        let log_known = samples.log_known(pose);
        Some(Compared { log_probabilities: samples.log_probabilities(pose), log_evidence: *log_evidence, log_known })
    }

    /// The likeliest setting with contours that are so far grown and off, unless it has been there, or where it last came as near to
    /// being that far off was so much less likely that this tells nothing.
    fn likeliest_with(&self, growth: f64, off: f64) -> Option<Setting> {
        let setting = Setting { growth, off, ..self.best.as_ref()?.1 };
        let wider = self.found.iter().rev().filter(|(_, found)| found.blur == setting.blur && found.off >= off);
        let (last, _) = wider.min_by(|(_, a), (_, b)| a.off.total_cmp(&b.off))?;
        (self.is_new(&setting) && self.most() - last.log_evidence <= NOTHING).then_some(setting)
    }

    /// The likeliest setting with corners that are off by so many times as much, unless it has been there.
    fn beside_likeliest(&self, factor: f64) -> Option<Setting> {
        let (_, likeliest, _) = self.best.as_ref()?;
        let setting = likeliest.times_off(factor);
        self.is_new(&setting).then_some(setting)
    }

    /// Whether it has not been there.
    fn is_new(&self, setting: &Setting) -> bool {
        self.found.iter().all(|(_, found)| !found.is_same(setting))
    }

    /// The state with a setting; `None` where a direction is left free.
    fn go_to(&mut self, setting: Setting) -> Option<()> {
        self.state = self.samples.settled(self.state, setting, ROUNDS, false)?;
        self.state.log_evidence += setting.log_prior();
        if self.best.as_ref().is_none_or(|(best, ..)| self.state.is_likelier(best)) {
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
        let last = match self.over_belief(setting) {
            Some(last) => last,
            None => {
                self.go_back()?;
                likeliest
            }
        };
        let (wrong, messages) = (self.samples.wrong(&last, setting), self.samples.messages());
        let is_other =
            |(state, other): &&(State, Setting)| state.is_settled && other.blur == setting.blur && *other != setting;
        let mut heard = vec![(likeliest.log_evidence, setting)];
        let mut states = vec![last];
        for (state, other) in self.found.iter().filter(is_other) {
            heard.push((state.log_evidence, *other));
            states.push(*state);
        }
        let states = shares(&heard).into_iter().zip(states);
        let states = states.map(|(share, state)| (share, state.pose, state.belief.covariance));
        let (pose, covariance) = mixed(&last.pose, &states.collect::<Vec<_>>());
        let (log_known, log_evidence) = (self.samples.log_known(&pose), last.log_evidence);
        let compared =
            Compared { log_probabilities: self.samples.log_probabilities(&last.pose), log_evidence, log_known };
        let Setting { blur, growth, .. } = setting;
        Some(Posterior { pose, covariance, blur, growth, wrong, messages, compared })
    }

    /// The state with margins linearized over the whole of its belief; `None` where that finds no distribution, or one so
    /// much less likely that margins bend by more over the belief than their lines say.
    fn over_belief(&mut self, setting: Setting) -> Option<State> {
        let last = self.samples.settled(self.state, setting, LAST_ROUNDS, true)?;
        let log_evidence = last.log_evidence + setting.log_prior();
        let is_found = last.is_settled && self.state.log_evidence - log_evidence <= WORSE;
        is_found.then_some(State { log_evidence, ..last })
    }
}

impl State {
    /// Whether it is likelier than another one; what did not settle is not, where that did.
    fn is_likelier(&self, other: &Self) -> bool {
        (self.is_settled, self.log_evidence) > (other.is_settled, other.log_evidence)
    }

    /// Whether another one is the same, but for what chance there is in the way to it.
    fn is_same(&self, other: &Self) -> bool {
        let way = self.pose.increment_to(&other.pose);
        let root = (self.belief.covariance + other.belief.covariance).cholesky();
        (self.log_evidence - other.log_evidence).abs() < SAME_EVIDENCE
            && root.is_some_and(|root| way.dot(&root.solve(&way)) < SAME_STATE)
    }
}

/// Mean and covariance of several distributions together, each with its share, about a pose that is near to all.
fn mixed(about: &Pose, all: &[(f64, Pose, Matrix6<f64>)]) -> (Pose, Matrix6<f64>) {
    let ways: Vec<_> = all.iter().map(|(share, pose, _)| (*share, about.increment_to(pose))).collect();
    let mean: Tangent = ways.iter().map(|(share, way)| way * *share).sum();
    let spread = |(share, way): &(f64, Tangent), covariance: &Matrix6<f64>| {
        (covariance + (way - mean) * (way - mean).transpose()) * *share
    };
    let covariance = ways.iter().zip(all).map(|(way, (.., covariance))| spread(way, covariance)).sum();
    (about.moved(&mean), covariance)
}
