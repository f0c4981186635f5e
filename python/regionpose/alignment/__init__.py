"""Alignment of clouds with photos by their edges: poses from nothing else or with regions, and how well both agree at a
pose.
"""

from regionpose.alignment.agreement import Alignment, check_alignment
from regionpose.alignment.calibration import Calibration, calibrate, calibrate_with
from regionpose.alignment.focal import FocalEvidence
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.photo import Photo
from regionpose.alignment.pose_search import EdgeMode
from regionpose.alignment.region_evidence import RegionEvidence
from regionpose.alignment.visibility import Occlusion

__all__ = [
    "Alignment",
    "Calibration",
    "EdgeMode",
    "FocalEvidence",
    "Occlusion",
    "Photo",
    "RegionEvidence",
    "SceneFrame",
    "calibrate",
    "calibrate_with",
    "check_alignment",
]
