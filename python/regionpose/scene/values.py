"""Poses and warnings as plain values for JSON."""

from __future__ import annotations

from typing import Any

from regionpose.geometry.pose import Pose
from regionpose.solve.estimate import PoseEstimate
from regionpose.solve.warning import PoseWarning


def pose_values(pose: Pose, meaning: str | None = None) -> dict[str, Any]:
    """A pose as matrix, quaternion and translation (meters)."""
    values: dict[str, Any] = {} if meaning is None else {"meaning": meaning}
    values["rotation_matrix"] = pose.rotation.as_matrix()
    values["quat_xyzw"] = pose.rotation.as_quat(canonical=True)
    values["translation_m"] = pose.translation
    values["matrix"] = pose.matrix
    return values


def sigma_values(estimate: PoseEstimate) -> dict[str, Any]:
    """Standard deviations along the camera's axes."""
    return {"rotation_deg": estimate.sigma.rotation_deg, "translation_m": estimate.sigma.translation_m}


def warning_values(warning: PoseWarning, names: tuple[str, ...]) -> dict[str, Any]:
    """A warning with the names of its regions."""
    return {
        "code": warning.code.value,
        "text": warning.text_with(names),
        "advice": warning.advice,
        "regions": [names[index] for index in warning.regions],
        "values": dict(warning.values),
    }
