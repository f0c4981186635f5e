"""The files that come of a scene's estimate: result, report, pictures and coloured cloud."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from regionpose.clouds import Cloud, write_ply
from regionpose.overlay import overlay_regions
from regionpose.pose import Pose
from regionpose.report import Figure, Report, report_html
from regionpose.scene.colours import coloured_cloud, overlay_depth
from regionpose.scene.estimate import SceneEstimate, Stages
from regionpose.scene.loading import Scene
from regionpose.scene.result import scene_result
from regionpose.scene.verdict import verdict
from regionpose.splat import splatted, viewpoints

Colours = NDArray[np.uint8]

RESULT, REPORT, OVERLAY, DEPTH, CLOUD = "result.json", "report.html", "overlay.png", "depth.png", "cloud.ply"

UNSEEN = 0.35
"""Brightness of points that the camera doesn't see, in the report's views: there, but behind the coloured ones."""


@dataclass(frozen=True)
class Truth:
    """A known pose to compare with."""

    pose: Pose


@dataclass(frozen=True, eq=False)
class Bundle:
    """What to write: `writers` by file name, and the `result` as plain values."""

    result: dict[str, Any]
    writers: dict[str, Callable[[Path], object]]


def file_names(scene: Scene) -> list[str]:
    """The names of the files of a scene's bundle."""
    return [RESULT, REPORT, OVERLAY, *([DEPTH, CLOUD] if scene.model.cloud is not None else [])]


def read_truth(path: Path) -> Truth:
    """The known pose of a file with `rotation` (3, 3) and `translation` (3,), metres, from the cloud's frame to the
    camera's.
    """
    held = json.loads(path.read_text(encoding="utf-8"))
    return Truth(Pose.from_parts(held["rotation"], held["translation"]))


def truth_errors(pose: Pose, truth: Truth) -> dict[str, float]:
    """How far a pose is from the known one: rotation (deg), camera centre and translation (m)."""
    return {
        "rotation_deg": float(np.degrees((pose.rotation * truth.pose.rotation.inv()).magnitude())),
        "camera_center_m": float(np.linalg.norm(pose.camera_center - truth.pose.camera_center)),
        "translation_m": float(np.linalg.norm(pose.translation - truth.pose.translation)),
    }


def bundle(run: SceneEstimate, stages: Stages, truth: Truth | None = None) -> Bundle:
    """Everything that is written of a run; the pictures' seconds are added to `stages`."""
    sides = run.sides
    writers: dict[str, Callable[[Path], object]] = {}
    figures, views = [], []
    with stages.stage("pictures"):
        overlay = overlay_of(run)
        figures.append(
            Figure(
                overlay,
                "Each region's outline in the image (blue) and its 3D region projected with the pose (orange).",
            )
        )
        if sides.cloud is not None:
            depth = overlay_depth(sides.image, sides.cloud.points, sides.camera, run.local_pose)
            figures.append(Figure(depth, "The cloud projected onto the image, coloured by depth."))
    if sides.cloud is not None:
        with stages.stage("colours"):
            coloured, visible = coloured_cloud(sides.cloud, sides.image, sides.camera, run.local_pose)
            views = cloud_views(run, coloured, visible)
        writers[CLOUD] = lambda path: write_ply(path, coloured)
        writers[DEPTH] = partial(Image.fromarray(depth).save, format="PNG")
    result = scene_result(run)
    if truth is not None:
        result["truth_errors"] = truth_errors(run.estimate.pose, truth)
    judged = verdict(run)
    report = Report(
        f"Camera pose of {sides.scene.path.stem}", judged.level, judged.headline, judged.remarks, result, figures, views
    )
    html = report_html(report)
    text = json.dumps(result, indent=2, allow_nan=False) + "\n"
    writers[OVERLAY] = partial(Image.fromarray(overlay).save, format="PNG")
    writers[REPORT] = lambda path: path.write_text(html, encoding="utf-8")
    writers[RESULT] = lambda path: path.write_text(text, encoding="utf-8")
    return Bundle(result, writers)


def overlay_of(run: SceneEstimate) -> Colours:
    """The image with both sides of each region."""
    sides = run.sides
    regions = [side.region for side in sides.world_sides]
    labels = [
        f"{name} {100.0 * error:.1f} %"
        for name, error in zip(sides.names, run.estimate.region_overlap_errors, strict=True)
    ]
    return overlay_regions(sides.image, sides.camera, run.local_pose, sides.image_regions, regions, labels)


def cloud_views(run: SceneEstimate, cloud: Cloud, visible: NDArray[np.bool_]) -> list[Figure]:
    """The coloured cloud from two viewpoints beside the camera's; points without colour are grey."""
    if not visible.any() or cloud.colours is None:
        return []
    pose = run.local_pose
    up = run.sides.scene.model.prior.up
    direction = -pose.rotation.inv().apply([0.0, 1.0, 0.0]) if up is None else np.asarray(up, dtype=np.float64)
    colours = np.where(visible[:, None], cloud.colours, _greys(cloud)[:, None]).astype(np.uint8)
    views = viewpoints(cloud.points[visible], pose.camera_center, direction)
    captions = (
        "The coloured cloud, seen from the camera's left",
        "The coloured cloud, seen from the camera's right and above",
    )
    return [
        Figure(splatted(cloud.points, colours, view), f"{caption}; grey: not in the image.")
        for view, caption in zip(views, captions, strict=True)
    ]


def _greys(cloud: Cloud) -> NDArray[np.float64]:
    """A grey (n,) of each point: its intensity where it is known."""
    if cloud.intensity is None:
        return np.full(len(cloud), 255.0 * UNSEEN)
    brightest = float(np.percentile(cloud.intensity, 98)) or 1.0
    return 255.0 * UNSEEN * np.clip(cloud.intensity / brightest, 0.25, 1.0)
