"""Cameras read from the calibration files that other tools write."""

from __future__ import annotations

from regionpose.io.calibrations.kinds import load_camera
from regionpose.io.calibrations.kitti import load_lidar_pose
from regionpose.io.calibrations.text import CalibrationError

__all__ = ["CalibrationError", "load_camera", "load_lidar_pose"]
