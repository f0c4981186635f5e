"""Synthetic benchmark: templates, scenes with a known pose, exact masks, noise and error measures.

`scene = perspective_scene(seed, planes)` makes one problem; `scene.masks()` is what the camera sees of
`scene.regions`, and `pose_errors` compares an estimate with `scene.rotation, scene.translation` at `scene.anchor`.
Studies of many problems are in `benchmarks.synthetic.studies`.
"""

from __future__ import annotations

from benchmarks.synthetic.lidar import SpinningLidar, lidar_points
from benchmarks.synthetic.masks import area_coverage, binary_mask, project_region
from benchmarks.synthetic.measures import (
    PoseErrors,
    Summary,
    is_solved,
    overlap_error,
    pose_errors,
    solved_share,
    summarize,
)
from benchmarks.synthetic.noise import (
    MiscalibratedCamera,
    miscalibrate,
    occlude_mask,
    occlude_region,
    squares_on_mask,
    squares_on_region,
    truncate_masks,
)
from benchmarks.synthetic.scenes import (
    Layout,
    ScenePlacementError,
    SyntheticScene,
    draw_scene,
    fisheye_scene,
    omnidirectional_scene,
    perspective_scene,
    problem_generator,
    setup_scene,
)
from benchmarks.synthetic.setups import (
    GrazingPoses,
    PoseRange,
    Setup,
    TurnedPoses,
    fisheye_setup,
    omnidirectional_setup,
    perspective_setup,
)
from benchmarks.synthetic.templates import Template, all_templates, load_templates, template_named

__all__ = [
    "GrazingPoses",
    "Layout",
    "MiscalibratedCamera",
    "PoseErrors",
    "PoseRange",
    "ScenePlacementError",
    "Setup",
    "SpinningLidar",
    "Summary",
    "SyntheticScene",
    "Template",
    "TurnedPoses",
    "all_templates",
    "area_coverage",
    "binary_mask",
    "draw_scene",
    "fisheye_scene",
    "fisheye_setup",
    "is_solved",
    "lidar_points",
    "load_templates",
    "miscalibrate",
    "occlude_mask",
    "occlude_region",
    "omnidirectional_scene",
    "omnidirectional_setup",
    "overlap_error",
    "perspective_scene",
    "perspective_setup",
    "pose_errors",
    "problem_generator",
    "project_region",
    "setup_scene",
    "solved_share",
    "squares_on_mask",
    "squares_on_region",
    "summarize",
    "template_named",
    "truncate_masks",
]
