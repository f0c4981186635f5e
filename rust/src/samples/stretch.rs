//! A stretch of an observed contour, which may be disturbed, and the samples beside it (`docs/math.md`, eq. 17.4).

use nalgebra::{Matrix2, Matrix6, SMatrix, Vector2, Vector6};

use super::ends::{Beside, ENDS, Heard, heard};
use super::kinds::{KINDS, Kind};
use super::propagation::Site;
use super::trust::Label;
use crate::math::gaussian::{Gaussian, Normal};

/// Components of an increment.
pub const INCREMENT: usize = 6;

/// The same and by how many pixels a region's contour lies outside of its samples all around, its growth.
pub const WHOLE: usize = INCREMENT + 1;

/// How much less it counts, a sample, that both ends of a stretch move apart: of samples at one place along it, both move alike.
const APART: f64 = 1e-6;

/// Rotations of a symmetric matrix to its axes at most; two dimensions need one.
const MOST_ROTATIONS: usize = 10;

/// A stretch of a contour: the samples that lie beside it, and what kinds of stretch it may be.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Its number on the contour.
    pub number: usize,
    /// Its unit normal on the contour's plane.
    pub normal: Vector2<f64>,
    /// How long it is, pixels.
    pub length: f64,
    /// Numbers of the samples beside it.
    pub members: Vec<usize>,
    /// What it may be.
    pub kinds: [Kind; KINDS],
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
    /// Logarithm of the probability of its labels for each kind.
    pub(super) told: [f64; KINDS],
    /// The factor of the ends that stands for all labels, but for a multiple.
    pub(super) message: Gaussian<ENDS>,
    /// Where the ends lie for each kind.
    found: [Option<Normal<ENDS>>; KINDS],
}

/// What is believed of a stretch of one kind.
#[derive(Debug, Clone, Copy)]
pub struct KindView {
    /// Of its ends, off as they are.
    pub belief: Normal<ENDS>,
    /// Of the same where the contour was not off.
    clean: Normal<ENDS>,
    /// Mean square of the offsets of both ends.
    pub square: f64,
    /// Logarithm of the probability of its labels.
    log_probability: f64,
    /// Whether that was found: if not, none of it is of any worth.
    pub(super) is_settled: bool,
}

impl Stretch {
    /// Samples beside a stretch of one of these kinds.
    pub fn new(number: usize, normal: Vector2<f64>, length: f64, members: Vec<usize>, kinds: [Kind; KINDS]) -> Self {
        let odds = kinds.map(|kind| kind.share);
        let known = Known { odds, told: [0.0; KINDS], message: Gaussian::default(), found: [None; KINDS] };
        Self { number, normal, length, members, kinds, known, ends: SMatrix::zeros(), labels: Vec::new() }
    }

    /// Finds how increment and growth move its ends: as the slopes of the samples beside it do, those at corners left out, where
    /// there are others.
    pub(super) fn find_ends<S: AsRef<Site>>(&mut self, sites: &[S]) {
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
    pub(super) fn take_labels<S: AsRef<Site>>(&mut self, sites: &[S], covariance: &Matrix6<f64>) {
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

    /// How increment and growth move its ends outwards of the region's edge.
    pub(super) fn ends(&self) -> &SMatrix<f64, ENDS, WHOLE> {
        &self.ends
    }

    /// What everything else leaves of where its ends are seen; `None` where a direction is left free.
    fn rest(&self, seen: &Normal<ENDS>) -> Option<Normal<ENDS>> {
        Some((seen.density()? - self.known.message).normalize()?.0)
    }

    /// What is believed of each kind where everything else leaves `rest` of the ends.
    fn views(&mut self, rest: &Normal<ENDS>) -> Option<[KindView; KINDS]> {
        let mut views = Vec::with_capacity(KINDS);
        for (kind, found) in self.kinds.iter().zip(&mut self.known.found) {
            let square = Matrix2::identity() * kind.off.powi(2);
            let before = Normal { covariance: rest.covariance + square, ..*rest };
            let Heard { belief, log_probability, is_settled } = heard(&self.labels, &before, &found.unwrap_or(before))?;
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
            let clean = Normal { mean: rest.mean + moved, covariance };
            views.push(KindView { belief, clean, square, log_probability, is_settled });
        }
        views.try_into().ok()
    }

    /// Takes what its labels say of its kind, where all else says `others` of that.
    fn judge(&mut self, views: &[KindView; KINDS], others: &[f64; KINDS]) {
        let told: [f64; KINDS] = std::array::from_fn(|kind| views[kind].log_probability);
        let most = told.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let odds: [f64; KINDS] = std::array::from_fn(|kind| others[kind] * (told[kind] - most).exp());
        let all: f64 = odds.iter().sum();
        (self.known.told, self.known.odds) = (told, odds.map(|odds| odds / all));
    }

    /// Moment matching: the factor that makes of what the others leave of its ends, seen there, the mean and, but where it is
    /// wider, the covariance of all kinds together.
    pub(super) fn update(&mut self, seen: &Normal<ENDS>, others: &[f64; KINDS]) -> Option<()> {
        let rest = self.rest(seen)?;
        let views = self.views(&rest)?;
        self.judge(&views, others);
        let parts = || self.known.odds.iter().zip(&views);
        let mean: Vector2<f64> = parts().map(|(odds, view)| view.clean.mean * *odds).sum();
        let spread = |part: &Normal<ENDS>| part.covariance + (part.mean - mean) * (part.mean - mean).transpose();
        let covariance: Matrix2<f64> = parts().map(|(odds, view)| spread(&view.clean) * *odds).sum();
        let message = matching(&rest.density()?, &mean, &covariance)?;
        let is_finite = message.information.iter().chain(&message.information_vector).all(|entry| entry.is_finite());
        is_finite.then(|| self.known.message = message)
    }

    /// What is believed of each kind where its ends are seen there, and the logarithm of what its factor is divided by so that it
    /// integrates to 1 with everything else.
    pub(super) fn view(&mut self, seen: &Normal<ENDS>, others: &[f64; KINDS]) -> Option<([KindView; KINDS], f64)> {
        let rest = self.rest(seen)?;
        let views = self.views(&rest)?;
        let (_, log_integral) = (rest.density()? + self.known.message).normalize()?;
        self.judge(&views, others);
        Some((views, log_integral))
    }

    /// What its labels show under what is believed of each kind, with the probability that it is disturbed.
    pub(super) fn shown(&self, views: &[KindView; KINDS]) -> impl Iterator<Item = (f64, Label)> {
        let of_kinds = move |beside: &Beside| {
            let of_kind = |sum, (odds, view): (&f64, &KindView)| sum + beside.label(&view.belief) * *odds;
            self.known.odds.iter().zip(views).fold(Label::default(), of_kind)
        };
        self.labels.iter().map(move |beside| (self.known.odds[1], of_kinds(beside)))
    }

    /// What it is known by from a pose that lies farther by an increment.
    pub(super) fn moved(&mut self, increment: &Vector6<f64>) {
        let way = self.ends.fixed_columns::<INCREMENT>(0) * increment;
        self.known.message.information_vector -= self.known.message.information * way;
        self.known.found.iter_mut().flatten().for_each(|belief| belief.mean -= way);
    }
}

/// The factor that makes of a density one with this mean and covariance, but along no axis a wider one: there it says nothing.
fn matching(density: &Gaussian<ENDS>, mean: &Vector2<f64>, covariance: &Matrix2<f64>) -> Option<Gaussian<ENDS>> {
    // Along the axes in which the density is of one size.
    let root = density.information.cholesky()?.unpack();
    let mut eigen = (root.transpose() * covariance * root).try_symmetric_eigen(f64::EPSILON, MOST_ROTATIONS)?;
    eigen.eigenvalues.apply(|ratio| *ratio = (1.0 / *ratio - 1.0).max(0.0));
    let information = root * eigen.recompose() * root.transpose();
    let information_vector = (information + density.information) * mean - density.information_vector;
    Some(Gaussian { information, information_vector, offset: 0.0 })
}
