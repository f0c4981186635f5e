"""What is kept of one problem: errors of the pose and of the nearest answer, and all that explains them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from regionpose.geometry.pose import Pose
from regionpose.solve.estimate import PoseEstimate
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.masks import ProjectionError, project_region
from benchmarks.synthetic.measures import is_solved, overlap_error, pose_errors
from benchmarks.synthetic.studies.bounds import PoseBound
from benchmarks.synthetic.studies.conditions import CONDITION_TYPES, Condition, Value
from benchmarks.synthetic.studies.problems import StudyProblem

Array = NDArray[np.float64]
Row = dict[str, Value]

OVERLAP_TOLERANCE_PX = 0.05
"""Precision of the outlines whose overlap is measured: under 0.1 % of the area of a region of 200 px."""

AXES = ("x", "y", "z")

ANSWER_TYPES: dict[str, type] = {
    "rotation_deg": float,
    **{f"rotation_{axis}_deg": float for axis in AXES},
    "translation_m": float,
    "camera_center_m": float,
    "overlap_error": float,
    "solved": bool,
}
"""Columns of one answer against the truth."""

OUTLIER = {"outlier-region"}
"""The code of the warning that a region is wrong."""

ACCUSED = {"outlier-region", "poor-overlap"}
"""Codes of warnings that a region is not where the pose shows it."""

NAMED = {"ambiguous-region", *ACCUSED}
"""The same, and of the warning that it is not where a pose that fits alike shows it."""

NEAREST = "nearest_"
"""What the columns of the nearest answer begin with; those of the pose itself have the bare names."""

RESULT_TYPES: dict[str, type] = {
    "error": str,
    **ANSWER_TYPES,
    **{f"{NEAREST}{name}": kind for name, kind in ANSWER_TYPES.items()},
    "nearest_rank": int,
    "answers": int,
    "ambiguous": bool,
    "warnings": str,
    "input_warnings": str,
    "outlier_named": str,
    "regions_wrong": int,
    "regions_untold": int,
    "regions_accused": int,
    "confidence": float,
    "observed_overlap_error": float,
    "boundary_noise_px": float,
    **{f"sigma_rotation_{axis}_deg": float for axis in AXES},
    **{f"sigma_translation_{axis}_m": float for axis in AXES},
    "error_sigmas": float,
    "mahalanobis_squared": float,
    "bound_rotation_deg": float,
    "bound_translation_m": float,
    "converged": bool,
    "evaluations": int,
    "templates_drawn": str,
    "templates_right": str,
    "regions_given": int,
    "view_angle_deg": float,
    "image_change": float,
    "world_change": float,
    "prepare_s": float,
    "estimate_s": float,
}
"""Columns of the outcome, in order. docs/evaluation.md says what each means."""

TIMES = ("prepare_s", "estimate_s")
"""Columns that differ from run to run."""

COLUMN_TYPES: dict[str, type] = {**CONDITION_TYPES, "seed": int, **RESULT_TYPES}
"""All columns of a row, in order, and the type of each when it is not None."""


def solved_row(
    problem: StudyProblem, estimate: PoseEstimate, prepare_s: float, estimate_s: float, bound: PoseBound | None = None
) -> Row:
    """The outcome of an estimate, with the bound of its errors where that was asked for."""
    answers = [estimate.pose, *(alternative.pose for alternative in estimate.diagnostics.alternatives)]
    covariances = [estimate.covariance, *(alternative.covariance for alternative in estimate.diagnostics.alternatives)]
    rank = int(np.argmin([displacement(problem, pose) for pose in answers]))
    nearest = judged(problem, answers[rank])
    codes = [warning.code for warning in estimate.warnings]
    return {
        "error": "",
        **judged(problem, answers[0]),
        **{f"{NEAREST}{name}": value for name, value in nearest.items()},
        "nearest_rank": rank,
        "answers": len(answers),
        "ambiguous": "ambiguous-pose" in codes,
        "warnings": ";".join(codes),
        "outlier_named": outlier_named(problem, estimate),
        "regions_untold": len(set(problem.wrong) - regions_named(estimate, NAMED)),
        "regions_accused": len(regions_named(estimate, ACCUSED) - set(problem.wrong)),
        "confidence": float(estimate.confidence),
        "observed_overlap_error": float(estimate.diagnostics.overlap_error),
        "boundary_noise_px": float(estimate.diagnostics.boundary_noise_px),
        **_sigmas(estimate),
        "error_sigmas": error_sigmas(problem, estimate.pose, estimate.covariance),
        "mahalanobis_squared": mahalanobis_squared(problem, answers[rank], covariances[rank]),
        "bound_rotation_deg": None if bound is None else bound.rotation_deg,
        "bound_translation_m": None if bound is None else bound.translation_m,
        "converged": bool(estimate.diagnostics.converged),
        "evaluations": int(estimate.diagnostics.evaluations),
        **_drawn(problem),
        "prepare_s": prepare_s,
        "estimate_s": estimate_s,
    }


def outlier_named(problem: StudyProblem, estimate: PoseEstimate) -> str:
    """What the warnings say of wrong regions: "none" named, the "right" ones and no other, or any "wrong" one."""
    named = regions_named(estimate, OUTLIER)
    if not named:
        return "none"
    return "right" if named == set(problem.wrong) else "wrong"


def regions_named(estimate: PoseEstimate, codes: set[str]) -> set[int]:
    """The regions that warnings of these codes name."""
    return {region for warning in estimate.warnings if warning.code in codes for region in warning.regions}


def failed_row(error: BaseException, problem: StudyProblem | None = None) -> Row:
    """The outcome of a problem that ended in an error: its text, no errors of a pose, not solved."""
    empty: Row = {name: _NOTHING[kind] for name, kind in RESULT_TYPES.items()}
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return {**empty, "error": text, **({} if problem is None else _drawn(problem))}


_NOTHING: dict[type, Value] = {float: float("nan"), int: 0, str: "", bool: False}


def judged(problem: StudyProblem, pose: Pose) -> Row:
    """Errors of a pose; the overlap error is that of the scene's true regions, whatever disturbed the given ones."""
    scene = problem.scene
    errors = pose_errors(pose.rotation.as_matrix(), pose.translation, scene.rotation, scene.translation, scene.anchor)
    overlap = true_overlap_error(problem, pose)
    axes = zip(AXES, errors.rotation_axes_deg.tolist(), strict=True)
    return {
        "rotation_deg": errors.rotation_deg,
        **{f"rotation_{axis}_deg": value for axis, value in axes},
        "translation_m": errors.translation_m,
        "camera_center_m": errors.camera_center_m,
        "overlap_error": overlap,
        "solved": bool(is_solved(errors.rotation_deg, overlap)),
    }


def true_overlap_error(problem: StudyProblem, pose: Pose) -> float:
    """The paper's delta over the true regions' images, mean of the regions given; NaN where one is out of view."""
    scene, rotation = problem.scene, pose.rotation.as_matrix()
    shares = []
    for index in problem.kept:
        rings = scene.regions[index]
        try:
            predicted = project_region(scene.camera, rotation, pose.translation, rings, OVERLAP_TOLERANCE_PX)
        except ProjectionError:
            return float("nan")
        shares.append(overlap_error(predicted, scene.image_rings[index]))
    return float(np.mean(shares)) if shares else float("nan")


def displacement(problem: StudyProblem, pose: Pose) -> float:
    """Mean distance in meters by which a pose misplaces the vertices of the scene's regions in the camera frame."""
    scene = problem.scene
    vertices = np.concatenate([ring for rings in scene.regions for ring in rings])
    turned = vertices @ (pose.rotation.as_matrix() - scene.rotation).T
    return float(np.linalg.norm(turned + pose.translation - scene.translation, axis=1).mean())


def error_sigmas(problem: StudyProblem, pose: Pose, covariance: Array) -> float:
    """The errors of a pose's rotation and of its camera's center, each over its standard deviation in its direction:
    the larger of both.
    """
    truth = Pose(Rotation.from_matrix(problem.scene.rotation), problem.scene.translation)
    turn = (pose.rotation * truth.rotation.inv()).as_rotvec()
    # Along the camera's axes, in which the covariance's last rows are.
    shift = pose.rotation.apply(truth.camera_center - pose.camera_center)
    return max(_over_sigma(turn, covariance[:3, :3]), _over_sigma(shift, covariance[3:, 3:]))


def _over_sigma(error: Array, covariance: Array) -> float:
    if not np.isfinite(covariance).all():
        return 0.0
    squared, variance = float(error @ error), float(error @ covariance @ error)
    return squared / variance**0.5 if variance > 0.0 else float("inf")


def mahalanobis_squared(problem: StudyProblem, pose: Pose, covariance: Array) -> float:
    """Squared Mahalanobis distance of the true pose from an answer; of chi-squared distribution with 6 degrees of
    freedom when the covariance is right.

    The increment is `omega = log(R_true R^T)`, `tau = t_true - exp(omega) t`; NaN for a covariance without an inverse.
    """
    turn = Rotation.from_matrix(problem.scene.rotation) * pose.rotation.inv()
    increment = np.concatenate([turn.as_rotvec(), problem.scene.translation - turn.as_matrix() @ pose.translation])
    try:
        return float(increment @ np.linalg.solve(covariance, increment))
    except np.linalg.LinAlgError:
        return float("nan")


def _sigmas(estimate: PoseEstimate) -> Row:
    turns, shifts = estimate.sigma.rotation_deg.tolist(), estimate.sigma.translation_m.tolist()
    return {
        **{f"sigma_rotation_{axis}_deg": value for axis, value in zip(AXES, turns, strict=True)},
        **{f"sigma_translation_{axis}_m": value for axis, value in zip(AXES, shifts, strict=True)},
    }


def _drawn(problem: StudyProblem) -> Row:
    return {
        **problem.drawn,
        "templates_drawn": ";".join(problem.scene.names),
        "templates_right": ";".join(
            problem.scene.names[i] for k, i in enumerate(problem.kept) if k not in problem.wrong
        ),
        "regions_given": len(problem.kept),
        "regions_wrong": len(problem.wrong),
        "view_angle_deg": float(problem.scene.view_angles()[0]),
        "image_change": problem.image_change,
        "world_change": problem.world_change,
    }


@dataclass(frozen=True)
class Results:
    """The rows of a study, in the order of its conditions and seeds, and the settings that made them."""

    settings: Mapping[str, Any]
    rows: Sequence[Row]

    def column(self, name: str) -> NDArray[Any]:
        """(n,) values of one column."""
        if name not in COLUMN_TYPES:
            raise ValueError(f"{name!r} is no column; the columns are {', '.join(COLUMN_TYPES)}")
        return np.array([row[name] for row in self.rows])

    def where(self, **values: Value) -> Results:
        """The rows that have the values in the columns of those names."""
        return Results(self.settings, [row for row in self.rows if all(row[k] == v for k, v in values.items())])

    def values(self, name: str) -> list[Value]:
        """The different values of one column, in the order they come."""
        return list(dict.fromkeys(row[name] for row in self.rows))

    def varying(self) -> list[str]:
        """Columns of the condition with more than one value, without those that the seeds decided."""
        drawn = self.settings.get("drawn", ())
        return [name for name in CONDITION_TYPES if name not in drawn and len(self.values(name)) > 1]

    def groups(self, names: Sequence[str]) -> Iterator[tuple[dict[str, Value], Results]]:
        """The rows that share the values of the columns, with these values, in the order they come."""
        held: dict[tuple[Value, ...], list[Row]] = {}
        for row in self.rows:
            held.setdefault(tuple(row[name] for name in names), []).append(row)
        for key, rows in held.items():
            yield dict(zip(names, key, strict=True)), Results(self.settings, rows)


def whole_row(condition: Condition, seed: int, outcome: Row) -> Row:
    """The row of a problem with all columns in order."""
    held: Row = {**asdict(condition), "seed": seed, **outcome}
    return {name: held[name] for name in COLUMN_TYPES}
