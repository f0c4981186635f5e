//! Levenberg-Marquardt over a pose.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::storage::Owned;
use nalgebra::{DVector, Dyn, OMatrix, U6};

use crate::equations::residual::{Evaluation, RegionEquations, evaluate};
use crate::equations::system::Weighting;
use crate::geometry::pose::{Pose, Tangent, increment_derivative};

/// Stands for every residual where a region leaves the view, so that the step there is refused and a shorter one tried.
pub const OUT_OF_VIEW: f64 = 1e6;

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stopping {
    /// Relative change of the cost and of the pose at which a minimum counts as reached.
    pub tolerance: f64,
    /// Most evaluations of the equations.
    pub evaluations: usize,
}

/// Where the least squares ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// The pose, `camera_from_world`.
    pub pose: Pose,
    /// Sum of squared residuals.
    pub cost: f64,
    /// Whether a minimum was reached.
    pub converged: bool,
    /// Why the iteration ended, in words.
    pub termination: String,
    /// Evaluations of the equations.
    pub evaluations: usize,
}

/// The minimum of the squared residuals of `regions` that is reached from `start`.
///
/// The parameter is one left increment of `start`, with its exact derivative, so that no re-centring is needed; it counts from
/// [`step_unit`], so that the tolerance on the pose is in radians and in shares of the distance.
pub fn minimize(regions: &[RegionEquations], start: &Pose, weighting: Weighting, stopping: Stopping) -> Minimum {
    let problem = Increment::new(regions, start, weighting);
    // The crate's limit counts gradients of six parameters plus one.
    let patience = stopping.evaluations.div_ceil(7).max(1);
    let solver = LevenbergMarquardt::new()
        .with_ftol(stopping.tolerance)
        .with_xtol(stopping.tolerance)
        .with_gtol(0.0)
        .with_patience(patience);
    let (problem, report) = solver.minimize(problem);
    Minimum {
        pose: problem.pose(),
        cost: problem.evaluation.as_ref().map_or(f64::INFINITY, |e| e.residual.norm_squared()),
        converged: problem.evaluation.is_some() && has_converged(&report.termination),
        termination: described(&report.termination),
        evaluations: report.number_of_evaluations,
    }
}

/// One radian about each axis, and the distance of the (centred) world's origin along each.
pub fn step_unit(start: &Pose) -> Tangent {
    let distance = start.translation.norm();
    Tangent::new(1.0, 1.0, 1.0, distance, distance, distance)
}

/// The least squares problem in the crate's terms.
struct Increment<'a> {
    regions: &'a [RegionEquations],
    start: Pose,
    weighting: Weighting,
    unit: Tangent,
    x: Tangent,
    evaluation: Option<Evaluation>,
}

impl<'a> Increment<'a> {
    fn new(regions: &'a [RegionEquations], start: &Pose, weighting: Weighting) -> Self {
        let (unit, x) = (step_unit(start), Tangent::zeros());
        Self { regions, start: *start, weighting, unit, x, evaluation: evaluate(regions, start, weighting) }
    }

    fn pose(&self) -> Pose {
        self.start.moved(&self.x)
    }

    fn count(&self) -> usize {
        self.regions.iter().map(|region| region.count(self.weighting)).sum()
    }
}

impl LeastSquaresProblem<f64, Dyn, U6> for Increment<'_> {
    type ParameterStorage = Owned<f64, U6>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, U6>;

    fn set_params(&mut self, x: &Tangent) {
        self.x = x - self.unit;
        self.evaluation = evaluate(self.regions, &self.pose(), self.weighting);
    }

    fn params(&self) -> Tangent {
        self.x + self.unit
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(match &self.evaluation {
            Some(evaluation) => evaluation.residual.clone(),
            None => DVector::from_element(self.count(), OUT_OF_VIEW),
        })
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, U6>> {
        self.evaluation.as_ref().map(|evaluation| &evaluation.jacobian * increment_derivative(&self.x))
    }
}

fn has_converged(reason: &TerminationReason) -> bool {
    match reason {
        TerminationReason::ResidualsZero
        | TerminationReason::Orthogonal
        | TerminationReason::Converged { .. }
        // The cost can fall no further in double precision: with a tolerance near the round-off this is a minimum too.
        | TerminationReason::NoImprovementPossible(_) => true,
        _ => false,
    }
}

fn described(reason: &TerminationReason) -> String {
    match reason {
        TerminationReason::ResidualsZero => "the residuals are zero".into(),
        TerminationReason::Orthogonal => "the gradient is zero".into(),
        TerminationReason::Converged { ftol: true, xtol: true } => {
            "cost and pose change less than the tolerance".into()
        }
        TerminationReason::Converged { ftol: true, .. } => "the cost changes less than the tolerance".into(),
        TerminationReason::Converged { .. } => "the pose changes less than the tolerance".into(),
        TerminationReason::NoImprovementPossible(_) => "the cost can fall no further in double precision".into(),
        TerminationReason::LostPatience => "the limit of evaluations was reached".into(),
        TerminationReason::User(_) => "a region left the view".into(),
        TerminationReason::Numerical(what) => format!("a number that is not finite in {what}"),
        TerminationReason::WrongDimensions(what) => format!("wrong dimensions: {what}"),
        TerminationReason::NoParameters | TerminationReason::NoResiduals => "there is nothing to solve".into(),
    }
}
