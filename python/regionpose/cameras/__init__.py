"""Central cameras: maps between pixels and bearings.

Pixels are OpenCV's: the integer (0, 0) is the center of the first pixel, x right, y down. Camera axes are x right,
y down, z along the optical axis.
"""

from __future__ import annotations

from regionpose.cameras.base import Camera
from regionpose.cameras.colmap import camera_from_colmap, camera_to_colmap
from regionpose.cameras.equirectangular import EquirectangularCamera
from regionpose.cameras.fisheye import FisheyeCamera
from regionpose.cameras.fov import FovCamera
from regionpose.cameras.ocam import OcamCamera
from regionpose.cameras.pinhole import PinholeCamera
from regionpose.cameras.unified import UnifiedCamera

__all__ = [
    "Camera",
    "EquirectangularCamera",
    "FisheyeCamera",
    "FovCamera",
    "OcamCamera",
    "PinholeCamera",
    "UnifiedCamera",
    "camera_from_colmap",
    "camera_to_colmap",
]
