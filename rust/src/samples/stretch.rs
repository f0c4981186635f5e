//! Observed contours that are off: grown all around, and each stretch of them at either end (`docs/math.md`, eq. 17.4).

use std::f64::consts::PI;

use nalgebra::{Matrix2, Matrix6, SMatrix, Vector2, Vector6};

use super::belief::{Belief, INCREMENT, WHOLE};
use super::ends::{Beside, ENDS, heard};
use super::propagation::{Label, Site};
use crate::prior::Gaussian;

/// What a stretch may be: clean or disturbed.
pub const KINDS: usize = 2;

/// How much less it counts, a sample, that both ends of a stretch move apart: of samples at one place along it, both move alike.
const APART: f64 = 1e-6;

/// How far either end lies from where increment and growth put it, pixels (standard deviation): far less than any offset, so that
/// ends that nothing moves apart have a density.
const UNKNOWN: f64 = 1e-3;

/// Rotations of a symmetric matrix to its axes at most; two dimensions need one.
const MOST_ROTATIONS: usize = 10;

/// How far stretches of one kind are off, pixels (standard deviation), and what share of all stretches they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// Share of the stretches.
    pub share: f64,
    /// Standard deviation of the offset of either end, pixels.
    pub off: f64,
}

/// A stretch of a contour: the samples that lie beside it, and what kinds of stretch it may be.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Its number on the contour.
    pub number: usize,
    /// Numbers of the samples beside it.
    pub members: Vec<usize>,
    /// What it may be, one or two kinds.
    pub kinds: Vec<Kind>,
    /// What is known of it.
    pub known: Known,
    /// How increment and growth move its ends outwards of the region's edge.
    ends: SMatrix<f64, ENDS, WHOLE>,
    /// The labels of the samples.
    labels: Vec<Beside>,
}

/// What is known of a stretch from labels beside it.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Probability of each kind.
    pub odds: [f64; KINDS],
    /// The factor of the ends that stands for all labels, but for a multiple.
    message: Gaussian<ENDS>,
    /// Where the ends lie for each kind.
    found: [Option<Belief<ENDS>>; KINDS],
}

/// The contour of a region with samples beside it.
#[derive(Debug, Clone)]
pub struct Outline {
    /// Its place among the regions with samples.
    pub region: usize,
    /// How far it is grown all around, pixels (standard deviation).
    pub growth: f64,
    /// Its stretches that samples lie beside.
    pub stretches: Vec<Stretch>,
}

/// What is believed of a contour.
#[derive(Debug, Clone)]
pub struct View {
    /// Of each stretch, for each kind that it may be.
    pub stretches: Vec<Vec<KindView>>,
    /// Logarithm of the probability of the labels.
    pub log_probability: f64,
}

/// What is believed of a stretch of one kind.
#[derive(Debug, Clone, Copy)]
pub struct KindView {
    /// Of its ends, off as they are.
    pub belief: Belief<ENDS>,
    /// Of the same where the contour was not off.
    clean: Belief<ENDS>,
    /// Mean square of the offsets of both ends.
    pub square: f64,
    /// Logarithm of the probability of its labels.
    log_probability: f64,
}

impl Stretch {
    /// Samples beside a stretch of one of these kinds.
    pub fn new(number: usize, members: Vec<usize>, kinds: Vec<Kind>) -> Self {
        let odds = std::array::from_fn(|kind| kinds.get(kind).map_or(0.0, |kind| kind.share));
        let known = Known { odds, message: Gaussian::default(), found: [None; KINDS] };
        Self { number, members, kinds, known, ends: SMatrix::zeros(), labels: Vec::new() }
    }

    /// Finds how increment and growth move its ends: as the slopes of the samples beside it do, those at corners left out, where
    /// there are others.
    fn find_ends<S: AsRef<Site>>(&mut self, sites: &[S]) {
        let members = || self.members.iter().map(|&member| sites[member].as_ref());
        let at_corners = members().all(|site| site.is_at_corner());
        let (mut products, mut slopes) = (Matrix2::zeros(), SMatrix::<f64, ENDS, INCREMENT>::zeros());
        for site in members().filter(|site| at_corners || !site.is_at_corner()) {
            let shares = Vector2::new(1.0 - site.along, site.along);
            let apart = Vector2::new(1.0, -1.0);
            products += shares * shares.transpose() + apart * apart.transpose() * APART;
            slopes += shares * site.slope.transpose() * site.outwards;
        }
        let ends = products.try_inverse().map_or(slopes, |inverse| inverse * slopes);
        self.ends.fixed_view_mut::<ENDS, INCREMENT>(0, 0).copy_from(&ends);
        self.ends.set_column(INCREMENT, &Vector2::repeat(1.0));
    }

    /// Takes the labels of its samples, as its ends move them: what these leave open of a margin, under a covariance of the increment,
    /// blurs it.
    fn take_labels<S: AsRef<Site>>(&mut self, sites: &[S], covariance: &Matrix6<f64>) {
        let ends = self.ends.fixed_columns::<INCREMENT>(0);
        let label = |&member: &usize| {
            let site = sites[member].as_ref();
            let weights = Vector2::new(1.0 - site.along, site.along) * site.outwards;
            let rest: Vector6<f64> = site.slope - ends.transpose() * weights;
            let variance = site.bent + rest.dot(&(covariance * rest));
            Beside { margin: site.margin, weights, variance, edge: site.edge, trust: site.trust }
        };
        self.labels = self.members.iter().map(label).collect();
    }

    /// The factor of the increment and the growth that stands for it.
    fn factor(&self) -> Gaussian<WHOLE> {
        let Gaussian { information, vector, .. } = self.known.message;
        let back = self.ends.transpose();
        Gaussian { information: back * information * self.ends, vector: back * vector, offset: 0.0 }
    }

    /// Where its ends lie under a belief, and what everything else leaves of that; `None` where a direction is left free.
    fn seen(&self, belief: &Belief<WHOLE>) -> Option<(Belief<ENDS>, Belief<ENDS>)> {
        let covariance = self.ends * belief.covariance * self.ends.transpose() + Matrix2::identity() * UNKNOWN.powi(2);
        let seen = Belief { mean: self.ends * belief.mean, covariance };
        let rest = seen.factor()? - self.known.message;
        Some((seen, rest.belief()?.0))
    }

    /// What is believed of each kind where everything else leaves `rest` of the ends.
    fn views(&mut self, rest: &Belief<ENDS>) -> Option<Vec<KindView>> {
        let mut views = Vec::with_capacity(self.kinds.len());
        for (kind, found) in self.kinds.iter().zip(&mut self.known.found) {
            let square = Matrix2::identity() * kind.off.powi(2);
            let before = Belief { covariance: rest.covariance + square, ..*rest };
            let (belief, log_probability) = heard(&self.labels, &before, &found.unwrap_or(before))?;
            *found = Some(belief);
            // What the ends show is shared by pose and offsets as far as each is uncertain.
            let inverse = before.covariance.try_inverse()?;
            let way = belief.mean - before.mean;
            let shared = |share: &Matrix2<f64>| {
                let gain = share * inverse;
                (gain * way, gain * belief.covariance * gain.transpose() + share - gain * share.transpose())
            };
            let (moved, covariance) = shared(&rest.covariance);
            let (off, around) = shared(&square);
            let square = 0.5 * (off.norm_squared() + around.trace());
            let clean = Belief { mean: rest.mean + moved, covariance };
            views.push(KindView { belief, clean, square, log_probability });
        }
        Some(views)
    }

    /// Logarithm of the probability of the labels, and the probability of each kind.
    fn judged(&self, views: &[KindView]) -> (f64, [f64; KINDS]) {
        let logs = self.kinds.iter().zip(views).map(|(kind, view)| kind.share.ln() + view.log_probability);
        let logs: Vec<f64> = logs.collect();
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let all = most + logs.iter().map(|log| (log - most).exp()).sum::<f64>().ln();
        (all, std::array::from_fn(|kind| logs.get(kind).map_or(0.0, |log| (log - all).exp())))
    }

    /// Moment matching, in place in the belief: the factor that makes of what the others leave the mean and, but where it is wider,
    /// the covariance of all kinds together.
    fn update(&mut self, belief: &mut Belief<WHOLE>) -> Option<()> {
        let (seen, rest) = self.seen(belief)?;
        let views = self.views(&rest)?;
        self.known.odds = self.judged(&views).1;
        let parts = || self.known.odds.iter().zip(&views);
        let mean: Vector2<f64> = parts().map(|(odds, view)| view.clean.mean * *odds).sum();
        let spread = |part: &Belief<ENDS>| part.covariance + (part.mean - mean) * (part.mean - mean).transpose();
        let covariance: Matrix2<f64> = parts().map(|(odds, view)| spread(&view.clean) * *odds).sum();
        let message = rest.factor()?.to(&mean, &covariance)?;
        // The belief changes along what moves the ends alone.
        let after = (rest.factor()? + message).belief()?.0;
        let gain = belief.covariance * self.ends.transpose() * seen.covariance.try_inverse()?;
        let (mean, covariance) =
            (gain * (after.mean - seen.mean), gain * (after.covariance - seen.covariance) * gain.transpose());
        if !(mean.iter().chain(&covariance).all(|entry| entry.is_finite())) {
            return None;
        }
        belief.mean += mean;
        belief.covariance += covariance;
        self.known.message = message;
        Some(())
    }

    /// What its labels show under what is believed of each kind, with the probability that it is disturbed.
    pub(super) fn shown(&self, views: &[KindView]) -> impl Iterator<Item = (f64, Label)> {
        let of_kinds = move |beside: &Beside| {
            let of_kind = |sum, (odds, view): (&f64, &KindView)| sum + beside.label(&view.belief) * *odds;
            self.known.odds.iter().zip(views).fold(Label::default(), of_kind)
        };
        self.labels.iter().map(move |beside| (self.known.odds[1], of_kinds(beside)))
    }

    /// What it is known by from a pose that lies farther by an increment.
    fn moved(&mut self, increment: &Vector6<f64>) {
        let way = self.ends.fixed_columns::<INCREMENT>(0) * increment;
        self.known.message.vector -= self.known.message.information * way;
        self.known.found.iter_mut().flatten().for_each(|belief| belief.mean -= way);
    }
}

impl Outline {
    /// Finds how increment and growth move the ends of its stretches.
    pub fn find_ends<S: AsRef<Site>>(&mut self, sites: &[S]) {
        self.stretches.iter_mut().for_each(|stretch| stretch.find_ends(sites));
    }

    /// Takes the labels of the samples beside its stretches, under a covariance of the increment.
    pub fn take_labels<S: AsRef<Site>>(&mut self, sites: &[S], covariance: &Matrix6<f64>) {
        self.stretches.iter_mut().for_each(|stretch| stretch.take_labels(sites, covariance));
    }

    /// What it is known by from a pose that lies farther by an increment.
    pub fn moved(&mut self, increment: &Vector6<f64>) {
        self.stretches.iter_mut().for_each(|stretch| stretch.moved(increment));
    }

    /// The factor of the increment and the growth that stands for it.
    fn factor(&self) -> Gaussian<WHOLE> {
        let growth = Gaussian::of_component(INCREMENT, self.growth);
        self.stretches.iter().fold(growth, |sum, stretch| sum + stretch.factor())
    }

    /// The factor of the increment that stands for it, but for a multiple.
    pub fn message(&self) -> Gaussian {
        Gaussian { offset: 0.0, ..self.factor().marginal::<INCREMENT>() }
    }

    /// Moment matching of its stretches, one by one, where everything else leaves `others`; `None` where a direction is left free.
    pub fn sweep(&mut self, others: &Gaussian) -> Option<()> {
        let (mut belief, _) = (others.among::<WHOLE>() + self.factor()).belief()?;
        // One that cannot be heard now keeps what it said.
        self.stretches.iter_mut().for_each(|stretch| _ = stretch.update(&mut belief));
        Some(())
    }

    /// What is believed where everything else leaves `others`; `None` where a direction is left free.
    pub fn view(&mut self, others: &Gaussian) -> Option<View> {
        let (belief, mut log_probability) = (others.among::<WHOLE>() + self.factor()).belief()?;
        let mut stretches = Vec::with_capacity(self.stretches.len());
        for stretch in &mut self.stretches {
            let (_, rest) = stretch.seen(&belief)?;
            let views = stretch.views(&rest)?;
            let (_, scale) = (rest.factor()? + stretch.known.message).belief()?;
            log_probability += stretch.judged(&views).0 - scale;
            stretches.push(views);
        }
        Some(View { stretches, log_probability })
    }
}

impl<const D: usize> Belief<D> {
    /// Its density.
    fn factor(&self) -> Option<Gaussian<D>> {
        let root = self.covariance.cholesky()?;
        let (information, vector) = (root.inverse(), root.solve(&self.mean));
        let determinant: f64 = root.l_dirty().diagonal().map(f64::ln).sum();
        let offset = -0.5 * self.mean.dot(&vector) - determinant - 0.5 * D as f64 * (2.0 * PI).ln();
        Some(Gaussian { information, vector, offset })
    }
}

impl Gaussian<ENDS> {
    /// The factor that makes of this one a mean and a covariance, but along no axis a wider one: there it says nothing.
    fn to(&self, mean: &Vector2<f64>, covariance: &Matrix2<f64>) -> Option<Self> {
        // Along the axes in which this one is of one size.
        let root = self.information.cholesky()?.unpack();
        let mut eigen = (root.transpose() * covariance * root).try_symmetric_eigen(f64::EPSILON, MOST_ROTATIONS)?;
        eigen.eigenvalues.apply(|ratio| *ratio = (1.0 / *ratio - 1.0).max(0.0));
        let information = root * eigen.recompose() * root.transpose();
        let vector = (information + self.information) * mean - self.vector;
        Some(Self { information, vector, offset: 0.0 })
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
