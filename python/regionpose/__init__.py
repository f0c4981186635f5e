"""Absolute pose of a central camera from planar regions, without correspondences."""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING

from regionpose._core import __version__

if TYPE_CHECKING:
    from regionpose._core import alpha_shape, planar_moments, spherical_moments, triangulate
    from regionpose.calibration import load_camera
    from regionpose.cameras import FisheyeCamera, OcamCamera, PinholeCamera, UnifiedCamera
    from regionpose.drawing import overlay_depth, overlay_regions
    from regionpose.fusion import blend_colors, colorize
    from regionpose.image_region import ImageRegion
    from regionpose.intrinsics import CameraRefinement
    from regionpose.mask import MaskWindow
    from regionpose.matching import RegionMatches, match_regions
    from regionpose.pose import Pose
    from regionpose.prior import Prior
    from regionpose.rig import Frame, FrameFit, Influence, RigEstimate, estimate_rig
    from regionpose.sanity import check_camera, check_regions
    from regionpose.segmentation.cloud import grow_plane
    from regionpose.segmentation.image import grow_image_region
    from regionpose.segmentation.masks import (
        mask_from_file,
        masks_from_file,
        masks_from_segmenter,
        region_from_file,
        regions_from_file,
    )
    from regionpose.segmentation.planes import find_planes
    from regionpose.solver import (
        Alternative,
        Crease,
        PoseError,
        PoseEstimate,
        PoseWarning,
        estimate_pose,
        estimate_poses,
    )
    from regionpose.witness import Alignment, SceneFrame, SceneRefinement, check_alignment, refine_with_scene
    from regionpose.world_region import WorldRegion

__all__ = [
    "Alignment",
    "Alternative",
    "CameraRefinement",
    "Crease",
    "FisheyeCamera",
    "Frame",
    "FrameFit",
    "ImageRegion",
    "Influence",
    "MaskWindow",
    "OcamCamera",
    "PinholeCamera",
    "Pose",
    "PoseError",
    "PoseEstimate",
    "PoseWarning",
    "Prior",
    "RegionMatches",
    "RigEstimate",
    "SceneFrame",
    "SceneRefinement",
    "UnifiedCamera",
    "WorldRegion",
    "__version__",
    "alpha_shape",
    "blend_colors",
    "check_alignment",
    "check_camera",
    "check_regions",
    "colorize",
    "estimate_pose",
    "estimate_poses",
    "estimate_rig",
    "find_planes",
    "grow_image_region",
    "grow_plane",
    "load_camera",
    "mask_from_file",
    "masks_from_file",
    "masks_from_segmenter",
    "match_regions",
    "overlay_depth",
    "overlay_regions",
    "planar_moments",
    "refine_with_scene",
    "region_from_file",
    "regions_from_file",
    "spherical_moments",
    "triangulate",
]

_MODULES = {
    "_core": ("alpha_shape", "planar_moments", "spherical_moments", "triangulate"),
    "calibration": ("load_camera",),
    "cameras": ("FisheyeCamera", "OcamCamera", "PinholeCamera", "UnifiedCamera"),
    "drawing": ("overlay_depth", "overlay_regions"),
    "fusion": ("blend_colors", "colorize"),
    "image_region": ("ImageRegion",),
    "intrinsics": ("CameraRefinement",),
    "mask": ("MaskWindow",),
    "matching": ("RegionMatches", "match_regions"),
    "pose": ("Pose",),
    "prior": ("Prior",),
    "rig": ("Frame", "FrameFit", "Influence", "RigEstimate", "estimate_rig"),
    "sanity": ("check_camera", "check_regions"),
    "segmentation.cloud": ("grow_plane",),
    "segmentation.image": ("grow_image_region",),
    "segmentation.masks": (
        "mask_from_file",
        "masks_from_file",
        "masks_from_segmenter",
        "region_from_file",
        "regions_from_file",
    ),
    "segmentation.planes": ("find_planes",),
    "solver": (
        "Alternative",
        "Crease",
        "PoseError",
        "PoseEstimate",
        "PoseWarning",
        "estimate_pose",
        "estimate_poses",
    ),
    "witness": ("Alignment", "SceneFrame", "SceneRefinement", "check_alignment", "refine_with_scene"),
    "world_region": ("WorldRegion",),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    """The public name or the submodule, loaded when first used: scipy alone takes half a second."""
    if name in _HOMES:
        value: object = getattr(importlib.import_module(f"regionpose.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    if not name.startswith("_") and importlib.util.find_spec(f"regionpose.{name}") is not None:
        return importlib.import_module(f"regionpose.{name}")
    raise AttributeError(f"module 'regionpose' has no attribute {name!r}")


def __dir__() -> list[str]:
    """The public names."""
    return sorted(__all__)
