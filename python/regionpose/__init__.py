"""Absolute pose of a central camera from planar regions, without correspondences."""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING

from regionpose._core import __version__

if TYPE_CHECKING:
    from regionpose.calibration import load_camera
    from regionpose.cameras import (
        Camera,
        EquirectangularCamera,
        FisheyeCamera,
        OcamCamera,
        PinholeCamera,
        UnifiedCamera,
        camera_from_colmap,
        camera_to_colmap,
    )
    from regionpose.clouds import Cloud, read_cloud, write_ply
    from regionpose.estimation.answer import Alternative, Crease, PoseError, PoseEstimate
    from regionpose.estimation.batch import estimate_poses
    from regionpose.estimation.intrinsics import CameraRefinement
    from regionpose.estimation.matching import RegionMatches, match_regions
    from regionpose.estimation.options import Solver
    from regionpose.estimation.prior import Prior
    from regionpose.estimation.rig import Frame, FrameFit, Influence, RigEstimate, estimate_rig
    from regionpose.estimation.sides import overlap_errors
    from regionpose.estimation.single import estimate_pose
    from regionpose.estimation.warning import PoseWarning
    from regionpose.pictures.colors import blend_colors, colorize
    from regionpose.pictures.overlays import overlay_depth, overlay_regions
    from regionpose.pose import Pose
    from regionpose.regions.image import ImageRegion
    from regionpose.regions.mask import MaskWindow
    from regionpose.regions.outline import SparseSamplingWarning
    from regionpose.regions.world import WorldRegion
    from regionpose.sanity import check_camera, check_regions
    from regionpose.scene import estimate_scene, load_scene
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
    from regionpose.witness import Alignment, SceneFrame, SceneRefinement, check_alignment, refine_with_scene

__all__ = [
    "Alignment",
    "Alternative",
    "Camera",
    "CameraRefinement",
    "Cloud",
    "Crease",
    "EquirectangularCamera",
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
    "Solver",
    "SparseSamplingWarning",
    "UnifiedCamera",
    "WorldRegion",
    "__version__",
    "blend_colors",
    "camera_from_colmap",
    "camera_to_colmap",
    "check_alignment",
    "check_camera",
    "check_regions",
    "colorize",
    "estimate_pose",
    "estimate_poses",
    "estimate_rig",
    "estimate_scene",
    "find_planes",
    "grow_image_region",
    "grow_plane",
    "load_camera",
    "load_scene",
    "mask_from_file",
    "masks_from_file",
    "masks_from_segmenter",
    "match_regions",
    "overlap_errors",
    "overlay_depth",
    "overlay_regions",
    "read_cloud",
    "refine_with_scene",
    "region_from_file",
    "regions_from_file",
    "write_ply",
]

_MODULES = {
    "calibration": ("load_camera",),
    "cameras": (
        "Camera",
        "EquirectangularCamera",
        "FisheyeCamera",
        "OcamCamera",
        "PinholeCamera",
        "UnifiedCamera",
        "camera_from_colmap",
        "camera_to_colmap",
    ),
    "clouds": (
        "Cloud",
        "read_cloud",
        "write_ply",
    ),
    "pictures.overlays": (
        "overlay_depth",
        "overlay_regions",
    ),
    "estimation.answer": (
        "Alternative",
        "Crease",
        "PoseError",
        "PoseEstimate",
    ),
    "estimation.batch": ("estimate_poses",),
    "estimation.intrinsics": ("CameraRefinement",),
    "estimation.matching": (
        "RegionMatches",
        "match_regions",
    ),
    "estimation.options": ("Solver",),
    "estimation.prior": ("Prior",),
    "estimation.rig": (
        "Frame",
        "FrameFit",
        "Influence",
        "RigEstimate",
        "estimate_rig",
    ),
    "estimation.sides": ("overlap_errors",),
    "estimation.single": ("estimate_pose",),
    "estimation.warning": ("PoseWarning",),
    "pictures.colors": (
        "blend_colors",
        "colorize",
    ),
    "regions.image": ("ImageRegion",),
    "regions.mask": ("MaskWindow",),
    "regions.outline": ("SparseSamplingWarning",),
    "pose": ("Pose",),
    "sanity": (
        "check_camera",
        "check_regions",
    ),
    "scene": (
        "estimate_scene",
        "load_scene",
    ),
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
    "witness": (
        "Alignment",
        "SceneFrame",
        "SceneRefinement",
        "check_alignment",
        "refine_with_scene",
    ),
    "regions.world": ("WorldRegion",),
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
