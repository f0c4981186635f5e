//! Problems and what comes of them.

use std::sync::Arc;

use nalgebra::UnitQuaternion;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use regionpose::Error;
use regionpose::internals::batch::in_parallel_within;
use regionpose::internals::budget::Budget;
use regionpose::internals::equations::facet::Integration;
use regionpose::internals::equations::least_squares;
use regionpose::internals::equations::residual::Evaluation;
use regionpose::internals::equations::system::{System, Weighting};
use regionpose::internals::options::{FrameSigma, Limits, Options, Refinement, Start};
use regionpose::internals::problem;
use regionpose::internals::search;
use regionpose::internals::verdict::{coverage, estimate, solution, weakness};

use crate::arrays::{
    covariance, kept, matrix, optional, pose, read_only, rotation, scalar, tangent, translation, value_error,
};
use crate::interrupts::{detached, detached_threads};
use crate::poses::RotationTranslation;
use crate::prior::Prior;
use crate::regions::{ObservedRegion, WorldRegion};
use crate::warnings::{WarningFields, warning_fields};

fn invalid_option(option: &str, found: &str, needed: &str) -> PyErr {
    PyValueError::new_err(format!("{option} is {found:?}; it needs to be {needed}"))
}

fn parsed_system(name: &str) -> PyResult<System> {
    match name {
        "plane" => Ok(System::Plane),
        "sphere" => Ok(System::Sphere),
        other => Err(invalid_option("system", other, "\"plane\" or \"sphere\"")),
    }
}

fn parsed_integration(name: &str, mesh_size: Option<f64>) -> PyResult<Integration> {
    match (name, mesh_size) {
        ("mesh", size) => Ok(Integration::Mesh { size }),
        ("boundary" | "pixels", Some(size)) => {
            Err(PyValueError::new_err(format!("mesh_size is {size} with integration {name:?}; it needs \"mesh\"")))
        }
        ("boundary", None) => Ok(Integration::Boundary),
        ("pixels", None) => Ok(Integration::Pixels),
        (other, _) => Err(invalid_option("integration", other, "\"boundary\", \"mesh\" or \"pixels\"")),
    }
}

fn parsed_start(name: &str) -> PyResult<Start> {
    match name {
        "global" => Ok(Start::Global),
        "paper" => Ok(Start::Paper),
        other => Err(invalid_option("start", other, "\"global\" or \"paper\"")),
    }
}

fn parsed_refinement(name: Option<&str>) -> PyResult<Refinement> {
    match name {
        None => Ok(Refinement::Off),
        Some("contour") => Ok(Refinement::Contour),
        Some(other) => Err(invalid_option("refine", other, "\"contour\" or None")),
    }
}

type ResidualJacobian<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

type RegionsEnds<'py> = ([usize; 2], Bound<'py, PyArray2<f64>>);

/// The end point of a least-squares iteration.
#[pyclass(frozen, module = "regionpose._core")]
#[derive(Clone)]
pub struct Minimum(least_squares::Minimum);

#[pymethods]
impl Minimum {
    #[new]
    fn new(
        rotation: &Bound<'_, PyAny>,
        translation: &Bound<'_, PyAny>,
        cost: f64,
        converged: bool,
        termination: String,
        evaluations: usize,
    ) -> PyResult<Self> {
        let pose = pose(rotation, translation)?;
        let termination = least_squares::Termination::Foreign(termination);
        Ok(Self(least_squares::Minimum { pose, cost, converged, termination, evaluations }))
    }

    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rotation(py, &self.0.pose)
    }

    #[getter]
    fn translation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        translation(py, &self.0.pose)
    }

    #[getter]
    fn cost(&self) -> f64 {
        self.0.cost
    }

    #[getter]
    fn converged(&self) -> bool {
        self.0.converged
    }

    #[getter]
    fn termination(&self) -> String {
        self.0.termination.to_string()
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.0.evaluations
    }
}

/// A pose and its overlap errors.
#[pyclass(frozen, module = "regionpose._core")]
#[derive(Clone)]
pub struct Solution {
    whole: Arc<estimate::Estimate>,
    /// Which of the alternatives it is; `None` is the best one.
    alternative: Option<usize>,
}

impl Solution {
    fn held(&self) -> &solution::Solution {
        self.alternative.map_or(&self.whole.best, |index| &self.whole.alternatives[index])
    }
}

#[pymethods]
impl Solution {
    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rotation(py, &self.held().pose)
    }

    /// The same rotation as x, y, z, w, (4,).
    #[getter]
    fn quaternion<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let quaternion = UnitQuaternion::from_rotation_matrix(&self.held().pose.rotation);
        read_only(py, quaternion.coords.as_slice())
    }

    #[getter]
    fn translation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        read_only(py, self.held().pose.translation.as_slice())
    }

    /// Whether the least squares of the moments ended at a minimum; true where the pose was refined on the contours.
    #[getter]
    fn converged(&self) -> bool {
        self.held().minimum.as_ref().is_none_or(|minimum| minimum.converged)
    }

    #[getter]
    fn termination(&self) -> String {
        let other = match self.held().posterior {
            Some(_) => "posterior_mean",
            None => "contour_fit",
        };
        self.held().minimum.as_ref().map_or_else(|| other.into(), |minimum| minimum.termination.to_string())
    }

    #[getter]
    fn overlap_error(&self) -> f64 {
        self.held().overlap_error
    }

    #[getter]
    fn region_overlap_errors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        read_only(py, &self.held().region_overlap_errors)
    }

    /// Derivative (6,) of the pose, a left increment, by the logarithm of the focal lengths; NaN where a direction is left free.
    #[getter]
    fn focal_shift<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        read_only(py, self.held().focal_shift.as_slice())
    }

    #[getter]
    fn confidence(&self) -> f64 {
        self.held().confidence
    }

    #[getter]
    fn mode_probability(&self) -> f64 {
        self.held().mode_probability
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(kept(matrix(py, self.held().covariance.iter().copied().collect(), [6, 6])?))
    }
}

/// The pose of a camera, with its covariance, alternatives, confidence and warnings.
#[pyclass(frozen, module = "regionpose._core")]
#[derive(Clone)]
pub struct Estimate(Arc<estimate::Estimate>);

impl Estimate {
    fn new(found: estimate::Estimate) -> Self {
        Self(Arc::new(found))
    }
}

#[pymethods]
impl Estimate {
    #[getter]
    fn best(&self) -> Solution {
        Solution { whole: self.0.clone(), alternative: None }
    }

    #[getter]
    fn boundary_noise(&self) -> f64 {
        self.0.boundary_noise
    }

    /// Share of the contours that is disturbed, or of the samples on the wrong side of them, a fraction; None where the pose is
    /// that of the moments.
    #[getter]
    fn outlier_fraction(&self) -> Option<f64> {
        if let Some(posterior) = &self.0.best.posterior {
            return Some(posterior.wrong_fractions.iter().sum::<f64>() / posterior.wrong_fractions.len().max(1) as f64);
        }
        let shares = self.0.best.fit.clean_shares();
        let clean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
        self.0.best.minimum.is_none().then_some(1.0 - clean)
    }

    /// Probability that one of the answers is within 5 degrees of the true pose ($P$ of `docs/math.md`, eq. 15.1).
    #[getter]
    fn probability(&self) -> f64 {
        self.0.evidence.probability()
    }

    /// Log odds that the best pose is the right mode (`docs/math.md`, eq. 15.3).
    #[getter]
    fn log_odds(&self) -> f64 {
        self.0.evidence.log_odds()
    }

    /// What the confidence is made of, (3,): regions that belong to the pose, the share of them that contradicts it and the contours'
    /// noise, pixels (`docs/math.md`, eq. 15.3).
    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let regionpose::Evidence { regions, mismatch, noise, .. } = self.0.evidence;
        PyArray1::from_slice(py, &[regions as f64, mismatch, noise])
    }

    #[getter]
    fn alternatives(&self) -> Vec<Solution> {
        (0..self.0.alternatives.len())
            .map(|index| Solution { whole: self.0.clone(), alternative: Some(index) })
            .collect()
    }

    /// (regions, ends (2, 3)) of each edge that two regions share.
    #[getter]
    fn shared_edges<'py>(&self, py: Python<'py>) -> PyResult<Vec<RegionsEnds<'py>>> {
        let creases = self.0.creases.iter();
        creases
            .map(|(regions, ends)| Ok((*regions, matrix(py, ends.iter().flatten().copied().collect(), [2, 3])?)))
            .collect()
    }

    /// (code, regions, values by name) of each warning.
    #[getter]
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Vec<WarningFields<'py>>> {
        self.0.warnings.iter().map(|warning| warning_fields(py, warning)).collect()
    }

    /// Angle of a pixel where the regions are seen, radians: the root of its mean square over them.
    #[getter]
    fn pixel_angle(&self) -> f64 {
        self.0.pixel_angle
    }

    /// Median distance of the regions from the camera at the best pose.
    #[getter]
    fn distance(&self) -> f64 {
        self.0.distance
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.0.evaluations
    }
}

/// Pairs of image regions and world regions, ready to be solved.
#[pyclass(frozen, module = "regionpose._core")]
pub struct Problem(problem::Problem);

#[pymethods]
impl Problem {
    #[new]
    #[pyo3(signature = (observed, worlds, *, system, integration, mesh_size = None))]
    fn new(
        py: Python<'_>,
        observed: Vec<PyRef<'_, ObservedRegion>>,
        worlds: Vec<PyRef<'_, WorldRegion>>,
        system: &Bound<'_, PyAny>,
        integration: &Bound<'_, PyAny>,
        mesh_size: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let sides = Sides::new(&observed, &worlds);
        let system: String = scalar("system", system, "\"plane\" or \"sphere\"")?;
        let integration: String = scalar("integration", integration, "\"boundary\", \"mesh\" or \"pixels\"")?;
        let mesh_size: Option<f64> = optional("mesh_size", mesh_size, "a number, or None")?;
        let (system, integration) = (parsed_system(&system)?, parsed_integration(&integration, mesh_size)?);
        detached(py, |budget| sides.problem(system, integration, budget))?.map(Self).map_err(value_error)
    }

    /// Cost of one evaluation of all of the problem, in units of `work_counter`.
    #[getter]
    fn work(&self) -> u64 {
        self.0.work()
    }

    /// The poses that may be the answer, and the equations to polish them by.
    #[pyo3(signature = (*, start = "global", prior = None, refine = "contour", frame_sigma = None, limits = None))]
    fn search(
        &self,
        py: Python<'_>,
        start: &str,
        prior: Option<Prior>,
        refine: Option<&str>,
        frame_sigma: Option<[f64; 4]>,
        limits: Option<[f64; 2]>,
    ) -> PyResult<Search> {
        let options = parsed_options(start, prior, refine, frame_sigma, limits)?;
        detached(py, |budget| self.0.search_within(&options, budget)).map(Search)
    }

    /// The paper's own residuals (m,) at a pose, and their derivatives (m, 6) by a left increment; None where a region is out
    /// of view.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
    ) -> PyResult<Option<ResidualJacobian<'py>>> {
        let pose = pose(rotation, translation)?;
        let evaluation = py.detach(|| self.0.evaluate(&pose, Weighting::Uniform));
        evaluation.map(|evaluation| residual_jacobian(py, &evaluation)).transpose()
    }

    /// Overlap error of all regions together at a pose, and of each (k,).
    fn overlap_errors<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
    ) -> PyResult<(f64, Bound<'py, PyArray1<f64>>)> {
        let pose = pose(rotation, translation)?;
        let (whole, errors) = py.detach(|| coverage::overlap_errors(&self.0, &pose, &Budget::unlimited()));
        Ok((whole, PyArray1::from_vec(py, errors)))
    }

    /// The warning, as of `Estimate.warnings`, of a pose of this covariance (6, 6) where that exceeds `limits`, degrees and a fraction of
    /// the distance; else None.
    #[pyo3(signature = (rotation, translation, covariance, *, limits = None))]
    fn weak_geometry<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
        covariance: &Bound<'py, PyAny>,
        limits: Option<[f64; 2]>,
    ) -> PyResult<Option<WarningFields<'py>>> {
        let pose = pose(rotation, translation)?;
        let limits = limits.map(parsed_limits).transpose()?.unwrap_or_default();
        let warning = weakness::weak_geometry(&self.0, &pose, &self::covariance(covariance)?, &limits);
        warning.map(|warning| warning_fields(py, &warning)).transpose()
    }

    /// The estimate by the native driver; None without a pose in view.
    #[pyo3(signature = (*, start = "global", prior = None, refine = "contour", frame_sigma = None, limits = None))]
    fn estimate<'py>(
        &self,
        py: Python<'py>,
        start: &str,
        prior: Option<Prior>,
        refine: Option<&str>,
        frame_sigma: Option<[f64; 4]>,
        limits: Option<[f64; 2]>,
    ) -> PyResult<Option<Estimate>> {
        let options = parsed_options(start, prior, refine, frame_sigma, limits)?;
        let found = detached(py, |budget| self.0.estimate_within(&options, budget))?;
        Ok(in_view(found).map_err(value_error)?.map(Estimate::new))
    }
}

/// An estimate, or none where no pose shows every region.
fn in_view(found: regionpose::Result<regionpose::Estimate>) -> regionpose::Result<Option<regionpose::Estimate>> {
    match found {
        Err(Error::NoPose) => Ok(None),
        found => found.map(Some),
    }
}

fn parsed_options(
    start: &str,
    prior: Option<Prior>,
    refine: Option<&str>,
    frame_sigma: Option<[f64; 4]>,
    limits: Option<[f64; 2]>,
) -> PyResult<Options> {
    let options = Options::default().with_start(parsed_start(start)?).with_refinement(parsed_refinement(refine)?);
    Ok(options
        .with_prior(prior.map(|prior| prior.0).unwrap_or_default())
        .with_frame_sigma(frame_sigma.map(parsed_frame_sigma).transpose()?.unwrap_or_default())
        .with_limits(limits.map(parsed_limits).transpose()?.unwrap_or_default()))
}

/// Errors of a whole exposure: degrees, meters, a fraction of the focal lengths, pixels.
fn parsed_frame_sigma([degrees, meters, focal, center]: [f64; 4]) -> PyResult<FrameSigma> {
    Ok(FrameSigma::ZERO
        .with_rotation(at_least_zero("frame_sigma[0]", degrees)?.to_radians())
        .with_place(at_least_zero("frame_sigma[1]", meters)?)
        .with_focal(at_least_zero("frame_sigma[2]", focal)?)
        .with_center(at_least_zero("frame_sigma[3]", center)?))
}

/// Limits of the deviations of a trusted pose, degrees and a fraction of the distance.
fn parsed_limits([degrees, fraction]: [f64; 2]) -> PyResult<Limits> {
    let (rotation, translation) = (at_least_zero("limits[0]", degrees)?, at_least_zero("limits[1]", fraction)?);
    Ok(Limits::default().with_rotation(rotation.to_radians()).with_translation(translation))
}

fn at_least_zero(name: &str, value: f64) -> PyResult<f64> {
    let holds = value >= 0.0 && value.is_finite();
    let error = || PyValueError::new_err(format!("{name} is {value}; it needs to be a finite number of at least 0"));
    holds.then_some(value).ok_or_else(error)
}

fn residual_jacobian<'py>(py: Python<'py>, evaluation: &Evaluation) -> PyResult<ResidualJacobian<'py>> {
    let rows = evaluation.residual.len();
    let jacobian = matrix(py, evaluation.jacobian.transpose().iter().copied().collect(), [rows, 6])?;
    Ok((PyArray1::from_slice(py, evaluation.residual.as_slice()), jacobian))
}

/// The result of a search: candidates, and their equations on the scale of the boundary noise.
#[pyclass(frozen, module = "regionpose._core")]
pub struct Search(search::Search);

#[pymethods]
impl Search {
    /// Poses (rotation (3, 3), translation (3,)) near which to solve the moments' equations, best first; none where the
    /// contours have decided.
    #[getter]
    fn candidates<'py>(&self, py: Python<'py>) -> PyResult<Vec<RotationTranslation<'py>>> {
        let poses = self.0.candidates();
        poses.iter().map(|pose| Ok((rotation(py, pose)?, translation(py, pose)))).collect()
    }

    /// Residuals (m,) at a pose moved by a left increment (6,), in pixels of boundary noise, and their derivatives (m, 6) by
    /// that increment; None where a region is out of view.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
        increment: &Bound<'py, PyAny>,
    ) -> PyResult<Option<ResidualJacobian<'py>>> {
        let (pose, increment) = (pose(rotation, translation)?, tangent(increment)?);
        let evaluation = py.detach(|| self.0.problem().evaluate_moved(&pose, &increment, Weighting::Whitened));
        evaluation.map(|evaluation| residual_jacobian(py, &evaluation)).transpose()
    }

    /// Distance from the camera to the middle of the regions.
    fn distance(&self, rotation: &Bound<'_, PyAny>, translation: &Bound<'_, PyAny>) -> PyResult<f64> {
        Ok(self.0.problem().distance(&pose(rotation, translation)?))
    }

    /// The verdict, with the minima that a driver found from the candidates; None without a pose in view.
    fn assess(&self, py: Python<'_>, minima: Vec<PyRef<'_, Minimum>>) -> PyResult<Option<Estimate>> {
        let minima = minima.iter().map(|minimum| minimum.0.clone()).collect();
        let found = detached(py, |budget| self.0.clone().assess_within(minima, budget))?;
        Ok(in_view(found).map_err(value_error)?.map(Estimate::new))
    }
}

/// The two sides of a problem, free of the interpreter.
struct Sides {
    observed: Vec<regionpose::internals::region::ObservedRegion>,
    worlds: Vec<regionpose::internals::region::WorldRegion>,
}

impl Sides {
    fn new(observed: &[PyRef<'_, ObservedRegion>], worlds: &[PyRef<'_, WorldRegion>]) -> Self {
        Self {
            observed: observed.iter().map(|region| region.0.clone()).collect(),
            worlds: worlds.iter().map(|region| region.0.clone()).collect(),
        }
    }

    fn problem(
        &self,
        system: System,
        integration: Integration,
        budget: &Budget,
    ) -> regionpose::Result<problem::Problem> {
        problem::Problem::new_within(&self.observed, &self.worlds, system, integration, budget)
    }
}

type PySides<'py> = (Vec<PyRef<'py, ObservedRegion>>, Vec<PyRef<'py, WorldRegion>>);

/// Estimates of many problems by the native solver, each with its prior, in order; None for a problem without a pose in
/// view, and what is wrong with it for one that is refused.
#[pyfunction]
#[pyo3(signature = (
    problems, priors, *, threads = None, system = "plane", integration = "boundary", mesh_size = None, start = "global",
    refine = "contour", frame_sigma = None, limits = None
))]
#[allow(clippy::too_many_arguments)]
pub fn estimate_batch<'py>(
    py: Python<'py>,
    problems: Vec<PySides<'_>>,
    priors: Vec<Option<Prior>>,
    threads: Option<&Bound<'_, PyAny>>,
    system: &str,
    integration: &str,
    mesh_size: Option<f64>,
    start: &str,
    refine: Option<&str>,
    frame_sigma: Option<[f64; 4]>,
    limits: Option<[f64; 2]>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    if problems.len() != priors.len() {
        let (found, needed) = (priors.len(), problems.len());
        return Err(PyValueError::new_err(format!(
            "priors has {found} items; it needs one for each problem, {needed}"
        )));
    }
    let threads: Option<usize> = optional("threads", threads, "a whole number of at least 1, or None")?;
    let (system, integration) = (parsed_system(system)?, parsed_integration(integration, mesh_size)?);
    let options = |prior| parsed_options(start, prior, refine, frame_sigma, limits);
    let tasks = problems
        .iter()
        .zip(priors)
        .map(|((observed, worlds), prior)| Ok((Sides::new(observed, worlds), options(prior)?)));
    let tasks: Vec<(Sides, Options)> = tasks.collect::<PyResult<_>>()?;
    let solve = |(sides, options): &(Sides, Options), budget: &Budget| {
        sides.problem(system, integration, budget)?.estimate_within(options, budget)
    };
    let results = detached_threads(py, |budget| {
        // The results of an interrupted batch are dropped.
        let solved_unless_canceled = |task: &(Sides, Options), budget: &Budget| {
            budget.poll(usize::MAX);
            if budget.is_canceled() { Err(Error::Canceled) } else { solve(task, budget) }
        };
        in_parallel_within(&tasks, threads, solved_unless_canceled, budget)
    });
    let answer = |result| match in_view(result) {
        Ok(found) => Ok(found.map(Estimate::new).into_pyobject(py)?.into_any()),
        Err(error) => Ok(error.to_string().into_pyobject(py)?.into_any()),
    };
    results?.map_err(value_error)?.into_iter().map(answer).collect()
}
