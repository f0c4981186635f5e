//! The samples that tell something at a pose, and what is believed once they are heard (`docs/math.md`, section 17).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Matrix6, Vector6};

use super::kinds::{KINDS, Kind};
use super::labels::{leading_step, log_likelihood};
use super::outline::{Outline, View};
use super::propagation::{Propagated, Site, propagated, propagated_apart};
use super::readings::{Edge, REACH, Reading, SampledRegion};
use super::ring::Ring;
use super::settings::Setting;
use super::stretch::{Known, Stretch};
use super::trust::{FAR_BLURS, FAR_OFF, Label, Shown, Trust};
use crate::contour::fit::size;
use crate::effort;
use crate::geometry::pose::{Pose, Tangent};
use crate::math::gaussian::{Gaussian, Normal};

/// The finest blur of single labels, pixels: a quarter of what contours of binary masks scatter by, most of which neighbors share. With
/// 0.25 px, the ellipsoid of 90 % holds 6 of 20 poses from rows along sides (`cargo test sampled::`).
pub(super) const FINEST: f64 = 0.0625;

/// A relinearization that moves by less than this many standard deviations is the last: a convention, as that of one state
/// (`posterior.rs`).
const SETTLED: f64 = 0.1;

/// Share of a step that is gone where the last one came from ahead.
const RELAXED: f64 = 0.5;

/// How much less likely what is known may be at a mean than where it was looked for from, or over the whole of a belief than at its
/// mean, as a logarithm: twice the 3 that six parameters lose by chance. What is farther is approached by half, so many times.
pub(super) const WORSE: f64 = 6.0;
const HALVINGS: usize = 4;

/// Distance of sigma points from the mean in standard deviations, the root of the dimension: their covariance is the
/// belief's.
const SIGMA_POINTS: f64 = 2.449_489_742_783_178;

/// Longest step, rad and share of the distance.
const LONGEST: f64 = 0.3;

/// A sample lies on the wrong side if by more than this many standard deviations.
const CLEARLY: f64 = 2.0;

/// How much wider the belief of some samples is taken before all of them have told theirs.
const WIDER: f64 = 3.0;

/// Deviation of an increment from the start before anything is seen: a radian, and the distance.
const ANCHOR: f64 = 1.0;

/// A sample that tells something: its site, its region's place among those with samples, its number there, the stretch of the
/// contour that it lies beside, and whether it lies clearly on the wrong side of that.
#[derive(Clone)]
pub(super) struct Telling {
    site: Site,
    region: usize,
    number: usize,
    stretch: usize,
    wrong: bool,
    /// Logarithm of the probability of its label under what was believed last.
    told: f64,
}

impl Telling {
    /// Its region and the stretch that it lies beside.
    fn place(&self) -> (usize, usize) {
        (self.region, self.stretch)
    }
}

impl AsRef<Site> for Telling {
    fn as_ref(&self) -> &Site {
        &self.site
    }
}

impl AsMut<Site> for Telling {
    fn as_mut(&mut self) -> &mut Site {
        &mut self.site
    }
}

/// The samples of several regions about a start.
pub(super) struct Samples<'a, F> {
    pub(super) regions: &'a [SampledRegion],
    /// What else is known at a pose.
    others: &'a F,
    start: Pose,
    /// One sample in so many is taken.
    step: usize,
    /// Whether samples beside one stretch of a contour are off together.
    joined: bool,
    pub(super) telling: Vec<Telling>,
    /// The contours that these lie beside; none where each is off by itself.
    outlines: Vec<Outline>,
    /// How far contours are grown all around, pixels (standard deviation).
    growth: f64,
    /// How far the contours' corners are off along either axis, pixels (standard deviation).
    clean: f64,
    /// How far the labels of each region are to be trusted, and what those that move nothing show of it.
    pub(super) trust: Vec<Trust>,
    certain: Vec<Shown>,
}

/// A pose and what is believed of its left increment.
#[derive(Clone, Copy)]
pub(super) struct State {
    pub(super) pose: Pose,
    pub(super) belief: Normal,
    pub(super) log_evidence: f64,
    /// Whether the sweeps that led there settled: if not, the evidence is of no worth.
    pub(super) is_settled: bool,
}

impl<F> Clone for Samples<'_, F> {
    fn clone(&self) -> Self {
        let (telling, outlines) = (self.telling.clone(), self.outlines.clone());
        Self { telling, outlines, trust: self.trust.clone(), certain: self.certain.clone(), ..*self }
    }
}

impl<'a, F: Fn(&Pose) -> Gaussian> Samples<'a, F> {
    /// Every `step`-th sample, each off by itself.
    pub(super) fn some(regions: &'a [SampledRegion], others: &'a F, start: Pose, step: usize) -> Self {
        let (telling, outlines, certain) = (Vec::new(), Vec::new(), Vec::new());
        let trust = vec![Trust::unknown(); regions.len()];
        Self { regions, others, start, step, joined: false, telling, outlines, growth: 0.0, clean: 0.0, trust, certain }
    }

    /// All samples, trusted so far, those beside one stretch off together.
    pub(super) fn all(regions: &'a [SampledRegion], others: &'a F, start: Pose, trust: Vec<Trust>) -> Self {
        Self { joined: true, trust, ..Self::some(regions, others, start, 1) }
    }

    fn take(&mut self, setting: Setting) {
        let Setting { blur, growth, .. } = setting;
        (self.growth, self.clean) = (growth, if self.joined { setting.clean() } else { 0.0 });
        for (trust, sampled) in self.trust.iter_mut().zip(self.regions) {
            let wide = if self.joined { trust.wide } else { FAR_OFF * sampled.size() };
            (trust.blur, trust.wide) = (blur, wide.max(FAR_BLURS * blur.max(self.clean)));
        }
    }

    /// Lets samples and stretches be trusted as far as was learned.
    fn take_trust(&mut self) {
        let own: Vec<Trust> = (0..self.regions.len()).map(|region| self.own_trust(region)).collect();
        self.telling.iter_mut().for_each(|telling| telling.site.trust = own[telling.region]);
        for outline in &mut self.outlines {
            let kinds = kinds(&self.trust[outline.region]);
            outline.stretches_mut().for_each(|stretch| stretch.kinds = kinds);
        }
    }

    /// How far disturbed stretches of each region are off, as they show it, with one that is off by what was expected.
    fn learn_wide(&mut self, views: &[View]) {
        let mut sums: Vec<(f64, f64)> =
            self.regions.iter().map(|sampled| (1.0, (FAR_OFF * sampled.size()).powi(2))).collect();
        for (outline, view) in self.outlines.iter().zip(views) {
            let (count, square) = &mut sums[outline.region];
            for (stretch, views) in outline.stretches().zip(&view.stretches) {
                *count += stretch.known.odds[1];
                *square += stretch.known.odds[1] * views[1].square;
            }
        }
        for (trust, (count, square)) in self.trust.iter_mut().zip(sums) {
            trust.wide = (square / count).sqrt().max(FAR_BLURS * trust.blur.max(self.clean));
        }
    }

    /// What the samples of each region say of the increment, by the region's place in the problem.
    pub(super) fn messages(&self) -> Vec<(usize, Gaussian)> {
        self.outlines.iter().map(|outline| (self.regions[outline.region].index(), outline.message())).collect()
    }

    /// How far the labels of a region's samples are to be trusted apart from the offset of their stretch.
    fn own_trust(&self, region: usize) -> Trust {
        let trust = self.trust[region];
        if self.joined { Trust { disturbed: 0.0, ..trust } } else { trust }
    }

    /// Finds the samples that tell something at a pose: whose margins blur, belief and the offset of a stretch that may
    /// be disturbed do not put out of reach.
    fn look(&mut self, state: &State, setting: Setting) {
        let known = std::mem::take(&mut self.telling);
        let mut known = known.iter().peekable();
        self.take(setting);
        self.certain = vec![Shown::default(); self.regions.len()];
        let mut seen = Vec::new();
        for (region, sampled) in self.regions.iter().enumerate() {
            let trust = self.own_trust(region);
            for number in (0..sampled.count()).step_by(self.step) {
                let before = known.next_if(|telling| (telling.region, telling.number) == (region, number));
                match sampled.read(&state.pose, number) {
                    Reading::Seen(sight) => {
                        let site = Site::new(&sight, trust);
                        // The factor of a margin stays what it is when that is linearized anew.
                        let site = before.map_or(site, |before| site.with_factor_of(&before.site));
                        seen.push(Telling { site, region, number, stretch: sight.stretch, wrong: false, told: 0.0 });
                    }
                    Reading::Behind(right) => self.certain[region].add(&trust.label_behind(right), !right),
                }
            }
        }
        self.sort(seen, &state.belief, setting.blur);
        self.join();
    }

    /// Keeps the samples that tell something under a belief.
    fn sort(&mut self, mut seen: Vec<Telling>, belief: &Normal, blur: f64) {
        let belief = Normal { mean: Tangent::zeros(), ..*belief };
        let margin = |telling: &Telling| {
            let (mean, variance) = telling.site.margin_under(&belief);
            (mean, (blur * blur + variance).sqrt())
        };
        for telling in &mut seen {
            let (mean, deviation) = margin(telling);
            telling.wrong = self.joined && telling.site.edge == Edge::Own && mean < -CLEARLY * deviation;
        }
        // Nothing speaks for an offset of a stretch beside which no sample is on the wrong side.
        let doubtful: BTreeSet<_> = seen.iter().filter(|telling| telling.wrong).map(Telling::place).collect();
        for telling in seen {
            let (mean, deviation) = margin(&telling);
            let wide = if doubtful.contains(&telling.place()) { self.trust[telling.region].wide } else { 0.0 };
            if mean.abs() > REACH * deviation.hypot(wide).hypot(self.growth).hypot(self.clean) {
                let label = telling.site.label(&belief);
                self.certain[telling.region].add(&label, mean < 0.0);
            } else {
                self.telling.push(telling);
            }
        }
    }

    /// Puts the telling samples beside their stretches, which keep what is known of their kinds.
    fn join(&mut self) {
        let mut members: BTreeMap<usize, BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
        for (index, telling) in self.telling.iter().enumerate().filter(|_| self.joined) {
            members.entry(telling.region).or_default().entry(telling.stretch).or_default().push(index);
        }
        let known: BTreeMap<_, _> = self.outlines.iter().flat_map(known).collect();
        let outline = |(region, mut stretches): (usize, BTreeMap<usize, Vec<usize>>)| {
            let (sampled, kinds) = (&self.regions[region], kinds(&self.trust[region]));
            let mut stretch = |number: usize| {
                let beside = stretches.remove(&number).unwrap_or_default();
                let mut stretch = Stretch::new(number, sampled.normal(number), sampled.length(number), beside, kinds);
                known.get(&(region, number)).into_iter().for_each(|&known| stretch.known = known);
                stretch
            };
            let rings = sampled.rings().iter();
            let rings = rings.map(|numbers| Ring::new(self.clean, numbers.clone().map(&mut stretch)));
            let rings = rings.filter(|ring| ring.stretches.iter().any(|stretch| !stretch.members.is_empty())).collect();
            Outline { region, growth: self.growth, rings }
        };
        self.outlines = members.into_iter().map(outline).collect();
    }

    /// Linearizes the telling samples at a pose; one that tells no longer stays as it was.
    fn linearize(&mut self, pose: &Pose) {
        for telling in &mut self.telling {
            if let Reading::Seen(sight) = self.regions[telling.region].read(pose, telling.number) {
                telling.site = Site { edge: sight.edge, ..telling.site.with_line(&sight.slope, sight.margin) };
            }
        }
    }

    /// The lines that the margins of the telling samples follow best over the whole of a belief about a pose, and how
    /// far they bend from these (statistical linear regression at the belief's sigma points).
    fn regress(&mut self, state: &State) {
        let Some(root) = state.belief.covariance.cholesky().map(|root| root.unpack()) else { return };
        let ways: [Tangent; 6] = std::array::from_fn(|axis| root.column(axis) * SIGMA_POINTS);
        let poses = ways.map(|way| [way, -way].map(|way| state.pose.moved(&way)));
        let Some(inverse) = root.try_inverse() else { return };
        for telling in &mut self.telling {
            let mut margins = [[0.0; 2]; 6];
            let mut seen = true;
            for (margin, pose) in margins.iter_mut().flatten().zip(poses.iter().flatten()) {
                match self.regions[telling.region].read(pose, telling.number) {
                    Reading::Seen(sight) => *margin = sight.margin,
                    _ => seen = false,
                }
            }
            if seen {
                telling.site = regressed(&telling.site, &margins, &inverse);
            }
        }
    }

    /// Logarithm of what else is known at a pose.
    pub(super) fn log_known(&self, pose: &Pose) -> f64 {
        (self.others)(pose).offset
    }

    /// Logarithm of the probability of the labels that move nothing.
    fn log_certain(&self) -> f64 {
        self.certain.iter().map(|shown| shown.log_probability).sum()
    }

    /// What all labels show of each region under what is believed of its contour, or of the increment alone.
    fn shown(&self, belief: &Normal, views: &[View]) -> Vec<Shown> {
        let mut shown = self.certain.clone();
        if !self.joined {
            self.telling.iter().for_each(|telling| shown[telling.region].add(&telling.site.label(belief), true));
        }
        for (outline, view) in self.outlines.iter().zip(views) {
            for (stretch, views) in outline.stretches().zip(&view.stretches) {
                for (disturbed, label) in stretch.shown(views) {
                    shown[outline.region].add(&Label { disturbed, ..label }, true);
                }
            }
        }
        shown
    }

    /// Keeps what is believed of each label.
    fn keep_told(&mut self, views: &[View]) {
        for (outline, view) in self.outlines.iter().zip(views) {
            for (stretch, views) in outline.stretches().zip(&view.stretches) {
                for (&member, (_, label)) in stretch.members.iter().zip(stretch.shown(views)) {
                    self.telling[member].told = label.log_probability;
                }
            }
        }
    }

    /// Logarithm of the probability of each label, around each region: of those that tell something under what was believed last, of
    /// the others at a pose.
    pub(super) fn log_probabilities(&self, pose: &Pose) -> Vec<f64> {
        let mut told: BTreeMap<_, _> =
            self.telling.iter().map(|telling| ((telling.region, telling.number), telling.told)).collect();
        let mut all = Vec::new();
        for (region, sampled) in self.regions.iter().enumerate() {
            let trust = self.own_trust(region);
            all.extend(sampled.around().iter().map(|&number| match told.remove(&(region, number)) {
                Some(told) => told,
                None => trust.reading(&sampled.read(pose, number)).log_probability,
            }));
        }
        all
    }

    /// How far labels are to be trusted as a belief shows it, with what was expected beforehand.
    fn learn_trust(&mut self, belief: &Normal, views: &[View]) {
        let shown = self.shown(belief, views);
        self.trust.iter_mut().zip(&shown).for_each(|(trust, shown)| *trust = trust.learned(shown));
    }

    /// Share of each region's samples near its contour, as near as disturbed parts reach, that lie on its wrong side at
    /// a pose.
    pub(super) fn wrong(&self, state: &State, setting: Setting) -> Vec<f64> {
        let belief = Normal { mean: Tangent::zeros(), ..state.belief };
        let share = |(region, sampled): (usize, &SampledRegion)| {
            let trust = self.trust[region];
            let (mut wrong, mut near) = (0.0, 0.0);
            for reading in (0..sampled.count()).map(|number| sampled.read(&state.pose, number)) {
                let (margin, deviation) = match reading {
                    Reading::Seen(sight) if sight.edge == Edge::Own => {
                        let (mean, variance) = Site::new(&sight, trust).margin_under(&belief);
                        (mean, setting.spread().hypot(variance.sqrt()))
                    }
                    Reading::Behind(false) => (f64::NEG_INFINITY, 1.0),
                    _ => continue,
                };
                let is_wrong = margin < -CLEARLY * deviation;
                wrong += f64::from(u8::from(is_wrong));
                near += f64::from(u8::from(is_wrong || margin < trust.wide));
            }
            wrong / f64::max(near, 1.0)
        };
        self.regions.iter().enumerate().map(share).collect()
    }

    /// What stands in for factors that are not known yet: the belief of the state three times as wide, or as much as
    /// one sample would tell.
    fn guard(&self, state: &State, blur: f64) -> Gaussian {
        let known = state.belief.covariance.cholesky().map(|root| root.inverse() / (WIDER * WIDER));
        let unit = || {
            let mut information = Matrix6::zeros();
            for telling in &self.telling {
                information.ger(1.0, &telling.site.slope, &telling.site.slope, 1.0);
            }
            // Where no sample tells anything, there is nothing to guard from.
            information / (self.telling.len().max(1) as f64 * blur * blur)
        };
        Gaussian { information: known.unwrap_or_else(unit), ..Gaussian::default() }
    }

    /// The pose after an increment, or after a part of it where some of the samples and all else that is known are far less likely
    /// there.
    fn approached(&self, from: &Pose, increment: &Tangent, blur: f64) -> Pose {
        let step = leading_step(self.regions);
        let fit = |pose: &Pose| log_likelihood(self.regions, pose, blur, step) + (self.others)(pose).offset;
        let least = fit(from) - WORSE;
        let poses = (0..HALVINGS).map(|halving| from.moved(&(increment * RELAXED.powi(halving as i32))));
        poses.into_iter().find(|pose| fit(pose) >= least).unwrap_or(*from)
    }

    /// What the telling samples and all else that is known leave possible about a pose.
    fn propagate(&mut self, pose: &Pose, guard: &Gaussian) -> Option<Propagated> {
        let known = anchor(&self.start, pose) + (self.others)(pose);
        match self.joined {
            true => propagated(&known, guard, &self.telling, &mut self.outlines),
            false => propagated_apart(&known, guard, &mut self.telling),
        }
    }

    /// The belief once its mean is where it was linearized; `None` where a direction is left free, or nobody waits any more.
    pub(super) fn settled(&mut self, mut state: State, setting: Setting, rounds: usize, whole: bool) -> Option<State> {
        if effort::is_stopped() {
            return None;
        }
        let blur = setting.blur;
        let is_first = self.telling.is_empty();
        self.look(&state, setting);
        let (mut before, mut share) = (Tangent::zeros(), 1.0);
        for round in 0..rounds {
            if effort::is_stopped() {
                return None;
            }
            if round > 0 && effort::is_spent() {
                break;
            }
            if whole {
                self.regress(&state);
            } else if round > 0 {
                self.linearize(&state.pose);
            }
            let guard = if is_first && round == 0 { self.guard(&state, blur) } else { Gaussian::default() };
            let Propagated { belief, views, log_evidence, is_settled } = self.propagate(&state.pose, &guard)?;
            self.learn_trust(&belief, &views);
            if self.joined {
                self.learn_wide(&views);
                self.keep_told(&views);
            }
            self.take_trust();
            let information = belief.covariance.cholesky()?;
            // A mean that goes to and fro lies between.
            if before.dot(&information.solve(&belief.mean)) < 0.0 {
                share *= RELAXED;
            }
            before = belief.mean;
            let way = belief.mean.dot(&information.solve(&belief.mean));
            let step = shortened(&(belief.mean * share), &state.pose);
            // A step within the belief stays where the lines are good.
            let pose = if way < 1.0 { state.pose.moved(&step) } else { self.approached(&state.pose, &step, blur) };
            let moved = state.pose.increment_to(&pose);
            self.outlines.iter_mut().for_each(|outline| outline.moved(&moved));
            state = State { pose, belief, log_evidence: log_evidence + self.log_certain(), is_settled };
            if way < SETTLED * SETTLED {
                break;
            }
        }
        Some(state)
    }
}

/// The kinds of a region's stretches: from corner to corner, or disturbed.
fn kinds(trust: &Trust) -> [Kind; KINDS] {
    [Kind { share: 1.0 - trust.disturbed, off: 0.0 }, Kind { share: trust.disturbed, off: trust.wide }]
}

/// What is known of each stretch of a contour, by region and number.
fn known(outline: &Outline) -> impl Iterator<Item = ((usize, usize), Known)> {
    outline.stretches().map(|stretch| ((outline.region, stretch.number), stretch.known))
}

/// A site on the line that its margins at the sigma points of a belief follow best, two along each column of its root.
fn regressed(site: &Site, margins: &[[f64; 2]; 6], inverse_root: &Matrix6<f64>) -> Site {
    let points = 2.0 * margins.len() as f64;
    let mean = margins.iter().flatten().sum::<f64>() / points;
    let squares = margins.iter().flatten().map(|margin| (margin - mean).powi(2)).sum::<f64>() / points;
    let along = Vector6::from_iterator(margins.iter().map(|[ahead, behind]| (ahead - behind) / (2.0 * SIGMA_POINTS)));
    let bent = (squares - along.norm_squared()).max(0.0);
    Site { bent, ..site.with_line(&(inverse_root.transpose() * along), mean) }
}

/// The start as all that is known of a pose: without it, what the samples leave free would drift.
fn anchor(start: &Pose, pose: &Pose) -> Gaussian {
    let distance = start.translation.norm();
    let [turn, way] = [ANCHOR, ANCHOR * distance];
    Gaussian::from_sigmas(&pose.increment_to(start), &Vector6::new(turn, turn, turn, way, way, way))
}

/// An increment no longer than the longest step.
fn shortened(increment: &Tangent, pose: &Pose) -> Tangent {
    increment * (LONGEST / size(increment, pose)).min(1.0)
}
