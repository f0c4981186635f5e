"""The files that come of a scene's estimate: result, report, pictures and colored cloud."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionpose.fusion.colors import SeenPoints, cloud_with_colors, seen_points
from regionpose.geometry.pose import Pose
from regionpose.io.clouds import Cloud, write_ply
from regionpose.io.png import save_png
from regionpose.scene.confirmed import RegionCheck
from regionpose.scene.estimate import SceneEstimate, frame_label
from regionpose.scene.loading import Scene, has_pairs
from regionpose.scene.region_files import REGION_LABELS, region_files
from regionpose.scene.region_values import REGION_POINTS, numbered
from regionpose.scene.report import Figure, Report, report_html
from regionpose.scene.result import scene_result, seconds_values
from regionpose.scene.solver_config import given_pose
from regionpose.scene.stages import Stages
from regionpose.viz.overlays import overlay_depth, overlay_edges, overlay_regions, overlay_seen
from regionpose.viz.splat import drawn_points, splatted, viewpoints

Colors = NDArray[np.uint8]

RESULT, REPORT, OVERLAY, BEFORE = "result.json", "report.html", "overlay.png", "overlay_before.png"
DEPTH, EDGES, RUNNER_UP, CLOUD = "depth.png", "edges.png", "runner_up.png", "cloud.ply"
PLANES = "planes.png"

EDGES_CAPTION = (
    "Where the cloud's surfaces end before farther ones, away from the regions: green where an edge of the photo"
    " stands out there, magenta where none does."
)

RUNNER_UP_CAPTION = (
    "The same at the next likeliest pose: if it fits the photo better, the pose is wrong; if as well, it is ambiguous."
)

PLANES_CAPTION = (
    "Planes of the cloud whose borders the photo confirms: on its edges (blue), and projected with the pose (orange)."
    " Beside the names: the log odds against chance."
)

UNSEEN = 0.35
"""Brightness of points that the camera doesn't see, in the report's views: there, but behind the colored ones."""


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
    """The names of the files of a scene's bundle; those of several frames end in the frame's number."""
    frames = scene.frames
    return [
        RESULT,
        REPORT,
        *(numbered(n, k, len(frames)) for k, each in enumerate(frames) for n in _frame_names(each)),
    ]


def _frame_names(scene: Scene) -> list[str]:
    """The names of the files of one frame, before they are numbered."""
    if not has_pairs(scene):
        return [DEPTH, EDGES, RUNNER_UP, PLANES, REGION_LABELS, REGION_POINTS, CLOUD]
    before = [] if given_pose(scene) is None else [BEFORE]
    edges = [EDGES] if scene.model.solver.edges else []
    return [OVERLAY, *before, *([DEPTH, *edges, CLOUD] if scene.model.cloud is not None else [])]


def read_truth(path: Path) -> Truth:
    """The known pose of a file with `rotation` (3, 3) and `translation` (3,), meters, from the cloud's frame to the
    camera's.
    """
    values = json.loads(path.read_text(encoding="utf-8"))
    return Truth(Pose.from_parts(values["rotation"], values["translation"]))


def truth_errors(pose: Pose, truth: Truth) -> dict[str, float]:
    """How far a pose is from the known one: rotation (deg), camera center and translation (m)."""
    return {
        "rotation_deg": float(np.degrees((pose.rotation * truth.pose.rotation.inv()).magnitude())),
        "camera_center_m": float(np.linalg.norm(pose.camera_center - truth.pose.camera_center)),
        "translation_m": float(np.linalg.norm(pose.translation - truth.pose.translation)),
    }


def bundle(
    run: SceneEstimate,
    stages: Stages,
    truth: Truth | None = None,
    folder: Path | None = None,
    found: Callable[[dict[str, Any]], object] = lambda result: None,
) -> Bundle:
    """Everything that is written of a run to `folder`, by default that of the scene file.

    The pictures' seconds are added to `stages`; `found` is called with the result before they are drawn.
    """
    result, title = scene_result(run, folder), f"Camera pose of {run.scene.path.stem}"
    if truth is not None:
        result["truth_errors"] = truth_errors(run.estimate.pose, truth)
    found(result)
    views = run.views
    frames = [_frame_files(view, k, len(views), stages) for k, view in enumerate(views)]
    writers = {name: writer for frame in frames for name, writer in frame.writers.items()}
    figures = [figure for frame in frames for figure in frame.figures]
    solids = [figure for frame in frames for figure in frame.solids]
    result["seconds"] = seconds_values(run)
    html = report_html(Report(title, result, figures, solids))
    text = json.dumps(result, indent=2, allow_nan=False) + "\n"
    writers[REPORT] = lambda path: path.write_text(html, encoding="utf-8")
    writers[RESULT] = lambda path: path.write_text(text, encoding="utf-8")
    return Bundle(result, writers)


class FrameFiles(NamedTuple):
    """What is written of a frame, by file name, and its figures in the report: over the photo, and of the cloud."""

    writers: dict[str, Callable[[Path], object]]
    figures: list[Figure]
    solids: list[Figure]


def _frame_files(view: SceneEstimate, index: int, count: int, stages: Stages) -> FrameFiles:
    """The files of one frame of `count`; the seconds of its pictures are added to `stages`."""
    with stages.within(frame_label(view.sides.scene, index, count)):
        return _drawn_files(view, partial(numbered, index=index, count=count), stages)


def _drawn_files(view: SceneEstimate, numbered: Callable[[str], str], stages: Stages) -> FrameFiles:
    with stages.stage("pictures"):
        seen = _seen(view)
        drawn = {numbered(name): figure for name, figure in pictures(view, seen).items()}
    writers: dict[str, Callable[[Path], object]] = {
        name: partial(save_png, picture=figure.picture) for name, figure in drawn.items()
    }
    writers |= {numbered(name): writer for name, writer in region_files(view).items()}
    solids: list[Figure] = []
    if view.sides.cloud is not None and seen is not None:
        with stages.stage("colors"):
            cloud = cloud_with_colors(view.sides.image, seen, view.sides.cloud)
            solids = [_titled(view, figure) for figure in cloud_views(view, cloud, seen.visible)]
        writers[numbered(CLOUD)] = partial(_write_cloud, cloud)
    return FrameFiles(writers, [_titled(view, figure) for figure in drawn.values()], solids)


def _titled(view: SceneEstimate, figure: Figure) -> Figure:
    """The figure with the name of its frame, where it has one, before what it shows."""
    name = view.sides.scene.name
    return replace(figure, caption=f"{name}: {figure.caption}") if name else figure


def _write_cloud(cloud: Cloud, path: Path) -> None:
    write_ply(path, cloud)


def _seen(run: SceneEstimate) -> SeenPoints | None:
    """What the camera sees of the cloud; None without one."""
    sides = run.sides
    if sides.cloud is None:
        return None
    return seen_points(sides.camera, sides.cloud.local_points, run.local_pose, sides.image.shape[:2])


def pictures(run: SceneEstimate, seen: SeenPoints | None) -> dict[str, Figure]:
    """The pictures over the image by file name: regions before and after, and what is seen of the cloud by depth."""
    made = _region_pictures(run) if run.names else {}
    sides = run.sides
    if seen is not None:
        depth = overlay_seen(sides.image, seen)
        made[DEPTH] = Figure(depth, "The cloud's points that the camera sees, colored by their distance from it.")
    for alignment in run.alignments:
        if alignment is not None:
            made[EDGES] = Figure(overlay_edges(sides.image, alignment), EDGES_CAPTION)
    if run.is_by_edges and run.estimate.diagnostics.alternatives and sides.cloud is not None:
        other = run.estimate.diagnostics.alternatives[0].pose.rebase(sides.origin)
        made[RUNNER_UP] = Figure(
            overlay_depth(sides.camera, sides.image, sides.cloud.local_points, other), RUNNER_UP_CAPTION
        )
    if run.regions_found is not None and run.regions_found.names:
        made[PLANES] = Figure(_planes_picture(run, run.regions_found), PLANES_CAPTION)
    return made


def _planes_picture(run: SceneEstimate, check: RegionCheck) -> Colors:
    """The image of one frame with both sides of its confirmed regions."""
    regions = [region for found in check.frames if found is not None for region in found.regions]
    labels = [f"{region.name}  {region.log_odds:.1f}" for region in regions]
    images, worlds = [region.image for region in regions], [region.world for region in regions]
    return overlay_regions(run.camera, run.sides.image, images, worlds, run.local_pose, labels)


def _region_pictures(run: SceneEstimate) -> dict[str, Figure]:
    """The regions over the image, before and after."""
    made: dict[str, Figure] = {}
    if run.local_initial is not None:
        before = overlay_of(run, run.local_initial, run.errors_before)
        made[BEFORE] = Figure(before, "Before: the 3D regions (orange) projected with the scene's initial pose.")
    fractions = [float("nan") if fit is None else fit.consistent_fraction for fit in run.sample_fits]
    after = overlay_of(run, run.local_pose, run.estimate.diagnostics.region_overlap_errors, fractions)
    word = "After: each" if made else "Each"
    caption = f"{word} region's outline in the image (blue) and its 3D region projected with the pose (orange)."
    caption += " Beside the names: the overlap error."
    if np.isfinite(fractions).any():
        caption += (
            " Of regions given as samples: the fraction of these on their side of the outline; dots are the others,"
            " orange ones belong within, white ones beyond."
        )
    made[OVERLAY] = Figure(after, caption)
    return made


def overlay_of(
    run: SceneEstimate,
    pose: Pose,
    errors: Sequence[float] | NDArray[np.float64],
    fractions: Sequence[float] = (),
) -> Colors:
    """The image with both sides of each region at a pose, and their overlap errors, or fractions of samples instead."""
    sides = run.sides
    regions = [side.region for side in sides.world_sides]
    ranking = np.where(np.isfinite(fractions), fractions, errors) if len(fractions) else np.asarray(errors)
    labels = [
        f"{name}  {100.0 * value:.1f} %" if np.isfinite(value) else name
        for name, value in zip(sides.names, ranking, strict=True)
    ]
    return overlay_regions(sides.camera, sides.image, sides.image_regions, regions, pose, labels)


def cloud_views(run: SceneEstimate, cloud: Cloud, visible: NDArray[np.bool_]) -> list[Figure]:
    """The colored cloud from two viewpoints beside the camera's; points without color are gray."""
    shown, drawn = drawn_points(visible), drawn_points(cloud.local_points)
    if not shown.any() or cloud.colors is None:
        return []
    pose = run.local_pose
    up = run.scene.model.prior.up
    direction = -pose.rotation.inv().apply([0.0, 1.0, 0.0]) if up is None else np.asarray(up, dtype=np.float64)
    colors = np.where(shown[:, None], drawn_points(cloud.colors), drawn_points(_grays(cloud))[:, None]).astype(np.uint8)
    views = viewpoints(drawn[shown], pose.camera_center, direction)
    captions = (
        "The colored cloud, seen from the camera's left",
        "The colored cloud, seen from the camera's right and above",
    )
    return [
        Figure(splatted(drawn, colors, view), f"{caption}; gray: not in the image.")
        for view, caption in zip(views, captions, strict=True)
    ]


def _grays(cloud: Cloud) -> NDArray[np.float64]:
    """A gray (n,) of each point: its intensity where it is known."""
    if cloud.intensity is None:
        return np.full(len(cloud), 255.0 * UNSEEN)
    intensity = np.nan_to_num(cloud.intensity, nan=0.0, posinf=0.0, neginf=0.0)
    brightest = float(np.percentile(intensity, 98)) or 1.0
    return 255.0 * UNSEEN * np.clip(intensity / brightest, 0.25, 1.0)
