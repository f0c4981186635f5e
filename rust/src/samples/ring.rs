//! The stretches of one ring of a contour, which meet at corners that are off (`docs/math.md`, eq. 17.4).

use std::f64::consts::PI;

use nalgebra::{SMatrix, Vector2};

use super::ends::ENDS;
use super::kinds::{KINDS, Kinds, log_probability};
use super::stretch::{KindView, Stretch, WHOLE};
use crate::math::gaussian::{Gaussian, Normal};

/// Components of a corner: how far it is off along the axes of the contour's plane, pixels.
const CORNER: usize = 2;

/// Increment, growth and the corner where the first stretch begins and the last one ends.
const CLOSED: usize = WHOLE + CORNER;

/// The same with the corner where a stretch begins; and with that where it ends, too. The corner that closes the ring stands in
/// its own place: the first stretch has no other where it begins, the last one none where it ends.
const BEGUN: usize = CLOSED + CORNER;
const ENDED: usize = BEGUN + CORNER;

/// How far either end lies from where all else puts it, pixels (standard deviation): far less than any offset, so that ends that
/// nothing moves apart have a density.
const UNKNOWN: f64 = 1e-3;

/// Stretches of a ring that samples lie beside, in its order. Each ends at the corner where the next one begins; where nothing
/// lies beside a part of the ring, a stretch without samples stands for that.
#[derive(Debug, Clone)]
pub struct Ring {
    /// How far its corners are off along either axis, pixels (standard deviation).
    pub off: f64,
    /// Its stretches.
    pub stretches: Vec<Stretch>,
}

impl Ring {
    /// All stretches of a ring, whether samples lie beside them or not.
    pub(super) fn new(off: f64, all: impl Iterator<Item = Stretch>) -> Self {
        let mut stretches: Vec<Stretch> = Vec::new();
        for stretch in all {
            match stretches.last_mut() {
                // One without samples stands for all that follow on it, too.
                Some(last) if last.members.is_empty() && stretch.members.is_empty() => last.length += stretch.length,
                _ => stretches.push(stretch),
            }
        }
        Self { off, stretches }
    }

    /// Moment matching of its stretches, one by one, where everything else leaves `others`: the factor of increment and growth
    /// that stands for it then; `None` where a direction is left free.
    pub(super) fn sweep(&mut self, others: &Gaussian<WHOLE>) -> Option<Gaussian<WHOLE>> {
        let all = self.one_by_one(others, |stretch, seen, kinds| {
            // One that cannot be heard now keeps what it said.
            stretch.update(seen, kinds);
            Some(())
        })?;
        Some(all - *others)
    }

    /// What is believed of each stretch with samples where everything else leaves `others`, and the logarithm of what their factors
    /// are multiplied by to be the labels' probability.
    pub(super) fn view(&mut self, others: &Gaussian<WHOLE>) -> Option<(Vec<[KindView; KINDS]>, f64)> {
        let (mut views, mut log_scale) = (Vec::with_capacity(self.stretches.len()), 0.0);
        self.one_by_one(others, |stretch, seen, kinds| {
            let (of_kinds, log_integral) = stretch.view(seen, kinds)?;
            views.push(of_kinds);
            log_scale -= log_integral;
            Some(())
        })?;
        Some((views, log_scale + log_probability(&self.stretches)))
    }

    /// The factor of increment and growth that stands for it.
    pub(super) fn factor(&self) -> Gaussian<WHOLE> {
        let start = self.start(&Gaussian::default());
        (0..self.stretches.len()).fold(start, |before, number| self.passed(number, &before)).marginal()
    }

    /// Goes to each stretch with samples, with where its ends lie under what `others`, all stretches and corners say; all that is
    /// left at the end says of increment and growth.
    fn one_by_one(
        &mut self,
        others: &Gaussian<WHOLE>,
        mut visit: impl FnMut(&mut Stretch, &Normal<ENDS>, &[f64; KINDS]) -> Option<()>,
    ) -> Option<Gaussian<WHOLE>> {
        let behind = self.behind();
        let mut before = self.start(others);
        let mut kinds = Kinds::new(&self.stretches);
        for (number, behind) in behind.iter().enumerate() {
            if !self.stretches[number].members.is_empty() {
                let all = self.ended(number, &before) + turned(behind.embed());
                let seen = self.seen(number, &all)?;
                visit(&mut self.stretches[number], &seen, &kinds.others(number))?;
            }
            kinds.pass(number, &self.stretches);
            before = self.passed(number, &before);
        }
        Some(before.marginal())
    }

    /// What `others` and the corner that closes the ring say where the first stretch begins.
    fn start(&self, others: &Gaussian<WHOLE>) -> Gaussian<BEGUN> {
        others.embed() + self.corner(WHOLE) + self.corner(CLOSED)
    }

    /// The same after a stretch, with what it and the corner where it ends say.
    fn ended(&self, number: usize, before: &Gaussian<BEGUN>) -> Gaussian<ENDED> {
        before.embed() + self.stretch(number)
    }

    /// The same where the next stretch begins.
    fn passed(&self, number: usize, before: &Gaussian<BEGUN>) -> Gaussian<BEGUN> {
        turned(self.ended(number, before)).marginal()
    }

    /// What is said behind each stretch, of the corner where it ends and of what all have in common.
    fn behind(&self) -> Vec<Gaussian<BEGUN>> {
        let mut behind = Vec::with_capacity(self.stretches.len());
        let mut last = Gaussian::<BEGUN>::default();
        for number in (0..self.stretches.len()).rev() {
            behind.push(last);
            last = (self.stretch(number) + turned(last.embed())).marginal();
        }
        behind.reverse();
        behind
    }

    /// What a stretch says, and the corner where it ends.
    fn stretch(&self, number: usize) -> Gaussian<ENDED> {
        let (ends, Gaussian { information, information_vector, .. }) =
            (self.ends(number), self.stretches[number].known.message);
        let back = ends.transpose();
        let message = Gaussian {
            information: back * information * ends,
            information_vector: back * information_vector,
            offset: 0.0,
        };
        message + self.corner(BEGUN)
    }

    /// How increment, growth and corners move the ends of a stretch outwards of the region's edge.
    fn ends(&self, number: usize) -> SMatrix<f64, ENDS, ENDED> {
        let stretch = &self.stretches[number];
        let begin = if number == 0 { WHOLE } else { CLOSED };
        let end = if number + 1 == self.stretches.len() { WHOLE } else { BEGUN };
        let mut ends = SMatrix::<f64, ENDS, ENDED>::zeros();
        ends.fixed_view_mut::<ENDS, WHOLE>(0, 0).copy_from(stretch.ends());
        for (row, corner) in [begin, end].into_iter().enumerate() {
            ends.fixed_view_mut::<1, CORNER>(row, corner).copy_from(&stretch.normal.transpose());
        }
        ends
    }

    /// Where the ends of a stretch lie under all that is said; `None` where a direction is left free.
    fn seen(&self, number: usize, all: &Gaussian<ENDED>) -> Option<Normal<ENDS>> {
        let (ends, root) = (self.ends(number), all.information.cholesky()?);
        let across = root.l_dirty().solve_lower_triangular(&ends.transpose())?;
        let covariance = across.transpose() * across + SMatrix::identity() * UNKNOWN.powi(2);
        Some(Normal { mean: ends * root.solve(&all.information_vector), covariance })
    }

    /// The density of the corner whose components begin there.
    fn corner<const D: usize>(&self, first: usize) -> Gaussian<D> {
        let mut factor = Gaussian::<D> { offset: -2.0 * self.off.ln() - (2.0 * PI).ln(), ..Gaussian::default() };
        let precision = Vector2::repeat(self.off.powi(-2));
        factor.information.fixed_view_mut::<CORNER, CORNER>(first, first).set_diagonal(&precision);
        factor
    }
}

/// The same with the corners where a stretch begins and where it ends in each other's place.
fn turned(factor: Gaussian<ENDED>) -> Gaussian<ENDED> {
    factor.swap_components(CLOSED, BEGUN, CORNER)
}
