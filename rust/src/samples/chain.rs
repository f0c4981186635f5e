//! The two chains around a ring of contour segments, which end where the next one begins: offsets of corners, by Gaussian elimination, and
//! states (clean, disturbed), by forward-backward (`docs/math.md`, eq. 17.4).

use std::f64::consts::PI;

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::quadrature::ENDS;
use super::segment::{ContourSegment, DILATED, STATES, SegmentMoments, StateMoments};
use crate::math::gaussian::{Gaussian, Normal};

/// Components of a corner: its offset along the axes of the contour's plane, pixels.
const CORNER: usize = 2;

/// Components of increment, dilation and the corner that closes the ring, where the first segment begins and the last one ends.
const CLOSED: usize = DILATED + CORNER;

/// Components of these and the corner where a segment begins; and of these and the corner where it ends. The closing corner has its own
/// components: the first segment has no other where it begins, the last one none where it ends.
const BEGUN: usize = CLOSED + CORNER;
const ENDED: usize = BEGUN + CORNER;

/// Standard deviation of independent noise of either end, pixels: far below any offset, it gives ends a density that no component moves
/// apart.
const END_NOISE: f64 = 1e-3;

/// Moments of a ring's segments with samples, in each state, and the logarithm of the scale that makes the ring's factor integrate to
/// the labels' probability.
pub(super) type RingMoments = (Vec<[StateMoments; STATES]>, f64);

/// A closed ring of contour segments.
#[derive(Debug, Clone)]
pub struct SegmentRing {
    /// Standard deviation of the corners' offsets along either axis, pixels.
    pub corner_sigma: f64,
    /// The segments in order; those without samples beside them are joined to one.
    pub segments: Vec<ContourSegment>,
}

impl SegmentRing {
    /// A ring of all its segments, with samples beside them or not.
    pub(super) fn new(corner_sigma: f64, all: impl Iterator<Item = ContourSegment>) -> Self {
        let mut segments: Vec<ContourSegment> = Vec::new();
        for segment in all {
            match segments.last_mut() {
                Some(last) if last.members.is_empty() && segment.members.is_empty() => last.length += segment.length,
                _ => segments.push(segment),
            }
        }
        Self { corner_sigma, segments }
    }

    /// Updates the sites of its segments one by one, with this cavity of increment and dilation; returns the ring's factor of these, or
    /// `None` where a distribution is not normalizable.
    pub(super) fn sweep(&mut self, cavity: &Gaussian<DILATED>) -> Option<Gaussian<DILATED>> {
        let product = self.visit_segments(cavity, |segment, ends, states| {
            // A segment without a proper message keeps its last one.
            segment.update(ends, states);
            Some(())
        })?;
        Some(product - *cavity)
    }

    /// Moments of its segments with this cavity of increment and dilation.
    pub(super) fn moments(&mut self, cavity: &Gaussian<DILATED>) -> Option<RingMoments> {
        let mut moments = Vec::with_capacity(self.segments.len());
        self.visit_segments(cavity, |segment, ends, states| {
            moments.push(segment.moments(ends, states)?);
            Some(())
        })?;
        Some(self.collected(moments))
    }

    /// The same of the segments' last updates, each with its cavity then; `None` where one has none.
    pub(super) fn updated_moments(&self) -> Option<RingMoments> {
        let segments = self.segments.iter().filter(|segment| !segment.members.is_empty());
        Some(self.collected(segments.map(ContourSegment::updated_moments).collect::<Option<_>>()?))
    }

    fn collected(&self, moments: Vec<SegmentMoments>) -> RingMoments {
        let log_integrals: f64 = moments.iter().map(|(_, log_integral)| log_integral).sum();
        let of_states = moments.into_iter().map(|(of_states, _)| of_states).collect();
        (of_states, log_probability(&self.segments) - log_integrals)
    }

    /// Its factor of increment and dilation: corners integrated out.
    pub(super) fn factor(&self) -> Gaussian<DILATED> {
        let start = self.first(&Gaussian::default());
        (0..self.segments.len()).fold(start, |forward, number| self.passed(number, &forward)).marginal()
    }

    /// Visits each segment with samples, with the distribution of its ends by all messages and the cavity probabilities of its states;
    /// returns the product of all factors of increment and dilation.
    fn visit_segments(
        &mut self,
        cavity: &Gaussian<DILATED>,
        mut visit: impl FnMut(&mut ContourSegment, &Normal<ENDS>, &[f64; STATES]) -> Option<()>,
    ) -> Option<Gaussian<DILATED>> {
        let backward = self.backward();
        let mut forward = self.first(cavity);
        let mut states = ForwardBackward::new(&self.segments);
        for (number, backward) in backward.iter().enumerate() {
            if !self.segments[number].members.is_empty() {
                let product = self.ended(number, &forward) + swap_corners(backward.embed());
                let ends = self.distribution_of_ends(number, &product)?;
                visit(&mut self.segments[number], &ends, &states.cavity(number))?;
            }
            states.pass(number, &self.segments);
            forward = self.passed(number, &forward);
        }
        Some(forward.marginal())
    }

    /// Forward message at the start of the first segment: the cavity and the closing corner.
    fn first(&self, cavity: &Gaussian<DILATED>) -> Gaussian<BEGUN> {
        cavity.embed() + self.corner(DILATED) + self.corner(CLOSED)
    }

    /// Forward message times the factor of a segment and of the corner where it ends.
    fn ended(&self, number: usize, forward: &Gaussian<BEGUN>) -> Gaussian<ENDED> {
        forward.embed() + self.segment_factor(number)
    }

    /// Forward message at the start of the next segment.
    fn passed(&self, number: usize, forward: &Gaussian<BEGUN>) -> Gaussian<BEGUN> {
        swap_corners(self.ended(number, forward)).marginal()
    }

    /// Backward messages at the end of each segment.
    fn backward(&self) -> Vec<Gaussian<BEGUN>> {
        let mut backward = Vec::with_capacity(self.segments.len());
        let mut last = Gaussian::<BEGUN>::default();
        for number in (0..self.segments.len()).rev() {
            backward.push(last);
            last = (self.segment_factor(number) + swap_corners(last.embed())).marginal();
        }
        backward.reverse();
        backward
    }

    /// The factor of a segment's site and of the corner where it ends.
    fn segment_factor(&self, number: usize) -> Gaussian<ENDED> {
        let ends = self.ends(number);
        let Gaussian { information, information_vector, .. } = self.segments[number].site.message;
        let back = ends.transpose();
        let site = Gaussian {
            information: back * information * ends,
            information_vector: back * information_vector,
            offset: 0.0,
        };
        site + self.corner(BEGUN)
    }

    /// Derivative of a segment's outward end offsets by increment, dilation and corners.
    fn ends(&self, number: usize) -> SMatrix<f64, ENDS, ENDED> {
        let segment = &self.segments[number];
        let begin = if number == 0 { DILATED } else { CLOSED };
        let end = if number + 1 == self.segments.len() { DILATED } else { BEGUN };
        let mut ends = SMatrix::<f64, ENDS, ENDED>::zeros();
        ends.fixed_view_mut::<ENDS, DILATED>(0, 0).copy_from(segment.ends());
        for (row, corner) in [begin, end].into_iter().enumerate() {
            ends.fixed_view_mut::<1, CORNER>(row, corner).copy_from(&segment.normal.transpose());
        }
        ends
    }

    /// Distribution of a segment's ends under a product of factors; `None` where a direction is left free.
    fn distribution_of_ends(&self, number: usize, product: &Gaussian<ENDED>) -> Option<Normal<ENDS>> {
        let (ends, root) = (self.ends(number), product.information.cholesky()?);
        let across = root.l_dirty().solve_lower_triangular(&ends.transpose())?;
        let covariance = across.transpose() * across + SMatrix::identity() * END_NOISE.powi(2);
        Some(Normal { mean: ends * root.solve(&product.information_vector), covariance })
    }

    /// Density of the corner whose components begin at `first`.
    fn corner<const D: usize>(&self, first: usize) -> Gaussian<D> {
        let offset = -2.0 * self.corner_sigma.ln() - (2.0 * PI).ln();
        let mut factor = Gaussian::<D> { offset, ..Gaussian::default() };
        let precision = Vector2::repeat(self.corner_sigma.powi(-2));
        factor.information.fixed_view_mut::<CORNER, CORNER>(first, first).set_diagonal(&precision);
        factor
    }
}

/// The factor with the corners where a segment begins and where it ends swapped.
fn swap_corners(factor: Gaussian<ENDED>) -> Gaussian<ENDED> {
    factor.swap_components(CLOSED, BEGUN, CORNER)
}

/// Entries by the state of one segment, a column each, and of another, a row each; up to a multiple.
type StateMatrix = Matrix2<f64>;

/// Forward-backward messages of the states around a ring, as it is visited segment by segment.
struct ForwardBackward {
    /// From the first segment's state to that of the next segment to be visited.
    forward: StateMatrix,
    /// From each segment's state to the next one's.
    transitions: Vec<StateMatrix>,
    /// From each segment's state, over all behind it, to the first one's.
    backward: Vec<StateMatrix>,
}

impl ForwardBackward {
    /// The messages before the first segment is visited.
    fn new(segments: &[ContourSegment]) -> Self {
        let transitions: Vec<StateMatrix> = (0..segments.len()).map(|number| transition(segments, number)).collect();
        let mut last = StateMatrix::identity();
        let step = |number: usize| {
            let backward = last * transitions[number];
            last = normalized(backward * emission(&segments[number])).0;
            backward
        };
        let mut backward: Vec<StateMatrix> = (0..segments.len()).rev().map(step).collect();
        backward.reverse();
        Self { forward: StateMatrix::identity(), transitions, backward }
    }

    /// Cavity probabilities of the states of the next segment, which has this number: by all other segments.
    fn cavity(&self, number: usize) -> [f64; STATES] {
        let weights = (self.forward * self.backward[number]).diagonal();
        (weights / weights.sum()).into()
    }

    /// Goes past that segment.
    fn pass(&mut self, number: usize, segments: &[ContourSegment]) {
        self.forward = normalized(self.transitions[number] * emission(&segments[number]) * self.forward).0;
    }
}

/// Log probability of all labels beside a ring: the sum over its states.
fn log_probability(segments: &[ContourSegment]) -> f64 {
    let (mut product, mut prior, mut log_scale) = (StateMatrix::identity(), StateMatrix::identity(), 0.0);
    for (number, segment) in segments.iter().enumerate() {
        let next = transition(segments, number);
        prior = next * prior;
        let (passed, log_most) = normalized(next * emission(segment) * product);
        product = passed;
        log_scale += log_most + most_likely(segment);
    }
    log_scale + (product.trace() / prior.trace()).ln()
}

/// Transition from a segment's state to the next one's: a two-state Markov process along the contour, whose correlation length is the
/// disturbed state's sigma, a convention. With half that length ellipsoids hold as many poses, with three times that some fewer
/// (`python -m benchmarks lidar --only scan=samples --only noise=0.05`).
fn transition(segments: &[ContourSegment], number: usize) -> StateMatrix {
    let (segment, next) = (&segments[number], &segments[(number + 1) % segments.len()]);
    let [_, disturbed] = next.states;
    let distance = 0.5 * (segment.length + next.length);
    let same = (-distance / disturbed.sigma).exp();
    let stationary = Vector2::from(next.states.map(|state| state.probability));
    StateMatrix::from_columns(&[stationary, stationary]) * (1.0 - same) + StateMatrix::identity() * same
}

/// Likelihood of a segment's labels in each state, up to a multiple.
fn emission(segment: &ContourSegment) -> StateMatrix {
    let most = most_likely(segment);
    let likelihoods = segment.site.log_likelihoods.map(|log_likelihood| (log_likelihood - most).exp());
    StateMatrix::from_diagonal(&Vector2::from(likelihoods))
}

/// Log likelihood of a segment's labels in their likeliest state.
fn most_likely(segment: &ContourSegment) -> f64 {
    let [clean, disturbed] = segment.site.log_likelihoods;
    clean.max(disturbed)
}

/// The matrix with 1 as its largest entry, and the logarithm of what that was.
fn normalized(matrix: StateMatrix) -> (StateMatrix, f64) {
    let most = matrix.max();
    (matrix / most, most.ln())
}
