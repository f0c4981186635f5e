//! Observed contours that are off: grown all around, and each stretch of them at either end (`docs/math.md`, eq. 17.4).

use std::f64::consts::PI;

use nalgebra::{SMatrix, SVector};

use super::belief::{Belief, INCREMENT, JOINT, WHOLE};
use super::propagation::Site;
use crate::prior::Gaussian;

/// What a stretch may be: clean or disturbed.
pub const KINDS: usize = 2;

/// Probability of a kind from which the other one is left out.
const CERTAIN: f64 = 0.99;

/// Rotations of a symmetric matrix to its axes at most; seven dimensions need some ten.
const MOST_ROTATIONS: usize = 100;

/// How far stretches of one kind are off, pixels (standard deviation), and what share of all stretches they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// Share of the stretches.
    pub share: f64,
    /// Standard deviation of the offset of either end, pixels.
    pub off: f64,
}

/// A stretch of a contour: the samples that lie beside it, and what kinds of stretch it may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Its number on the contour.
    pub number: usize,
    /// Numbers of the samples that are heard.
    pub members: Vec<usize>,
    /// Those of the samples that follow from these.
    pub followers: Vec<usize>,
    /// What it may be, one or two kinds.
    pub kinds: Vec<Kind>,
    /// Probability of each kind.
    pub odds: [f64; KINDS],
}

/// The contour of a region with samples beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// Its place among the regions with samples.
    pub region: usize,
    /// How far it is grown all around, pixels (standard deviation).
    pub growth: f64,
    /// Its stretches that samples lie beside.
    pub stretches: Vec<Stretch>,
}

/// What the stretches of a contour tell, where everything else is as it was.
pub struct Heard {
    /// The factor of the increment and the growth.
    factor: Gaussian<WHOLE>,
    /// Those of each stretch that it holds, but for a multiple.
    messages: Vec<Gaussian<WHOLE>>,
}

/// What is believed of a contour.
#[derive(Debug, Clone)]
pub struct View {
    /// Of each stretch, for each kind that it may be.
    pub stretches: Vec<Vec<KindView>>,
    /// Logarithm of the probability of the labels.
    pub log_probability: f64,
}

/// What is believed of an increment, the growth of a contour and the offsets of a stretch of it of one kind.
#[derive(Debug, Clone, Copy)]
pub struct KindView {
    /// All of them together.
    pub belief: Belief<JOINT>,
    /// Logarithm of the probability of its labels, but for what is common to all kinds.
    log_probability: f64,
}

impl KindView {
    /// Mean square of the offsets of both ends.
    pub fn square(&self) -> f64 {
        let square = |end: usize| self.belief.mean[end].powi(2) + self.belief.covariance[(end, end)];
        0.5 * (square(WHOLE) + square(WHOLE + 1))
    }
}

impl Stretch {
    /// Samples beside a stretch of one of these kinds.
    pub fn new(number: usize, members: Vec<usize>, kinds: Vec<Kind>) -> Self {
        let odds = std::array::from_fn(|kind| kinds.get(kind).map_or(0.0, |kind| kind.share));
        Self { number, members, followers: Vec::new(), kinds, odds }
    }

    /// The product of the factors of the offsets and of all samples, if the stretch is of this kind.
    fn product<S: AsRef<Site>>(&self, kind: usize, sites: &[S]) -> Gaussian<JOINT> {
        let off = self.kinds[kind].off;
        let mut factor = Gaussian::<JOINT>::of_component(WHOLE, off) + Gaussian::of_component(WHOLE + 1, off);
        self.members.iter().for_each(|&member| sites[member].as_ref().factor_into(kind, &mut factor));
        factor
    }

    /// The factor that stands for all of them before anything is known beside: that of each kind as far as it is
    /// likely.
    fn first_message<S: AsRef<Site>>(&self, sites: &[S]) -> Gaussian<WHOLE> {
        let kinds = (0..self.kinds.len()).map(|kind| self.product(kind, sites).marginal::<WHOLE>() * self.odds[kind]);
        Gaussian { offset: 0.0, ..kinds.fold(Gaussian::default(), |sum, kind| sum + kind) }
    }

    /// Moment matching of the factors of all samples for each kind, where everything else leaves `others`; and of the
    /// distribution of increment and growth, be the stretch of whatever kind: the factor that then stands for the
    /// stretch, but for a multiple.
    fn sweep<S: AsMut<Site> + AsRef<Site>>(
        &mut self,
        others: &Gaussian<WHOLE>,
        sites: &mut [S],
    ) -> Option<Gaussian<WHOLE>> {
        for kind in 0..self.kinds.len() {
            let (mut belief, _) = (others.among() + self.product(kind, sites)).belief()?;
            self.members.iter().for_each(|&member| sites[member].as_mut().update(kind, &mut belief));
        }
        let views = self.views(others, sites)?;
        self.odds = self.judged(&views).1;
        let likeliest = if self.odds[0] >= self.odds[1] { 0 } else { 1 };
        if self.odds[likeliest] > CERTAIN {
            return Some(Gaussian { offset: 0.0, ..self.product(likeliest, sites).marginal::<WHOLE>() });
        }
        self.matched(others, &views)
    }

    /// The factor that makes of `others` the mean and, but where it is wider, the covariance of all kinds together.
    fn matched(&self, others: &Gaussian<WHOLE>, views: &[KindView]) -> Option<Gaussian<WHOLE>> {
        let parts = || self.odds.iter().zip(views).map(|(odds, view)| (*odds, view.belief.of_first::<WHOLE>()));
        let mean: SVector<f64, WHOLE> = parts().map(|(odds, part)| part.mean * odds).sum();
        let spread = |part: &Belief<WHOLE>| part.covariance + (part.mean - mean) * (part.mean - mean).transpose();
        let covariance: SMatrix<f64, WHOLE, WHOLE> = parts().map(|(odds, part)| spread(&part) * odds).sum();
        // Along the axes in which what the others leave is of one size: a kind that contradicts them leaves more.
        let root = others.information.cholesky()?.unpack();
        let mut eigen = (root.transpose() * covariance * root).try_symmetric_eigen(f64::EPSILON, MOST_ROTATIONS)?;
        eigen.eigenvalues.apply(|ratio| *ratio = (1.0 / *ratio - 1.0).max(0.0));
        let information = root * eigen.recompose() * root.transpose();
        let vector = (information + others.information) * mean - others.vector;
        Some(Gaussian { information, vector, offset: 0.0 })
    }

    /// What is believed of each kind where everything else leaves `others`; `None` where a direction is left free.
    fn views<S: AsRef<Site>>(&self, others: &Gaussian<WHOLE>, sites: &[S]) -> Option<Vec<KindView>> {
        let view = |kind: usize| {
            let (belief, integral) = (others.among() + self.product(kind, sites)).belief()?;
            let scale = |&member: &usize| sites[member].as_ref().log_scale(kind, &belief);
            Some(KindView { log_probability: integral + self.members.iter().map(scale).sum::<f64>(), belief })
        };
        (0..self.kinds.len()).map(view).collect()
    }

    /// Logarithm of the probability of the labels, and the probability of each kind.
    fn judged(&self, views: &[KindView]) -> (f64, [f64; KINDS]) {
        let logs = self.kinds.iter().zip(views).map(|(kind, view)| kind.share.ln() + view.log_probability);
        let logs: Vec<f64> = logs.collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let all = most + logs.iter().map(|log| (log - most).exp()).sum::<f64>().ln();
        (all, std::array::from_fn(|kind| logs.get(kind).map_or(0.0, |log| (log - all).exp())))
    }
}

impl Outline {
    /// What its stretches tell by the factors that their samples have.
    pub fn heard<S: AsRef<Site>>(&self, sites: &[S]) -> Heard {
        let messages = self.stretches.iter().map(|stretch| stretch.first_message(sites)).collect();
        let mut heard = Heard { factor: Gaussian::default(), messages };
        heard.renew(self);
        heard
    }

    /// Moment matching of the factors of all samples, stretch by stretch, where everything else leaves `others`.
    pub fn sweep<S: AsMut<Site> + AsRef<Site>>(&mut self, others: &Gaussian, heard: &mut Heard, sites: &mut [S]) {
        let others = others.among::<WHOLE>();
        for (stretch, message) in self.stretches.iter_mut().zip(&mut heard.messages) {
            let rest = heard.factor - *message;
            if let Some(new) = stretch.sweep(&(others + rest), sites) {
                (*message, heard.factor) = (new, rest + new);
            }
        }
    }

    /// Logarithm of the probability of the labels that follow from others, where the mean of what is believed puts them: what it is
    /// uncertain of, the others have counted.
    pub fn log_following<S: AsRef<Site>>(&self, view: &View, sites: &[S]) -> f64 {
        let of_stretch = |(stretch, views): (&Stretch, &Vec<KindView>)| {
            let probability = |site: &Site| {
                let of_kind =
                    |(odds, view): (&f64, &KindView)| odds * site.label_at_mean(&view.belief).log_probability.exp();
                stretch.odds.iter().zip(views).map(of_kind).sum::<f64>()
            };
            stretch
                .followers
                .iter()
                .map(|&one| probability(sites[one].as_ref()).max(f64::MIN_POSITIVE).ln())
                .sum::<f64>()
        };
        self.stretches.iter().zip(&view.stretches).map(of_stretch).sum()
    }

    /// What is believed where everything else leaves `others`; `None` where a direction is left free.
    pub fn view<S: AsRef<Site>>(&self, others: &Gaussian, heard: &Heard, sites: &[S]) -> Option<View> {
        let all = others.among::<WHOLE>() + heard.factor;
        let integral = all.belief()?.1;
        let mut log_probability = integral;
        let mut stretches = Vec::with_capacity(self.stretches.len());
        for (stretch, message) in self.stretches.iter().zip(&heard.messages) {
            let views = stretch.views(&(all - *message), sites)?;
            log_probability += stretch.judged(&views).0 - integral;
            stretches.push(views);
        }
        Some(View { stretches, log_probability })
    }
}

impl Heard {
    /// The factor of the increment that stands for the contour, but for a multiple.
    pub fn message(&self) -> Gaussian {
        Gaussian { offset: 0.0, ..self.factor.marginal::<INCREMENT>() }
    }

    /// Takes the product of all messages and of the growth anew.
    pub fn renew(&mut self, outline: &Outline) {
        let growth = Gaussian::of_component(INCREMENT, outline.growth);
        self.factor = self.messages.iter().fold(growth, |sum, message| sum + *message);
    }
}

impl<const D: usize> Gaussian<D> {
    /// The density of a component about zero with this standard deviation.
    fn of_component(component: usize, deviation: f64) -> Self {
        let mut factor = Self { offset: -deviation.ln() - 0.5 * (2.0 * PI).ln(), ..Self::default() };
        factor.information[(component, component)] = deviation.powi(-2);
        factor
    }
}
