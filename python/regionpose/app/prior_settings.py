"""The prior of the pose as the page edits it, and its conversion to the scene file's `prior`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from regionpose.geometry.pose import Pose
from regionpose.geometry.units import angle_text, length_text
from regionpose.validation.arrays import Array

Triple = tuple[float, float, float]

NEAR_SIGMA_M = 2.0
"""Standard deviation of the camera's place along each axis where none is given, meters, as of the scene file."""

AHEAD_SIGMA_DEG = 20.0
"""Standard deviation of the direction of view where none is given: pointing by hand is about as accurate."""

SAME_DIRECTION = 1e-6
"""Difference of two unit vectors up to which they are one: what is typed has six digits at the most."""

OF_INITIAL = ("initial", "initial_rotation_sigma_deg", "initial_center_sigma_m")


@dataclass(frozen=True)
class PriorSettings:
    """A prior, None where a part is not given: the place that the camera stands near (meters), the direction that it
    looks along and the one that is up in the photo, each with a standard deviation.

    `is_anywhere`: the camera may stand anywhere, not even near the scanner.
    """

    near: Triple | None = None
    near_sigma_m: float | None = None
    is_anywhere: bool = False
    ahead: Triple | None = None
    ahead_sigma_deg: float | None = None
    up: Triple | None = None
    up_sigma_deg: float | None = None

    @classmethod
    def of(cls, prior: Mapping[str, Any]) -> PriorSettings:
        """The settings of a scene's `prior`."""
        pose = initial_pose(prior)
        near = prior.get("camera_near")
        return cls(
            near=None if near is None else _triple(near),
            near_sigma_m=prior.get("camera_near_sigma_m"),
            is_anywhere=_is_anywhere(prior),
            ahead=None if pose is None else _triple(pose.rotation.as_matrix()[2]),
            ahead_sigma_deg=prior.get("initial_rotation_sigma_deg"),
            up=_triple(prior["up"]) if prior.get("up") is not None else None,
            up_sigma_deg=prior.get("up_sigma_deg"),
        )

    def prior(self, before: Mapping[str, Any], scanner: Array | None) -> dict[str, Any]:
        """The scene's `prior` with these settings; an earlier initial pose stays where the direction of view does.

        `scanner` (3,): where the camera stands about unless the settings differ. ValueError for what is no direction,
        and for a direction of view from no place.
        """
        values: dict[str, Any] = {}
        if self.up is not None:
            _unit("up", self.up)
            values["up"] = list(self.up)
            values |= {} if self.up_sigma_deg is None else {"up_sigma_deg": float(self.up_sigma_deg)}
        if self.is_anywhere:
            values["camera_near"] = None
        elif self.near is not None:
            values["camera_near"] = list(self.near)
        if self.near_sigma_m is not None and not self.is_anywhere:
            values["camera_near_sigma_m"] = float(self.near_sigma_m)
        return values | self._initial(before, scanner)

    def _initial(self, before: Mapping[str, Any], scanner: Array | None) -> dict[str, Any]:
        if self.ahead is None:
            return {}
        ahead, earlier = np.array(_unit("direction of view", self.ahead)), PriorSettings.of(before)
        if earlier.ahead is not None and np.abs(ahead - np.array(_unit("", earlier.ahead))).max() <= SAME_DIRECTION:
            kept = {key: before[key] for key in OF_INITIAL if key in before}
            if self.ahead_sigma_deg == earlier.ahead_sigma_deg and self.near == earlier.near:
                # The place is the initial pose's, and counts once.
                of_initial = "camera_near" in before and not earlier.is_anywhere and earlier.near is None
                return kept | ({"camera_near": None} if of_initial else {})
        place = self.near if self.near is not None else scanner
        if place is None or self.is_anywhere:
            raise ValueError("found a direction of view from nowhere; needed the place that the camera stands near")
        up = np.array([0.0, 0.0, 1.0]) if self.up is None else np.array(_unit("up", self.up))
        pose = looking(np.asarray(place, dtype=np.float64), ahead, up)
        held_values = {
            "quat_xyzw": [round(float(value), 9) for value in pose.rotation.as_quat(canonical=True)],
            "translation_m": [round(float(value), 6) for value in pose.translation],
        }
        return {
            "initial": {"camera_from_world": held_values},
            "initial_rotation_sigma_deg": float(self.ahead_sigma_deg or AHEAD_SIGMA_DEG),
            "initial_center_sigma_m": float(self.near_sigma_m or NEAR_SIGMA_M),
        }

    @property
    def text(self) -> str:
        """The settings as text, for a button."""
        parts = []
        if self.is_anywhere:
            parts.append("stands anywhere")
        elif self.near is not None or self.near_sigma_m is not None:
            where = "the scanner" if self.near is None else _written(self.near)
            parts.append(f"{length_text(self.near_sigma_m or NEAR_SIGMA_M)} about {where}")
        if self.ahead is not None:
            to = angle_text(self.ahead_sigma_deg or AHEAD_SIGMA_DEG, "°")
            parts.append(f"looks along {_written(self.ahead)} to {to}")
        if self.up is not None:
            parts.append(f"up {_written(self.up)}")
        return "; ".join(parts)


def _is_anywhere(prior: Mapping[str, Any]) -> bool:
    """Whether a scene's `prior` lets the camera stand anywhere: neither near a place nor near that of an
    initial pose.
    """
    return "camera_near" in prior and prior["camera_near"] is None and prior.get("initial_center_sigma_m") is None


def initial_pose(prior: Mapping[str, Any]) -> Pose | None:
    """The rough pose `camera_from_world` of a scene's `prior`; None where it gives none."""
    given = prior.get("initial")
    if given is None:
        return None
    ((key, item),) = given.items()
    if "matrix" in item:
        pose = Pose.from_matrix(item["matrix"])
    else:
        pose = Pose.from_quat(item["quat_xyzw"], item["translation_m"])
    return pose if key == "camera_from_world" else pose.inverse()


def looking(place: Array, ahead: Array, up: Array) -> Pose:
    """The pose `camera_from_world` of a camera at a place (3,) that looks along a unit vector (3,), a direction (3,)
    being up in its photo as far as that goes.
    """
    right = np.cross(ahead, up)
    if np.linalg.norm(right) < SAME_DIRECTION:
        right = np.cross(ahead, np.eye(3)[int(np.argmin(np.abs(ahead)))])
    right = right / np.linalg.norm(right)
    rotation = Rotation.from_matrix(np.stack([right, np.cross(ahead, right), ahead]))
    return Pose(rotation, -rotation.apply(place))


def _unit(what: str, direction: Triple) -> Triple:
    length = float(np.linalg.norm(direction))
    if not (np.isfinite(length) and length > 0.0):
        raise ValueError(f"{what}: found {list(direction)}; needed three numbers, not all 0")
    return _triple(np.asarray(direction) / length)


def _triple(values: Any) -> Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _written(values: Triple) -> str:
    return ", ".join(f"{round(value, 2):g}" for value in values)
