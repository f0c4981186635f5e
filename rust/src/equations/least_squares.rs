//! Levenberg-Marquardt over a pose: Moré's trust region (1978; MINPACK's `lmder`) on the normal equations of six parameters.
//!
//! The parameters are a left increment of the pose reached, in radians and in shares of the distance, so that the tolerance
//! on the pose is too, and the exact derivative needs no chain rule (`docs/math.md`, eq. 6.9).

use nalgebra::{Cholesky, Const, Matrix6};

use crate::budget::Budget;
use crate::equations::normal_equations::NormalEquations;
use crate::equations::residual::{RegionEquations, normal_equations};
use crate::equations::system::Weighting;
use crate::geometry::pose::{Pose, Tangent};

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TerminationCriteria {
    /// Relative change of the cost and of the pose at which a minimum counts as reached.
    pub tolerance: f64,
    /// Most evaluations of the equations.
    pub evaluations: usize,
}

/// Why an iteration ended.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Termination {
    /// The equations hold exactly.
    #[error("the residuals are zero")]
    ResidualsZero,
    /// A minimum by the tolerance on the cost.
    #[error("the cost changes less than the tolerance")]
    CostTolerance,
    /// A minimum by the tolerance on the pose.
    #[error("the pose changes less than the tolerance")]
    PoseTolerance,
    /// With a tolerance near the round-off this is a minimum too.
    #[error("the cost can fall no further in double precision")]
    RoundOff,
    /// As many evaluations as were allowed.
    #[error("the limit of evaluations was reached")]
    EvaluationLimit,
    /// As much work as the search may do.
    #[error("the limit of the search's work was reached")]
    WorkLimit,
    /// The start is out of view, or every shorter step down the slope ends there.
    #[error("a region left the view")]
    OutOfView,
    /// The numbers overflowed, or no equation is left.
    #[error("a number is not finite")]
    NotFinite,
    /// The message of another solver.
    #[error("{0}")]
    Foreign(String),
}

impl Termination {
    /// Whether the iteration of this module ended at a minimum.
    fn is_minimum(&self) -> bool {
        matches!(self, Self::ResidualsZero | Self::CostTolerance | Self::PoseTolerance | Self::RoundOff)
    }
}

/// The end point of a least-squares iteration.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[must_use]
pub struct Minimum {
    /// The pose, `camera_from_world`.
    pub pose: Pose,
    /// Sum of squared residuals.
    pub cost: f64,
    /// Whether a minimum was reached.
    pub converged: bool,
    /// Why the iteration ended.
    pub termination: Termination,
    /// Evaluations of the equations.
    pub evaluations: usize,
}

/// First radius of the trust region in sizes of the parameters, one of each: hardly a bound.
const FIRST_RADIUS: f64 = 100.0;

/// The radius is met to this share.
const RADIUS_SHARE: f64 = 0.1;

/// Most steps of the search for the damping that meets the radius.
const DAMPING_STEPS: usize = 10;

/// Share of the largest damping worth a try to begin with.
const SMALL_DAMPING: f64 = 1e-3;

/// Least ratio of actual to predicted reduction at which a step is taken.
const LEAST_GAIN: f64 = 1e-4;

/// Ratios of actual to predicted reduction below and above which the radius shrinks and grows.
const POOR_GAIN: f64 = 0.25;
const GOOD_GAIN: f64 = 0.75;

/// Most by which the radius shrinks at once; a cost above the inverse square of it, times the least so far, is no reason for more.
const STRONGEST_SHRINK: f64 = 0.1;

/// The minimum of the squared residuals of `regions` that is reached from `start`.
pub fn minimize(
    regions: &[RegionEquations],
    start: &Pose,
    weighting: Weighting,
    criteria: TerminationCriteria,
    budget: &Budget,
) -> Minimum {
    let evaluate = |pose: &Pose| normal_equations(regions, pose, weighting, budget);
    let Some(equations) = evaluate(start) else {
        let termination = Termination::OutOfView;
        let (pose, cost) = (*start, f64::INFINITY);
        return Minimum { pose, cost, converged: false, termination, evaluations: 1 };
    };
    let mut descent = Descent::new(start, equations, budget);
    let termination = loop {
        if let Some(termination) = descent.step(evaluate, criteria) {
            break termination;
        }
    };
    let Descent { pose, equations, evaluations, .. } = descent;
    let cost = equations.cost;
    Minimum { pose, cost, converged: termination.is_minimum(), termination, evaluations }
}

/// One radian about each axis, and the distance of the (centered) world's origin along each.
pub fn step_unit(start: &Pose) -> Tangent {
    let distance = start.translation.norm();
    Tangent::new(1.0, 1.0, 1.0, distance, distance, distance)
}

/// State of the iteration.
struct Descent<'a> {
    pose: Pose,
    equations: NormalEquations,
    unit: Tangent,
    /// Size of each parameter: the largest norm that its column of derivatives has had.
    sizes: Tangent,
    /// Largest step, in these sizes.
    radius: f64,
    damping: f64,
    evaluations: usize,
    budget: &'a Budget,
}

impl<'a> Descent<'a> {
    fn new(start: &Pose, equations: NormalEquations, budget: &'a Budget) -> Self {
        let sizes = Tangent::zeros();
        let (unit, radius) = (step_unit(start), f64::INFINITY);
        let mut descent = Self { pose: *start, equations, unit, sizes, radius, damping: 0.0, evaluations: 1, budget };
        descent.resize();
        descent.radius = FIRST_RADIUS * descent.sizes.norm();
        descent
    }

    /// Lets the parameters' sizes grow with their columns.
    fn resize(&mut self) {
        let columns = self.equations.information.diagonal().map(f64::sqrt).component_mul(&self.unit);
        self.sizes = self.sizes.zip_map(&columns, f64::max);
    }

    /// Tries one step and takes it if it reduces the cost; returns what ended the iteration, if anything.
    fn step(
        &mut self,
        evaluate: impl Fn(&Pose) -> Option<NormalEquations>,
        criteria: TerminationCriteria,
    ) -> Option<Termination> {
        if let Some(termination) = self.over(criteria) {
            return Some(termination);
        }
        let back = self.back();
        let model = Model::new(&self.equations, &back);
        let Some((step, damping)) = model.step_within(self.radius, self.damping) else {
            return Some(Termination::NotFinite);
        };
        self.damping = damping;
        if self.evaluations == 1 {
            self.radius = self.radius.min(step.norm());
        }
        let pose = self.pose.retract(&step.component_mul(&back));
        if damping == 0.0 && 2.0 * step.norm() <= criteria.tolerance * self.sizes.norm() {
            self.take_unevaluated(pose, Gain::new(&model, &step, damping, self.equations.cost, None).predicted);
            return Some(Termination::PoseTolerance);
        }
        let reached = evaluate(&pose);
        self.evaluations += 1;
        let gain = Gain::new(&model, &step, damping, self.equations.cost, reached.as_ref());
        self.adapt_radius(&gain, step.norm());
        let termination = self.ended(&gain, reached.is_some(), criteria);
        if let Some(equations) = reached.filter(|_| gain.ratio() >= LEAST_GAIN) {
            (self.pose, self.equations) = (pose, equations);
            self.resize();
        }
        termination
    }

    /// Takes a step whose radius would end the iteration without evaluating its end: what is left is of its square.
    fn take_unevaluated(&mut self, pose: Pose, predicted: f64) {
        self.pose = pose;
        self.equations.cost *= (1.0 - predicted).max(0.0);
    }

    /// The pose's increment by a parameter of size one; zero for one that nothing depends on.
    fn back(&self) -> Tangent {
        self.unit.zip_map(&self.sizes, |unit, size| if size > 0.0 { unit / size } else { 0.0 })
    }

    /// The reason to end the iteration before another step, if any.
    fn over(&self, criteria: TerminationCriteria) -> Option<Termination> {
        let NormalEquations { cost, gradient, .. } = &self.equations;
        if !(cost.is_finite() && self.sizes.norm().is_finite()) || self.sizes.norm() == 0.0 {
            return Some(Termination::NotFinite);
        }
        if *cost == 0.0 {
            return Some(Termination::ResidualsZero);
        }
        if gradient.amax() == 0.0 {
            return Some(Termination::RoundOff);
        }
        if self.budget.is_exhausted() {
            return Some(Termination::WorkLimit);
        }
        (self.evaluations >= criteria.evaluations).then_some(Termination::EvaluationLimit)
    }

    fn adapt_radius(&mut self, gain: &Gain, length: f64) {
        if gain.ratio() <= POOR_GAIN {
            let shrink = gain.shrink();
            self.radius = shrink * self.radius.min(length / STRONGEST_SHRINK);
            self.damping /= shrink;
        } else if self.damping == 0.0 || gain.ratio() >= GOOD_GAIN {
            self.radius = 2.0 * length;
            self.damping /= 2.0;
        }
    }

    /// The reason to end the iteration after a step, if any.
    fn ended(&self, gain: &Gain, in_view: bool, criteria: TerminationCriteria) -> Option<Termination> {
        let is_short = |share: f64| self.radius <= share * self.sizes.norm();
        if gain.is_flat(criteria.tolerance) {
            return Some(Termination::CostTolerance);
        }
        if is_short(criteria.tolerance) {
            return Some(if in_view { Termination::PoseTolerance } else { Termination::OutOfView });
        }
        (gain.is_flat(f64::EPSILON) || is_short(f64::EPSILON)).then_some(Termination::RoundOff)
    }
}

/// The normal equations in parameters of size one.
struct Model {
    information: Matrix6<f64>,
    gradient: Tangent,
}

impl Model {
    fn new(equations: &NormalEquations, back: &Tangent) -> Self {
        let information = equations.information.component_mul(&(back * back.transpose()));
        Self { information, gradient: equations.gradient.component_mul(back) }
    }

    /// The minimum of the model plus `damping` times the squared step, and the Cholesky factor that it came from.
    fn damped(&self, damping: f64) -> Option<(Tangent, Cholesky<f64, Const<6>>)> {
        let factor = (self.information + Matrix6::from_diagonal_element(damping)).cholesky()?;
        let step = -factor.solve(&self.gradient);
        step.iter().all(|entry| entry.is_finite()).then_some((step, factor))
    }

    /// The step to the model's minimum within a radius, and the damping that keeps it there (Moré 1978, section 5).
    fn step_within(&self, radius: f64, guess: f64) -> Option<(Tangent, f64)> {
        let full = self.damped(0.0);
        if let Some((step, _)) = full.as_ref().filter(|(step, _)| step.norm() <= (1.0 + RADIUS_SHARE) * radius) {
            return Some((*step, 0.0));
        }
        let low = full.map_or(0.0, |(step, factor)| correction(&step, &factor, radius));
        let mut bracket = [low, self.gradient.norm() / radius];
        let mut damping = guess.max(low).min(bracket[1]).max(SMALL_DAMPING * bracket[1]);
        let mut best = None;
        for _ in 0..DAMPING_STEPS {
            let damped = self.damped(damping);
            best = damped.as_ref().map(|(step, _)| (*step, damping)).or(best);
            if damped.as_ref().is_some_and(|(step, _)| (step.norm() - radius).abs() <= RADIUS_SHARE * radius) {
                break;
            }
            damping = next_damping(&mut bracket, damping, damped, radius);
        }
        best
    }
}

/// The damping to try after one whose step, if there is any, is not as long as the radius; narrows the bracket around it.
fn next_damping(
    [low, high]: &mut [f64; 2],
    damping: f64,
    damped: Option<(Tangent, Cholesky<f64, Const<6>>)>,
    radius: f64,
) -> f64 {
    let Some((step, factor)) = damped else {
        // In double precision not positive definite yet.
        *low = damping;
        return (*low * *high).sqrt().max(2.0 * *low);
    };
    if step.norm() > radius {
        *low = low.max(damping)
    } else {
        *high = high.min(damping)
    }
    low.max(damping + correction(&step, &factor, radius)).min(*high)
}

/// Newton's correction of the damping of a step whose length should be the radius (Moré 1978, eq. 5.5 and 5.8).
fn correction(step: &Tangent, factor: &Cholesky<f64, Const<6>>, radius: f64) -> f64 {
    let length = step.norm();
    let bent = factor.l_dirty().solve_lower_triangular(&(step / length)).map_or(f64::INFINITY, |v| v.norm_squared());
    (length - radius) / (radius * bent)
}

/// Actual and predicted reduction of a step, relative to the cost before it.
struct Gain {
    actual: f64,
    predicted: f64,
    /// Half the slope of the cost along the step.
    slope: f64,
}

impl Gain {
    fn new(model: &Model, step: &Tangent, damping: f64, before: f64, reached: Option<&NormalEquations>) -> Self {
        let worth = |reached: &&NormalEquations| STRONGEST_SHRINK.powi(2) * reached.cost < before;
        let actual = reached.filter(worth).map_or(-1.0, |reached| 1.0 - reached.cost / before);
        let curvature = step.dot(&(model.information * step)) / before;
        let damped = damping * step.norm_squared() / before;
        Self { actual, predicted: curvature + 2.0 * damped, slope: -(curvature + damped) }
    }

    /// Ratio of actual to predicted reduction.
    fn ratio(&self) -> f64 {
        if self.predicted > 0.0 { self.actual / self.predicted } else { 0.0 }
    }

    /// Whether neither reduction is above a share of the cost.
    fn is_flat(&self, share: f64) -> bool {
        self.actual.abs() <= share && self.predicted <= share && self.ratio() <= 2.0
    }

    /// The share of the radius to go on with after a poor step: where a parabola through both costs is lowest.
    fn shrink(&self) -> f64 {
        let lowest = if self.actual >= 0.0 { 0.5 } else { 0.5 * self.slope / (self.slope + 0.5 * self.actual) };
        if self.actual == -1.0 { STRONGEST_SHRINK } else { lowest.max(STRONGEST_SHRINK) }
    }
}
