"""Absolute pose of a central camera from planar regions, without correspondences."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from regionpose._core import __version__

if TYPE_CHECKING:
    from regionpose._core import alpha_shape, planar_moments, spherical_moments, triangulate
    from regionpose.calibration import load_camera
    from regionpose.cameras import FisheyeCamera, OcamCamera, PinholeCamera, UnifiedCamera
    from regionpose.pose import Pose
    from regionpose.regions import ImageRegion, WorldRegion
    from regionpose.solver import (
        Alternative,
        PoseError,
        PoseEstimate,
        PoseWarning,
        estimate_pose,
        estimate_poses,
    )

__all__ = [
    "Alternative",
    "FisheyeCamera",
    "ImageRegion",
    "OcamCamera",
    "PinholeCamera",
    "Pose",
    "PoseError",
    "PoseEstimate",
    "PoseWarning",
    "UnifiedCamera",
    "WorldRegion",
    "__version__",
    "alpha_shape",
    "estimate_pose",
    "estimate_poses",
    "load_camera",
    "planar_moments",
    "spherical_moments",
    "triangulate",
]

_MODULES = {
    "_core": ("alpha_shape", "planar_moments", "spherical_moments", "triangulate"),
    "calibration": ("load_camera",),
    "cameras": ("FisheyeCamera", "OcamCamera", "PinholeCamera", "UnifiedCamera"),
    "pose": ("Pose",),
    "regions": ("ImageRegion", "WorldRegion"),
    "solver": ("Alternative", "PoseError", "PoseEstimate", "PoseWarning", "estimate_pose", "estimate_poses"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    """The public name, loaded from its module when first used: scipy alone would take half a second of every
    command.
    """
    if name in _HOMES:
        value: object = getattr(importlib.import_module(f"regionpose.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    if name in _MODULES:
        return importlib.import_module(f"regionpose.{name}")
    raise AttributeError(f"module 'regionpose' has no attribute {name!r}")


def __dir__() -> list[str]:
    """The public names."""
    return sorted(__all__)
