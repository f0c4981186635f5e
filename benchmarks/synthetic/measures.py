"""Errors of an estimated pose against the true one, and their summary over many problems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.masks import Array
from benchmarks.synthetic.planar import even_odd_shape

# deg and share: the paper's bounds (section 3) below which a problem counts as solved.
SOLVED_ROTATION_DEG = 1.0
SOLVED_OVERLAP_ERROR = 0.05


def _rotation_between(estimated: ArrayLike, true: ArrayLike) -> Rotation:
    matrices = [np.asarray(matrix, dtype=np.float64) for matrix in (estimated, true)]
    for name, matrix in zip(("estimated", "true"), matrices, strict=True):
        if matrix.shape != (3, 3):
            raise ValueError(f"{name} rotation has shape {matrix.shape}; needed is (3, 3)")
    return Rotation.from_matrix(matrices[0] @ matrices[1].T)


def rotation_error(estimated: ArrayLike, true: ArrayLike) -> float:
    """Angle of `R_est R_true^T` in degrees, 0 to 180."""
    return float(np.degrees(_rotation_between(estimated, true).magnitude()))


def rotation_errors_by_axis(estimated: ArrayLike, true: ArrayLike) -> Array:
    """(3,) rotation vector of `R_est R_true^T` in degrees: signed parts about the camera's x, y, z."""
    vector: Array = np.degrees(_rotation_between(estimated, true).as_rotvec())
    return vector


def translation_error(
    rotation: ArrayLike,
    translation: ArrayLike,
    true_rotation: ArrayLike,
    true_translation: ArrayLike,
    anchor: ArrayLike,
) -> float:
    """`|(R_est x + t_est) - (R_true x + t_true)|` in meters at the world point `anchor` = x.

    Taken at the scene it doesn't depend on where the world frame lies; at x = 0 it is `|t_est - t_true|`.
    """
    turned = (np.asarray(rotation) - np.asarray(true_rotation)) @ np.asarray(anchor, dtype=np.float64)
    return float(np.linalg.norm(turned + np.asarray(translation) - np.asarray(true_translation)))


def camera_center(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """(3,) world position `-R^T t` of the camera at the pose `camera_from_world`."""
    center: Array = -np.asarray(rotation, dtype=np.float64).T @ np.asarray(translation, dtype=np.float64)
    return center


def camera_center_error(
    rotation: ArrayLike, translation: ArrayLike, true_rotation: ArrayLike, true_translation: ArrayLike
) -> float:
    """Distance in meters between the estimated and the true position of the camera in the world."""
    return float(np.linalg.norm(camera_center(rotation, translation) - camera_center(true_rotation, true_translation)))


def overlap_error(predicted: Sequence[Array], observed: Sequence[Array]) -> float:
    """The paper's delta: area of the symmetric difference of two regions over the observed one's area.

    Both are (n, 2) rings in the same coordinates, under the even-odd rule.
    """
    observed_shape = even_odd_shape(observed)
    if not observed_shape.area > 0.0:
        raise ValueError("the observed region has no area; an overlap error needs one")
    return float(even_odd_shape(predicted).symmetric_difference(observed_shape).area / observed_shape.area)


@dataclass(frozen=True)
class PoseErrors:
    """All errors of one estimate: degrees and meters; `rotation_axes_deg` is (3,), about the camera's x, y, z."""

    rotation_deg: float
    rotation_axes_deg: Array
    translation_m: float
    camera_center_m: float


def pose_errors(
    rotation: ArrayLike,
    translation: ArrayLike,
    true_rotation: ArrayLike,
    true_translation: ArrayLike,
    anchor: ArrayLike,
) -> PoseErrors:
    """Errors of the pose `(rotation, translation)`, the translation's taken at the world point `anchor`."""
    return PoseErrors(
        rotation_error(rotation, true_rotation),
        rotation_errors_by_axis(rotation, true_rotation),
        translation_error(rotation, translation, true_rotation, true_translation, anchor),
        camera_center_error(rotation, translation, true_rotation, true_translation),
    )


def is_solved(rotation_error_deg: ArrayLike, overlap: ArrayLike) -> NDArray[np.bool_]:
    """Whether rotation error < 1 deg and overlap error < 5 %, elementwise; NaN (no estimate) is not solved."""
    solved = (np.asarray(rotation_error_deg) < SOLVED_ROTATION_DEG) & (np.asarray(overlap) < SOLVED_OVERLAP_ERROR)
    return np.asarray(solved, dtype=np.bool_)


@dataclass(frozen=True)
class Summary:
    """Quantiles of an error over many problems, in the error's unit."""

    count: int
    lower_quartile: float
    median: float
    upper_quartile: float
    percentile_95: float


def summarize(errors: ArrayLike) -> Summary:
    """Quartiles, median and 95th percentile of (n,) errors; NaN (no estimate) counts as infinitely wrong."""
    values = np.asarray(errors, dtype=np.float64)
    if values.ndim != 1 or len(values) == 0:
        raise ValueError(f"errors have shape {values.shape}; needed is (n,) with n >= 1")
    values = np.where(np.isnan(values), np.inf, values)
    return Summary(len(values), *(_percentile(values, percent) for percent in (25.0, 50.0, 75.0, 95.0)))


def _percentile(values: Array, percent: float) -> float:
    """Linear percentile, infinite as soon as one of the two values it lies between is."""
    if np.isinf(np.percentile(values, percent, method="higher")):
        return float("inf")
    return float(np.percentile(np.where(np.isinf(values), np.finfo(np.float64).max, values), percent))


def solved_share(solved: ArrayLike) -> float:
    """Share in [0, 1] of (n,) problems that were solved."""
    flags = np.asarray(solved, dtype=np.bool_)
    if flags.ndim != 1 or len(flags) == 0:
        raise ValueError(f"solved flags have shape {flags.shape}; needed is (n,) with n >= 1")
    return float(flags.mean())
