"""Cameras read from the calibration files that other tools write."""

from __future__ import annotations

from regionpose.calibration.kinds import load_camera
from regionpose.calibration.kitti import load_lidar_pose
from regionpose.calibration.text import CalibrationError

__all__ = ["CalibrationError", "load_camera", "load_lidar_pose"]
