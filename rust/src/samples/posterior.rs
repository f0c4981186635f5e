//! From a start to what the samples leave possible about it, with a falling blur (`docs/math.md`, section 16).

use nalgebra::{Matrix6, Vector6};

use super::belief::Belief;
use super::normal::cumulative;
use super::propagation::{Site, propagated};
use super::readings::{Reading, SampledRegion};
use crate::geometry::pose::{Pose, Tangent};
use crate::prior::Gaussian;

/// The finest blur, pixels: contours of binary masks scatter by as much.
const FINEST: f64 = 0.25;

/// The coarsest one, pixels.
const COARSEST: f64 = 64.0;

/// From blur to blur.
const STEP: f64 = 0.5;

/// Blur from which on all samples count, pixels; on the way to it about so many of all regions lead as well.
const SHARP: f64 = 4.0;
const LEADING: usize = 200;

/// Share of wrong labels before any is known, and the number of samples that it stands for.
const WRONG: f64 = 0.03;
const WEIGHT: f64 = 30.0;

/// Largest share of wrong labels: no more than a coin would err.
const MOST_WRONG: f64 = 0.5;

/// Logarithm of the probability of a label of which the contour tells nothing: a coin's. Were it one, the likeliest pose would be
/// one that shows all samples where nothing is known.
const UNKNOWN: f64 = -std::f64::consts::LN_2;

/// Relinearisations at one blur at most: on the way, and where they end.
const ROUNDS: usize = 2;
const LAST_ROUNDS: usize = 8;

/// A relinearisation that moves by less than this many standard deviations is the last.
const SETTLED: f64 = 0.1;

/// Longest step, rad and share of the distance.
const LONGEST: f64 = 0.3;

/// Margins beyond this many standard deviations of blur and belief tell nothing that moves the pose.
const REACH: f64 = 6.0;

/// Deviation of an increment from the start before anything is seen: a radian, and the distance.
const ANCHOR: f64 = 1.0;

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
    /// Share of wrong labels of each region with samples.
    pub wrong: Vec<f64>,
    /// Number of samples near enough to the contours to tell anything.
    pub telling: usize,
}

/// The samples of several regions at a pose.
struct Sites<'a> {
    regions: &'a [SampledRegion],
    step: usize,
    all: Vec<Site>,
    /// Region of each site, and its sample's number.
    places: Vec<(usize, usize)>,
    /// Natural parameters of the factors of all samples, region by region.
    factors: Vec<Vec<(f64, f64)>>,
    /// Share of wrong labels of each region.
    wrong: Vec<f64>,
    /// Samples, region by region, right or wrong for certain, and those of which the contour tells nothing.
    certain: Vec<[usize; 2]>,
    unknown: usize,
}

impl<'a> Sites<'a> {
    fn new(regions: &'a [SampledRegion], step: usize, wrong: Vec<f64>) -> Self {
        let count = |region: &SampledRegion| region.count().div_ceil(step);
        Self {
            regions,
            step,
            all: Vec::new(),
            places: Vec::new(),
            factors: regions.iter().map(|region| vec![(0.0, 0.0); count(region)]).collect(),
            wrong,
            certain: Vec::new(),
            unknown: 0,
        }
    }

    /// The sites at a pose; of a belief of the increment there, those count whose margins it does not put out of reach.
    fn linearise(&mut self, pose: &Pose, belief: &Belief, blur: f64) {
        self.keep_factors();
        self.all.clear();
        self.places.clear();
        (self.certain, self.unknown) = (vec![[0, 0]; self.regions.len()], 0);
        for (region, sampled) in self.regions.iter().enumerate() {
            for (index, reading) in sampled.read(pose, self.step).enumerate() {
                match reading {
                    Reading::Seen(margin, slope) => self.add(region, index, Site::new(slope, margin, self.wrong[region]), belief, blur),
                    Reading::Behind(right) => self.certain[region][usize::from(!right)] += 1,
                    Reading::Unknown => self.unknown += 1,
                }
            }
        }
    }

    fn add(&mut self, region: usize, index: usize, site: Site, belief: &Belief, blur: f64) {
        let (margin, variance) = site.margin_under(belief);
        if margin.abs() > REACH * (blur * blur + variance).sqrt() {
            self.certain[region][usize::from(margin < 0.0)] += 1;
            return;
        }
        let (precision, pull) = self.factors[region][index];
        self.places.push((region, index));
        self.all.push(Site { precision, pull, ..site });
    }

    /// Remembers the factors, which stay what they are when margins are linearised anew.
    fn keep_factors(&mut self) {
        for (site, (region, index)) in self.all.iter().zip(&self.places) {
            self.factors[*region][*index] = (site.precision, site.pull);
        }
    }

    /// Logarithm of the probability of the labels that move nothing.
    fn log_certain(&self) -> f64 {
        let of = |([right, wrong], share): (&[usize; 2], &f64)| {
            *right as f64 * (1.0 - share).ln() + *wrong as f64 * share.ln()
        };
        self.certain.iter().zip(&self.wrong).map(of).sum::<f64>() + self.unknown as f64 * UNKNOWN
    }

    /// The shares of wrong labels that a belief shows, those that were expected beforehand among them.
    fn learn_wrong(&mut self, belief: &Belief, blur: f64) {
        let mut sums: Vec<[f64; 2]> = vec![[WEIGHT * WRONG, WEIGHT]; self.regions.len()];
        for (site, (region, _)) in self.all.iter().zip(&self.places) {
            sums[*region][0] += site.wrong_probability(belief, blur);
            sums[*region][1] += 1.0;
        }
        for (sum, [right, wrong]) in sums.iter_mut().zip(&self.certain) {
            *sum = [sum[0] + *wrong as f64, sum[1] + (right + wrong) as f64];
        }
        self.wrong = sums.iter().map(|[wrong, all]| (wrong / all).min(MOST_WRONG)).collect();
    }
}

/// What the samples leave possible about a start; `others` gives what else is known at a pose, as a factor of its increment.
///
/// The blur falls by halves from as far as samples lie on the wrong side, while the evidence grows. `None` where nothing is
/// held.
pub fn posterior(
    regions: &[SampledRegion],
    others: &impl Fn(&Pose) -> Gaussian,
    start: &Pose,
) -> Option<Posterior> {
    let all: usize = regions.iter().map(SampledRegion::count).sum();
    let few = (all / LEADING).max(1);
    let mut state = State { pose: *start, belief: Belief { mean: Tangent::zeros(), covariance: Matrix6::zeros() } };
    let mut blur = first_blur(regions, start, few);
    let mut sites = Sites::new(regions, few, vec![WRONG; regions.len()]);
    while blur > SHARP {
        state = settled(&mut sites, others, start, state, blur, ROUNDS)?.0;
        blur *= STEP;
    }
    let mut sites = Sites::new(regions, 1, sites.wrong);
    let mut best: Option<Posterior> = None;
    loop {
        let (next, log_evidence) = settled(&mut sites, others, start, state, blur, LAST_ROUNDS)?;
        state = next;
        let worse = best.as_ref().is_some_and(|best| best.log_evidence > log_evidence);
        if worse {
            break;
        }
        let State { pose, belief } = state;
        let wrong = sites.wrong.clone();
        best = Some(Posterior { pose, covariance: belief.covariance, log_evidence, blur, wrong, telling: sites.all.len() });
        if blur <= FINEST {
            break;
        }
        blur = (blur * STEP).max(FINEST);
    }
    best
}

/// A pose and what is believed of it.
#[derive(Clone, Copy)]
struct State {
    pose: Pose,
    belief: Belief,
}

/// The belief once its mean is where it was linearised, and the logarithm of the evidence.
fn settled(
    sites: &mut Sites,
    others: &impl Fn(&Pose) -> Gaussian,
    start: &Pose,
    mut state: State,
    blur: f64,
    rounds: usize,
) -> Option<(State, f64)> {
    let mut log_evidence = f64::NEG_INFINITY;
    for _ in 0..rounds {
        let factor = anchor(start, &state.pose) + others(&state.pose);
        sites.linearise(&state.pose, &Belief { mean: Tangent::zeros(), ..state.belief }, blur);
        let (belief, integral) = propagated(&factor, &mut sites.all, blur)?;
        log_evidence = integral + sites.log_certain();
        sites.learn_wrong(&belief, blur);
        let way = belief.mean.dot(&belief.covariance.cholesky()?.solve(&belief.mean));
        state = State { pose: state.pose.moved(&shortened(&belief.mean, &state.pose)), belief };
        if way < SETTLED * SETTLED {
            break;
        }
    }
    Some((state, log_evidence))
}

/// The start as all that is known of a pose: without it, what the samples leave free would drift.
fn anchor(start: &Pose, pose: &Pose) -> Gaussian {
    let distance = start.translation.norm();
    let [turn, way] = [ANCHOR, ANCHOR * distance];
    Gaussian::normal(&pose.increment_to(start), &Vector6::new(turn, turn, turn, way, way, way))
}

/// An increment no longer than the longest step.
fn shortened(increment: &Tangent, pose: &Pose) -> Tangent {
    let distance = pose.translation.norm().max(f64::MIN_POSITIVE);
    let size = increment.fixed_rows::<3>(0).norm().max(increment.fixed_rows::<3>(3).norm() / distance);
    increment * (LONGEST / size).min(1.0)
}

/// The blur at which a start is no worse than any: as far as samples lie on the wrong side, root mean square, pixels.
fn first_blur(regions: &[SampledRegion], pose: &Pose, step: usize) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for reading in regions.iter().flat_map(|region| region.read(pose, step)) {
        if let Reading::Seen(margin, _) = reading && margin < 0.0 {
            squares += margin * margin;
            count += 1.0;
        }
    }
    (2.0 * (squares / f64::max(count, 1.0)).sqrt()).clamp(SHARP, COARSEST)
}

/// Logarithm of the probability of all labels at a pose that is not refined, with this blur.
pub fn log_likelihood(regions: &[SampledRegion], pose: &Pose, blur: f64, step: usize) -> f64 {
    let label = |reading: Reading| match reading {
        Reading::Seen(margin, _) => (WRONG + (1.0 - 2.0 * WRONG) * cumulative(margin / blur)).ln(),
        Reading::Behind(right) => (if right { 1.0 - WRONG } else { WRONG }).ln(),
        Reading::Unknown => UNKNOWN,
    };
    regions.iter().flat_map(|region| region.read(pose, step)).map(label).sum()
}
