//! Stretches of an observed contour, each of which is off as a whole (`docs/math.md`, eq. 17.4).

use nalgebra::Matrix6;

use super::belief::{Belief, JOINT, JointGaussian, OFFSET};
use super::propagation::Site;
use crate::geometry::pose::Tangent;
use crate::prior::Gaussian;

/// What a stretch may be: clean or disturbed.
pub const KINDS: usize = 2;

/// Probability of a kind from which the other one is left out.
const CERTAIN: f64 = 0.99;

/// Rotations of a symmetric matrix to its axes at most; six dimensions need some ten.
const MOST_ROTATIONS: usize = 100;

/// How far stretches of one kind are off, pixels (standard deviation), and what share of all stretches they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// Share of the stretches.
    pub share: f64,
    /// Standard deviation of their offsets, pixels.
    pub off: f64,
}

/// A stretch of a contour: the samples that lie beside it, and what kinds of stretch it may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Its region, and its number on the contour of that.
    pub place: (usize, usize),
    /// Numbers of the samples.
    pub members: Vec<usize>,
    /// What it may be, one or two kinds.
    pub kinds: Vec<Kind>,
    /// Probability of each kind.
    pub odds: [f64; KINDS],
}

/// What is believed of an increment and the offset of a stretch of one kind.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Both together.
    pub belief: Belief<JOINT>,
    /// Logarithm of the probability of its labels, but for what is common to all kinds.
    log_probability: f64,
}

impl Stretch {
    /// Samples beside a stretch of one of these kinds.
    pub fn new(place: (usize, usize), members: Vec<usize>, kinds: Vec<Kind>) -> Self {
        let odds = std::array::from_fn(|kind| kinds.get(kind).map_or(0.0, |kind| kind.share));
        Self { place, members, kinds, odds }
    }

    /// So many samples, each beside a stretch of its own: what these are off is no matter.
    pub fn apart(count: usize) -> Self {
        Self::new((0, 0), (0..count).collect(), vec![Kind { share: 1.0, off: 1.0 }])
    }

    /// The product of the factors of the offset and of all samples, if the stretch is of this kind.
    fn product<S: AsRef<Site>>(&self, kind: usize, sites: &[S]) -> JointGaussian {
        let mut factor = JointGaussian::offset(self.kinds[kind].off);
        self.members.iter().for_each(|&member| sites[member].as_ref().factor_into(kind, &mut factor));
        factor
    }

    /// The factor of the increment that stands for all of them before anything is known of it beside: that of each kind as far as
    /// it is likely.
    pub fn first_message<S: AsRef<Site>>(&self, sites: &[S]) -> Gaussian {
        let kinds = (0..self.kinds.len()).map(|kind| self.product(kind, sites).marginal() * self.odds[kind]);
        Gaussian { offset: 0.0, ..kinds.fold(Gaussian::default(), |sum, kind| sum + kind) }
    }

    /// Moment matching of the factors of all samples for each kind, where everything else leaves `others`; and of the increment's
    /// distribution, be the stretch of whatever kind: the factor that then stands for the stretch, but for a multiple.
    pub fn sweep<S: AsMut<Site> + AsRef<Site>>(&mut self, others: &Gaussian, sites: &mut [S]) -> Option<Gaussian> {
        for kind in 0..self.kinds.len() {
            let (mut belief, _) = self.product(kind, sites).belief_with(others)?;
            self.members.iter().for_each(|&member| sites[member].as_mut().update(kind, &mut belief));
        }
        let views = self.views(others, sites)?;
        self.odds = self.judged(&views).1;
        let likeliest = if self.odds[0] >= self.odds[1] { 0 } else { 1 };
        if self.odds[likeliest] > CERTAIN {
            return Some(Gaussian { offset: 0.0, ..self.product(likeliest, sites).marginal() });
        }
        self.matched(others, &views)
    }

    /// The factor that makes of `others` the mean and, but where it is wider, the covariance of all kinds together.
    fn matched(&self, others: &Gaussian, views: &[View]) -> Option<Gaussian> {
        let parts = || self.odds.iter().zip(views).map(|(odds, view)| (*odds, view.belief.of_increment()));
        let mean: Tangent = parts().map(|(odds, part)| part.mean * odds).sum();
        let spread = |part: &Belief| part.covariance + (part.mean - mean) * (part.mean - mean).transpose();
        let covariance: Matrix6<f64> = parts().map(|(odds, part)| spread(&part) * odds).sum();
        // Along the axes in which what the others leave is of one size: a kind that contradicts them leaves more.
        let root = others.information.cholesky()?.unpack();
        let mut eigen = (root.transpose() * covariance * root).try_symmetric_eigen(f64::EPSILON, MOST_ROTATIONS)?;
        eigen.eigenvalues.apply(|ratio| *ratio = (1.0 / *ratio - 1.0).max(0.0));
        let information = root * eigen.recompose() * root.transpose();
        let vector = (information + others.information) * mean - others.vector;
        Some(Gaussian { information, vector, offset: 0.0 })
    }

    /// What is believed of each kind where everything else leaves `others`; `None` where a direction is left free.
    pub fn views<S: AsRef<Site>>(&self, others: &Gaussian, sites: &[S]) -> Option<Vec<View>> {
        let view = |kind: usize| {
            let (belief, integral) = self.product(kind, sites).belief_with(others)?;
            let scale = |&member: &usize| sites[member].as_ref().log_scale(kind, &belief);
            Some(View { log_probability: integral + self.members.iter().map(scale).sum::<f64>(), belief })
        };
        (0..self.kinds.len()).map(view).collect()
    }

    /// Mean square of the offset, if the stretch is of this kind.
    pub fn square(view: &View) -> f64 {
        view.belief.mean[OFFSET].powi(2) + view.belief.covariance[(OFFSET, OFFSET)]
    }

    /// Logarithm of the probability of the labels, and the probability of each kind.
    pub fn judged(&self, views: &[View]) -> (f64, [f64; KINDS]) {
        let logs = self.kinds.iter().zip(views).map(|(kind, view)| kind.share.ln() + view.log_probability);
        let logs: Vec<f64> = logs.collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let all = most + logs.iter().map(|log| (log - most).exp()).sum::<f64>().ln();
        (all, std::array::from_fn(|kind| logs.get(kind).map_or(0.0, |log| (log - all).exp())))
    }
}

impl JointGaussian {
    /// The density of an offset with this standard deviation.
    fn offset(deviation: f64) -> Self {
        let mut factor = Self { offset: -deviation.ln() - 0.5 * (2.0 * std::f64::consts::PI).ln(), ..Self::default() };
        factor.information[(OFFSET, OFFSET)] = deviation.powi(-2);
        factor
    }
}
