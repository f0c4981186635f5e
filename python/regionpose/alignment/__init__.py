"""Alignment of clouds with photos by their edges: poses from nothing else, and how well the two agree at a pose."""

from regionpose.alignment.agreement import Alignment
from regionpose.alignment.answers import SceneWitness, Witnessed, witnessed
from regionpose.alignment.calibration import Calibration, calibrate
from regionpose.alignment.estimate import estimate_with_scene, refined_estimate
from regionpose.alignment.focal import FocalEvidence
from regionpose.alignment.focal_curve import Estimated
from regionpose.alignment.frame import SceneFrame, check_alignment
from regionpose.alignment.odds import weighed
from regionpose.alignment.photo import Photo
from regionpose.alignment.pose_search import EdgeMode
from regionpose.alignment.refinement import SceneRefinement, refine_with_scene
from regionpose.alignment.visibility import Occlusion

__all__ = [
    "Alignment",
    "Calibration",
    "EdgeMode",
    "Estimated",
    "FocalEvidence",
    "Occlusion",
    "Photo",
    "SceneFrame",
    "SceneRefinement",
    "SceneWitness",
    "Witnessed",
    "calibrate",
    "check_alignment",
    "estimate_with_scene",
    "refine_with_scene",
    "refined_estimate",
    "weighed",
    "witnessed",
]
