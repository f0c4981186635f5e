//! Problems and what comes of them.

use nalgebra::{UnitQuaternion, Vector3};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use regionpose::batch::in_parallel;
use regionpose::equations::facet::Integration;
use regionpose::equations::least_squares;
use regionpose::equations::system::{System, Weighting};
use regionpose::geometry::pose::Tangent;
use regionpose::prior::{PoseSigma, Prior};
use regionpose::search::candidates::{self, Start};
use regionpose::verdict::estimate::{self, Refinement};

use crate::arrays::{matrix, numbers, optional, pose, rotation, scalar, translation, value_error, vector};
use crate::regions::{ObservedRegion, WorldRegion};

fn unknown(option: &str, found: &str, needed: &str) -> PyErr {
    PyValueError::new_err(format!("{option} is {found:?}; it needs to be {needed}"))
}

fn parsed_system(name: &str) -> PyResult<System> {
    match name {
        "plane" => Ok(System::Plane),
        "sphere" => Ok(System::Sphere),
        other => Err(unknown("system", other, "\"plane\" or \"sphere\"")),
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
        (other, _) => Err(unknown("integration", other, "\"boundary\", \"mesh\" or \"pixels\"")),
    }
}

fn parsed_start(name: &str) -> PyResult<Start> {
    match name {
        "global" => Ok(Start::Global),
        "paper" => Ok(Start::Paper),
        other => Err(unknown("start", other, "\"global\" or \"paper\"")),
    }
}

fn parsed_refinement(name: Option<&str>) -> PyResult<Refinement> {
    match name {
        None => Ok(Refinement::Off),
        Some("contour") => Ok(Refinement::Contour),
        Some(other) => Err(unknown("refine", other, "\"contour\" or None")),
    }
}

type ResidualJacobian<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

type RotationTranslation<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

type PoseArrays<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

/// The prior of a dictionary that may hold `initial`, `initial_sigma`, `up` and `up_sigma`, deviations in degrees and metres.
fn parsed_prior(given: Option<&Bound<'_, PyDict>>) -> PyResult<Prior> {
    let part = |name: &str| -> PyResult<Option<Bound<'_, PyAny>>> {
        let value = given.map_or(Ok(None), |given| given.get_item(name))?;
        Ok(value.filter(|value| !value.is_none()))
    };
    let initial: Option<PoseArrays<'_>> = part("initial")?.map(|value| value.extract()).transpose()?;
    let initial = initial.map(|(rotation, translation)| pose(&rotation, &translation)).transpose()?;
    let up: Option<Vector3<f64>> = part("up")?.map(|up| vector("up", &up)).transpose()?;
    if up.is_some_and(|up| up.norm() == 0.0) {
        return Err(PyValueError::new_err("up is a zero vector; it needs to be a direction"));
    }
    let initial_sigma = part("initial_sigma")?.map(|sigma| pose_sigma(&sigma)).transpose()?;
    let up_sigma = part("up_sigma")?.map(|sigma| deviation("up_sigma", &sigma).map(f64::to_radians)).transpose()?;
    Ok(Prior { initial, initial_sigma, up, up_sigma })
}

fn pose_sigma(given: &Bound<'_, PyAny>) -> PyResult<PoseSigma> {
    let values = numbers("initial_sigma", given)?;
    let [degrees, place] = values[..] else {
        let found = values.len();
        let needed = "(degrees, metres)";
        return Err(PyValueError::new_err(format!("initial_sigma has {found} entries; it needs to be {needed}")));
    };
    for value in [degrees, place] {
        check_deviation("initial_sigma", value)?;
    }
    Ok(PoseSigma { rotation: degrees.to_radians(), place })
}

fn deviation(item: &str, given: &Bound<'_, PyAny>) -> PyResult<f64> {
    let value = scalar(item, given, "a positive number of degrees")?;
    check_deviation(item, value)?;
    Ok(value)
}

fn check_deviation(item: &str, value: f64) -> PyResult<()> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{item} holds {value}; it needs positive numbers")))
}

/// Where a least squares ended.
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
        Ok(Self(least_squares::Minimum { pose, cost, converged, termination, evaluations }))
    }

    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rotation(py, &self.0.pose)
    }

    /// The same rotation as x, y, z, w, (4,).
    #[getter]
    fn quaternion<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let quaternion = UnitQuaternion::from_rotation_matrix(&self.0.pose.rotation);
        PyArray1::from_slice(py, quaternion.coords.as_slice())
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
    fn termination(&self) -> &str {
        &self.0.termination
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.0.evaluations
    }
}

/// A minimum and its overlap errors.
#[pyclass(frozen, module = "regionpose._core")]
#[derive(Clone)]
pub struct Solution(estimate::Solution);

#[pymethods]
impl Solution {
    #[getter]
    fn minimum(&self) -> Minimum {
        Minimum(self.0.minimum.clone())
    }

    #[getter]
    fn overlap_error(&self) -> f64 {
        self.0.overlap_error
    }

    #[getter]
    fn region_overlap_errors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.region_overlap_errors)
    }

    #[getter]
    fn confidence(&self) -> f64 {
        self.0.confidence
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, self.0.covariance.iter().copied().collect(), [6, 6])
    }
}

/// The pose of a camera, and what is known of it.
#[pyclass(frozen, module = "regionpose._core")]
#[derive(Clone)]
pub struct Estimate(estimate::Estimate);

#[pymethods]
impl Estimate {
    #[getter]
    fn best(&self) -> Solution {
        Solution(self.0.best.clone())
    }

    #[getter]
    fn boundary_noise(&self) -> f64 {
        self.0.boundary_noise
    }

    /// Share of the contour that is disturbed, a fraction; None where the pose is that of the moments.
    #[getter]
    fn disturbed_share(&self) -> Option<f64> {
        self.0.best.contour.as_ref().map(|fit| fit.mixture.disturbed)
    }

    /// What the confidence is computed from, (6,).
    #[getter]
    fn evidence<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.0.evidence.features())
    }

    #[getter]
    fn alternatives(&self) -> Vec<Solution> {
        self.0.alternatives.iter().cloned().map(Solution).collect()
    }

    /// (code, sentence) of each warning.
    #[getter]
    fn warnings(&self) -> Vec<(&'static str, String)> {
        self.0.warnings.iter().map(|warning| (warning.code(), warning.to_string())).collect()
    }

    #[getter]
    fn evaluations(&self) -> usize {
        self.0.evaluations
    }
}

/// Regions seen in one image and known in the world, ready to be solved.
#[pyclass(frozen, module = "regionpose._core")]
pub struct Problem(candidates::Problem);

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
        py.detach(|| sides.problem(system, integration)).map(Self).map_err(value_error)
    }

    /// This problem whitened for the boundary noise that it shows, and poses (rotation (3, 3), translation (3,)) from which
    /// to solve it, best first.
    #[pyo3(signature = (*, start = "global", prior = None))]
    fn search<'py>(
        &self,
        py: Python<'py>,
        start: &str,
        prior: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<(Problem, Vec<RotationTranslation<'py>>)> {
        let (start, prior) = (parsed_start(start)?, parsed_prior(prior)?);
        let search = py.detach(|| self.0.clone().search(start, &prior));
        let poses = search.candidates.iter().map(|pose| Ok((rotation(py, pose)?, translation(py, pose))));
        Ok((Problem(search.problem), poses.collect::<PyResult<_>>()?))
    }

    /// Residuals (m,) at a pose moved by a left increment (6,), and their derivatives (m, 6) by that increment; None
    /// where a region is out of view.
    #[pyo3(signature = (rotation, translation, *, increment = None, whitened = true))]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        rotation: &Bound<'py, PyAny>,
        translation: &Bound<'py, PyAny>,
        increment: Option<&Bound<'py, PyAny>>,
        whitened: bool,
    ) -> PyResult<Option<ResidualJacobian<'py>>> {
        let pose = pose(rotation, translation)?;
        let weighting = if whitened { Weighting::Whitened } else { Weighting::Uniform };
        let increment = increment.map_or(Ok(Tangent::zeros()), tangent)?;
        let Some(evaluation) = py.detach(|| self.0.evaluate_moved(&pose, &increment, weighting)) else {
            return Ok(None);
        };
        let rows = evaluation.residual.len();
        let jacobian = matrix(py, evaluation.jacobian.transpose().iter().copied().collect(), [rows, 6])?;
        Ok(Some((PyArray1::from_slice(py, evaluation.residual.as_slice()), jacobian)))
    }

    /// Distance from the camera to the middle of the regions.
    fn distance(&self, rotation: &Bound<'_, PyAny>, translation: &Bound<'_, PyAny>) -> PyResult<f64> {
        Ok(self.0.distance(&pose(rotation, translation)?))
    }

    /// The estimate by the native driver; None without a pose in view.
    #[pyo3(signature = (*, start = "global", prior = None, refine = "contour"))]
    fn estimate<'py>(
        &self,
        py: Python<'py>,
        start: &str,
        prior: Option<&Bound<'py, PyDict>>,
        refine: Option<&str>,
    ) -> PyResult<Option<Estimate>> {
        let (start, prior) = (parsed_start(start)?, parsed_prior(prior)?);
        let refinement = parsed_refinement(refine)?;
        Ok(py.detach(|| self.0.clone().estimate(start, &prior, refinement)).map(Estimate))
    }

    /// The verdict on minima found by any driver; None without one.
    #[pyo3(signature = (minima, *, prior = None, refine = "contour"))]
    fn judged(
        &self,
        py: Python<'_>,
        minima: Vec<PyRef<'_, Minimum>>,
        prior: Option<&Bound<'_, PyDict>>,
        refine: Option<&str>,
    ) -> PyResult<Option<Estimate>> {
        let (prior, refinement) = (parsed_prior(prior)?, parsed_refinement(refine)?);
        let minima = minima.iter().map(|minimum| minimum.0.clone()).collect();
        Ok(py.detach(|| self.0.judged(minima, &prior, refinement)).map(Estimate))
    }
}

/// Rotation (3, 3) and translation (3,) of a pose moved by a left increment (6,).
#[pyfunction]
pub fn moved_pose<'py>(
    py: Python<'py>,
    rotation: &Bound<'py, PyAny>,
    translation: &Bound<'py, PyAny>,
    increment: &Bound<'py, PyAny>,
) -> PyResult<RotationTranslation<'py>> {
    let moved = pose(rotation, translation)?.moved(&tangent(increment)?);
    Ok((self::rotation(py, &moved)?, self::translation(py, &moved)))
}

fn tangent(increment: &Bound<'_, PyAny>) -> PyResult<Tangent> {
    let values = numbers("increment", increment)?;
    if values.len() != 6 {
        return Err(PyValueError::new_err(format!("increment has {} entries; it needs to have 6", values.len())));
    }
    Ok(Tangent::from_column_slice(&values))
}

/// The two sides of a problem, free of the interpreter.
struct Sides {
    observed: Vec<regionpose::region::ObservedRegion>,
    worlds: Vec<regionpose::region::WorldRegion>,
}

impl Sides {
    fn new(observed: &[PyRef<'_, ObservedRegion>], worlds: &[PyRef<'_, WorldRegion>]) -> Self {
        Self {
            observed: observed.iter().map(|region| region.0.clone()).collect(),
            worlds: worlds.iter().map(|region| region.0.clone()).collect(),
        }
    }

    fn problem(&self, system: System, integration: Integration) -> regionpose::error::Result<candidates::Problem> {
        candidates::Problem::new(&self.observed, self.worlds.clone(), system, integration)
    }
}

type PySides<'py> = (Vec<PyRef<'py, ObservedRegion>>, Vec<PyRef<'py, WorldRegion>>);

/// Estimates of many problems by the native solver, in order; None for a problem without a pose in view.
#[pyfunction]
#[pyo3(signature = (problems, *, threads = None, system = "plane", integration = "boundary", refine = "contour"))]
pub fn estimate_batch(
    py: Python<'_>,
    problems: Vec<PySides<'_>>,
    threads: Option<&Bound<'_, PyAny>>,
    system: &str,
    integration: &str,
    refine: Option<&str>,
) -> PyResult<Vec<Option<Estimate>>> {
    let (system, integration) = (parsed_system(system)?, parsed_integration(integration, None)?);
    let refinement = parsed_refinement(refine)?;
    let threads: Option<usize> = optional("threads", threads, "a whole number of at least 1, or None")?;
    let sides: Vec<Sides> = problems.iter().map(|(observed, worlds)| Sides::new(observed, worlds)).collect();
    let solve = |sides: &Sides| {
        sides.problem(system, integration).map(|problem| problem.estimate(Start::Global, &Prior::default(), refinement))
    };
    let results = py.detach(|| in_parallel(&sides, threads, solve)).map_err(value_error)?;
    let named = |(index, result): (usize, regionpose::error::Result<_>)| match result {
        Ok(estimate) => Ok(Option::map(estimate, Estimate)),
        Err(error) => Err(PyValueError::new_err(format!("problem {index}: {error}"))),
    };
    results.into_iter().enumerate().map(named).collect()
}
