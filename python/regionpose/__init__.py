"""Absolute pose of a central camera from planar regions, without correspondences."""

from regionpose._core import __version__, alpha_shape, planar_moments, spherical_moments, triangulate
from regionpose.calibration import load_camera
from regionpose.cameras import FisheyeCamera, OcamCamera, PinholeCamera, UnifiedCamera
from regionpose.pose import Pose
from regionpose.regions import ImageRegion, WorldRegion
from regionpose.segmentation.cloud import grow_plane
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
    "grow_plane",
    "load_camera",
    "planar_moments",
    "spherical_moments",
    "triangulate",
]
