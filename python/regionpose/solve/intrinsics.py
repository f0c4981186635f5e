"""A camera's focal lengths, center and distortion refined together with the pose, on the observed contours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import chdtri

from regionpose import _core
from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera
from regionpose.geometry.pose import Pose
from regionpose.solve.contours import (
    Contours,
    Distances,
    correlation_length,
    distance_derivatives,
    distances_of,
    neighbor_scatter,
    outline_derivatives,
    robust_sigma,
)
from regionpose.solve.rig_diagnostics import CameraRefinement, Outcome

Array = NDArray[np.float64]
CameraPart = Literal["focal", "center", "distortion"]
RefinableCamera = PinholeCamera | FisheyeCamera

PARAMETERS: dict[str, tuple[str, ...]] = {"focal": ("fx", "fy"), "center": ("cx", "cy"), "distortion": ("k1", "k2")}
"""What each part of a camera consists of."""

WEAK_FRACTION = 0.005
"""Fraction of the focal length: a parameter whose standard deviation moves the image by more isn't determined.

A focal length moves a point at 45 degrees by that fraction, the center all points, a distortion the outermost visible
vertex. Half a percent is what a camera's data sheet is good for.
"""

CONFIRMED_PROBABILITY = 0.99
"""A change of the camera that noise alone exceeds in one case of a hundred is taken for a change."""

CAUCHY_WIDTH = 2.385
"""Width of the Cauchy loss over the distances' standard deviation: 95 % efficient (Holland, Welsch 1977)."""

FINEST_SIGMA_PX = 0.05
"""Scale below which distances (pixels) aren't distinguished: exact coverage scatters by so much at corners."""

ROUNDS = 8
"""Most estimates of the scale of the loss."""

CONVERGED_SCALE = 0.98
"""Ratio of successive scales above which the scale has converged."""

TOLERANCE = 1e-10
"""Relative change of cost and variables at which the least squares stops."""

MOST_EVALUATIONS = 60
"""Evaluations of the distances in one round at most."""

OUT_OF_VIEW_PX = 1e6
"""Distance where a region leaves the view or the camera is none, so that the step there is refused."""

SMALLEST_SINGULAR = 1e-12
"""Least singular value of the scaled Jacobian, a fraction of the largest, so that a free direction stays finite."""


def parameter_names(camera: Camera, parts: Sequence[str]) -> tuple[str, ...]:
    """The names of a camera's parameters; ValueError for an unknown part, a part twice or a camera that has none."""
    if isinstance(parts, str):
        raise ValueError(f'refine_camera is {parts!r}; needed a sequence, as ("{parts}",)')
    for part in parts:
        if part not in PARAMETERS:
            raise ValueError(f"refine_camera holds {part!r}; needed some of {', '.join(map(repr, PARAMETERS))}")
    if len(set(parts)) < len(parts):
        raise ValueError(f"refine_camera is {tuple(parts)!r}; needed each part once")
    if parts and not isinstance(camera, RefinableCamera):
        raise ValueError(f"camera is a {type(camera).__name__}; a PinholeCamera or a FisheyeCamera can be refined")
    return tuple(name for part in PARAMETERS if part in parts for name in PARAMETERS[part])


def refined_camera(camera: Camera, pose: Pose, contours: Contours, parts: Sequence[str]) -> CameraRefinement:
    """The camera and the pose at which the projected outlines of all contours fall on the observed ones.

    The distances of the contours (docs/math.md, section 12) are minimized under a Cauchy loss whose scale follows their
    median, by scipy's trust region, over the increment of the pose and the parameters of `parts`. A parameter that
    stays vaguer than `WEAK_FRACTION` makes the refinement "weak", and so does an outline that isn't wholly visible at
    the pose. ValueError as of `parameter_names`.
    """
    problem = ContourProblem(camera, pose, contours, parameter_names(camera, parts))
    start = np.zeros(len(problem.unit))
    before = problem.distances(start)
    if before is None:
        return problem.refinement(start, np.full((len(start),) * 2, np.inf), (np.nan, np.nan))
    found, sigma = _solved(problem, start, robust_sigma(before.values))
    return problem.refinement(found, problem.covariance(found), (robust_sigma(before.values), sigma))


def _solved(problem: ContourProblem, start: Array, first_sigma: float) -> tuple[Array, float]:
    """Variables at the least robust cost, and the distances' robust standard deviation there."""
    at, sigma = start, max(first_sigma, FINEST_SIGMA_PX)
    for _ in range(ROUNDS):
        result = least_squares(
            problem.residual,
            at,
            jac=problem.jacobian,
            loss="cauchy",
            f_scale=CAUCHY_WIDTH * sigma,
            x_scale="jac",
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            gtol=TOLERANCE,
            max_nfev=MOST_EVALUATIONS,
        )
        at, before = result.x, sigma
        sigma = max(robust_sigma(problem.residual(at)), FINEST_SIGMA_PX)
        if sigma > CONVERGED_SCALE * before:
            break
    return at, sigma


class ContourProblem:
    """Distances of contours as functions of `[omega, tau, parameters]`, counted from zero in units.

    The units are a radian, the distance to the regions, the focal length for itself and the center, and one for a
    coefficient of distortion. Without names of parameters any camera will do.
    """

    def __init__(self, camera: Camera, pose: Pose, contours: Contours, names: tuple[str, ...] = ()) -> None:
        """Take the camera, the pose and the parameters to count from."""
        self._camera, self._pose, self._contours, self._names = camera, pose, contours, names
        distance = float(np.linalg.norm(pose.transform(contours.vertices.mean(axis=0))))
        self._given = {name: _parameters(camera)[name] for name in names}
        self._focal = _parameters(camera)["fx"] if names else 1.0
        lenses = [name in PARAMETERS["distortion"] for name in names]
        self.unit = np.concatenate([np.ones(3), np.full(3, distance), np.where(lenses, 1.0, self._focal)])

    def view(self, at: Array) -> tuple[Camera, Pose]:
        """Camera and pose at the variables."""
        pose = _core.retract_pose(self._pose.rotation.as_matrix(), self._pose.translation, (self.unit * at)[:6])
        return _with_parameters(self._camera, self._names, self.values(at)), Pose.from_parts(*pose)

    def values(self, at: Array) -> Array:
        """The parameters at the variables, in their own units."""
        return np.array(list(self._given.values())) + (self.unit * at)[6:]

    def distances(self, at: Array) -> Distances | None:
        """Distances of all contours; None out of view or where the parameters make no camera."""
        try:
            camera, pose = self.view(at)
            return distances_of(camera, self._contours, pose)
        except ValueError:
            return None

    def residual(self, at: Array) -> Array:
        """Distances (m,), pixels, large where there are none."""
        distances = self.distances(at)
        return np.full(len(self._contours.pieces), OUT_OF_VIEW_PX) if distances is None else distances.values

    def jacobian(self, at: Array) -> Array:
        """Derivatives (m, 6 + p) of the distances by the variables."""
        distances = self.distances(at)
        if distances is None:
            return np.zeros((len(self._contours.pieces), len(at)))
        return distance_derivatives(self._contours, distances, outline_derivatives(self.view, at, self._contours))

    def covariance(self, at: Array) -> Array:
        """Covariance (6 + p, 6 + p) of the variables of a robust loss (docs/math.md, eq. 12.3 and 12.4).

        `H^-1 (S + S') H^-1`, `H = E[psi'] J^T J` (Huber 1981): S from all distances alike, `c E[psi^2] J^T J` with
        their correlation length c, and S' from what neighbors on a contour have in common where they lie.
        """
        distances, jacobian = self.residual(at), self.jacobian(at)
        square = (distances / (CAUCHY_WIDTH * max(robust_sigma(distances), FINEST_SIGMA_PX))) ** 2
        influence = distances / (1.0 + square)
        slope = float(np.mean((1.0 - square) / (1.0 + square) ** 2))
        correlated = correlation_length(self._contours.by_ring(influence))
        inverse = _inverse_normal(jacobian) / slope
        alike = correlated * float(np.mean(influence**2)) / slope * inverse
        neighbors = neighbor_scatter(self._contours.by_ring(influence[:, None] * (jacobian @ inverse)))
        independent = len(distances) / correlated
        return (alike + neighbors) * independent / max(independent - len(at), 1.0)

    def refinement(self, at: Array, covariance: Array, residual_px: tuple[float, float]) -> CameraRefinement:
        """What the variables found and their covariance make of the camera."""
        weak = self._weak(at, np.sqrt(np.diag(covariance)[6:]))
        outcome: Outcome = "weak" if weak else "confirmed" if _is_noise(at[6:], covariance[6:, 6:]) else "refined"
        camera, pose = self.view(at) if outcome == "refined" else (self._camera, self._pose)
        return CameraRefinement(
            camera=camera,
            pose=pose,
            outcome=outcome,
            parameters=self._names,
            given=self.values(np.zeros_like(at)),
            found=self.values(at),
            covariance=covariance * np.outer(self.unit, self.unit),
            weak=weak,
            residual_px=residual_px,
        )

    def _weak(self, at: Array, sigma: Array) -> tuple[str, ...]:
        """Names of the parameters that move the image by more than `WEAK_FRACTION` within a standard deviation.

        All, where the camera would see no ray at an observed piece.
        """
        camera, _ = self.view(at)
        if not (np.isfinite(sigma).all() and np.isfinite(camera.bearings(self._contours.pieces)).all()):
            return self._names
        motion = np.linalg.norm(outline_derivatives(self.view, at, self._contours)[:, :, 6:], axis=1).max(axis=0)
        lenses = [name in PARAMETERS["distortion"] for name in self._names]
        fractions = sigma * np.where(lenses, motion / self._focal, 1.0)
        return tuple(
            name for name, fraction in zip(self._names, fractions, strict=True) if not fraction <= WEAK_FRACTION
        )


def _is_noise(shift: Array, covariance: Array) -> bool:
    """Whether a change of the parameters is one that their noise makes."""
    return bool(shift @ np.linalg.solve(covariance, shift) < chdtri(len(shift), 1.0 - CONFIRMED_PROBABILITY))


def _inverse_normal(jacobian: Array) -> Array:
    """`(J^T J)^-1` by the singular values of J with columns of unit length; large along a direction left free."""
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), np.finfo(float).tiny)
    _, singular, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    spread = rows / np.maximum(singular, SMALLEST_SINGULAR * singular[0])[:, None] / scale
    inverse: Array = spread.T @ spread
    return inverse


def _coefficients(camera: Camera) -> tuple[float, ...]:
    """Coefficients of distortion, of which the first two are k1 and k2."""
    if isinstance(camera, FisheyeCamera):
        return camera.distortion
    assert isinstance(camera, PinholeCamera)
    return camera.distortion or (0.0,) * 4


def _parameters(camera: Camera) -> dict[str, float]:
    assert isinstance(camera, RefinableCamera)
    k1, k2, *_ = _coefficients(camera)
    return {"fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy, "k1": k1, "k2": k2}


def _with_parameters(camera: Camera, names: Sequence[str], values: Array) -> Camera:
    """The camera with other values of some parameters."""
    if not names:
        return camera
    assert isinstance(camera, RefinableCamera)
    changed = _parameters(camera) | dict(zip(names, values.tolist(), strict=True))
    lens = {name: changed[name] for name in ("fx", "fy", "cx", "cy")}
    if not set(names) & set(PARAMETERS["distortion"]):
        return replace(camera, **lens)
    coefficients = (changed["k1"], changed["k2"], *_coefficients(camera)[2:])
    return replace(camera, **lens, distortion=coefficients)
