//! Observed contours that are off: grown all around, and at the corners of each ring (`docs/math.md`, eq. 17.4).

use std::f64::consts::PI;

use nalgebra::{Matrix6, Vector6};

use super::kinds::KINDS;
use super::propagation::Site;
use super::ring::Ring;
use super::stretch::{INCREMENT, KindView, Stretch, WHOLE};
use crate::math::gaussian::Gaussian;

/// The contour of a region with samples beside it.
#[derive(Debug, Clone)]
pub struct Outline {
    /// Its place among the regions with samples.
    pub region: usize,
    /// How far it is grown all around, pixels (standard deviation).
    pub growth: f64,
    /// Its rings that samples lie beside.
    pub rings: Vec<Ring>,
}

/// What is believed of a contour.
#[derive(Debug, Clone)]
pub struct View {
    /// Of each stretch with samples, for each kind that it may be.
    pub stretches: Vec<[KindView; KINDS]>,
    /// Logarithm of the probability of the labels.
    pub log_probability: f64,
    /// Whether all of it was found: if not, none of it is of any worth.
    pub is_settled: bool,
}

impl Outline {
    /// Its stretches with samples.
    pub fn stretches(&self) -> impl Iterator<Item = &Stretch> {
        self.rings.iter().flat_map(|ring| &ring.stretches).filter(|stretch| !stretch.members.is_empty())
    }

    /// The same, to be changed.
    pub fn stretches_mut(&mut self) -> impl Iterator<Item = &mut Stretch> {
        let stretches = self.rings.iter_mut().flat_map(|ring| &mut ring.stretches);
        stretches.filter(|stretch| !stretch.members.is_empty())
    }

    /// Finds how increment and growth move the ends of its stretches.
    pub fn find_ends<S: AsRef<Site>>(&mut self, sites: &[S]) {
        self.stretches_mut().for_each(|stretch| stretch.find_ends(sites));
    }

    /// Takes the labels of the samples beside its stretches, under a covariance of the increment.
    pub fn take_labels<S: AsRef<Site>>(&mut self, sites: &[S], covariance: &Matrix6<f64>) {
        self.stretches_mut().for_each(|stretch| stretch.take_labels(sites, covariance));
    }

    /// What it is known by from a pose that lies farther by an increment.
    pub fn moved(&mut self, increment: &Vector6<f64>) {
        self.stretches_mut().for_each(|stretch| stretch.moved(increment));
    }

    /// The factor of the increment that stands for it, but for a multiple.
    pub fn message(&self) -> Gaussian {
        self.message_of(&self.factors())
    }

    /// Moment matching of its stretches, one by one, where everything else leaves `others`: its message then; `None` where a
    /// direction is left free.
    pub fn sweep(&mut self, others: &Gaussian) -> Option<Gaussian> {
        let (all, mut factors) = (others.embed() + self.grown(), self.factors());
        let (behind, mut before) = (sums_behind(&factors), all);
        for (number, ring) in self.rings.iter_mut().enumerate() {
            factors[number] = ring.sweep(&(before + behind[number]))?;
            before = before + factors[number];
        }
        Some(self.message_of(&factors))
    }

    /// What is believed where everything else leaves `others`; `None` where a direction is left free.
    pub fn view(&mut self, others: &Gaussian) -> Option<View> {
        let (all, factors) = (others.embed() + self.grown(), self.factors());
        let (_, mut log_probability) = factors.iter().fold(all, |sum, factor| sum + *factor).normalize()?;
        let (behind, mut before, mut stretches) = (sums_behind(&factors), all, Vec::new());
        for (number, ring) in self.rings.iter_mut().enumerate() {
            let (views, log_scale) = ring.view(&(before + behind[number]))?;
            before = before + factors[number];
            stretches.extend(views);
            log_probability += log_scale;
        }
        let is_settled = stretches.iter().flatten().all(|view| view.is_settled);
        Some(View { stretches, log_probability, is_settled })
    }

    /// The factors of increment and growth that stand for its rings.
    fn factors(&self) -> Vec<Gaussian<WHOLE>> {
        self.rings.iter().map(Ring::factor).collect()
    }

    fn message_of(&self, factors: &[Gaussian<WHOLE>]) -> Gaussian {
        let all = factors.iter().fold(self.grown(), |sum, factor| sum + *factor);
        Gaussian { offset: 0.0, ..all.marginal() }
    }

    /// The density of its growth.
    fn grown(&self) -> Gaussian<WHOLE> {
        let mut factor = Gaussian { offset: -self.growth.ln() - 0.5 * (2.0 * PI).ln(), ..Gaussian::default() };
        factor.information[(INCREMENT, INCREMENT)] = self.growth.powi(-2);
        factor
    }
}

/// What the rings behind each say together.
fn sums_behind(factors: &[Gaussian<WHOLE>]) -> Vec<Gaussian<WHOLE>> {
    let mut behind = vec![Gaussian::default(); factors.len()];
    for number in (1..factors.len()).rev() {
        behind[number - 1] = behind[number] + factors[number];
    }
    behind
}
