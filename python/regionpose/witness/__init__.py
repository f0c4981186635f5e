"""The rest of a scene as witness of a pose: how well cloud and photo agree where no region is."""

from regionpose.witness.alignment import Alignment
from regionpose.witness.answers import SceneWitness, Witnessed, witnessed
from regionpose.witness.estimate import estimate_with_scene, refined_estimate
from regionpose.witness.focal import FocalEvidence
from regionpose.witness.focal_curve import Estimated
from regionpose.witness.frame import SceneFrame, check_alignment
from regionpose.witness.odds import weighed
from regionpose.witness.photo import Photo
from regionpose.witness.refinement import SceneRefinement, refine_with_scene
from regionpose.witness.visibility import Occlusion

__all__ = [
    "Alignment",
    "Estimated",
    "FocalEvidence",
    "Occlusion",
    "Photo",
    "SceneFrame",
    "SceneRefinement",
    "SceneWitness",
    "Witnessed",
    "check_alignment",
    "estimate_with_scene",
    "refine_with_scene",
    "refined_estimate",
    "weighed",
    "witnessed",
]
