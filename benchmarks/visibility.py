"""Whether clouds hide the regions that photos show: at true poses, and at wrong ones that fit them.

Of each frame below --data with regions, a photo and a cloud, the fraction of each region that the cloud hides at

- "true": the true pose;
- "turned": poses as `python -m benchmarks.agreement` makes them, few of which show a region where the photo does;
- "single": all answers of each region by itself, half turns and mirrored poses among them;
- "none", "pair", "focal", "photo", "place": all answers with no mistake, and with those of `python -m
  benchmarks.real_mistakes`.

A pose is wrong beyond 5 degrees or 1 meter. The table has, for each kind, how many poses are right and wrong; how many
of the right ones hide a region; how many of the wrong ones edges contradict by odds of 9 to 1, how many hide a region,
and how many of these the edges do not contradict. Below it stand the largest shares at true and right poses, how many
wrong poses hide a region for other widths of gaps, and two more signs that are not looked at, since they tell too
little: how near points come to the camera, as they would within a wall, and which share of the cloud is in view. Where
there are no frames this says so and ends.

    python -m benchmarks.visibility [--data ../shared/data]
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.alignment import visibility
from regionpose.alignment.odds import DECISIVE
from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.regions.outline import SparseSamplingWarning
from rich.console import Console
from rich.progress import track
from scipy.spatial import cKDTree

from benchmarks.agreement import frames, wrong_poses
from benchmarks.real_mistakes import Problem, is_wrong, problems
from benchmarks.real_scenes import DEFAULT_DATA, LIDARS, RealScene, scene_of

Array = NDArray[np.float64]

GAPS = (3, 5, 7, 9, 11)
"""Widths of the gaps that surfaces close, cells."""

WITHIN_M = 0.1
"""A camera nearer to a point would be within what the point is of."""

TURNED = 12


class Pose(NamedTuple):
    """What is measured at a pose: its kind, whether it is wrong, the edges' odds, the fraction of its most hidden
    region by gap, the distance of the nearest point, meters, and the share of the cloud in view.
    """

    kind: str
    wrong: bool
    edges: float
    hidden: dict[int, float]
    nearest_m: float
    in_view: float


class Given(NamedTuple):
    """A pose to be judged, of a kind, with what is seen at it."""

    kind: str
    seen: PhotoCloud
    pose: rp.Pose
    truth: rp.Pose


def given_poses(scenes: Sequence[RealScene], seen: dict[str, rp.Frame]) -> Iterator[Given]:
    """All poses of all frames."""
    for number, scene in enumerate(scenes):
        worlds = scene.worlds["samples"]
        frame = replace(seen[scene.name], image_regions=scene.images, world_regions=worlds)
        photo_cloud = PhotoCloud.of(scene.camera, frame)
        yield Given("true", photo_cloud, scene.truth, scene.truth)
        for pose in wrong_poses(scene.truth, TURNED, number):
            yield Given("turned", photo_cloud, pose, scene.truth)
        for image, world in zip(scene.images, worlds, strict=True):
            alone = replace(frame, image_regions=[image], world_regions=[world])
            for prior in [scene.priors[name] for name in ("none", "near") if name in scene.priors]:
                yield from answers(Problem("single", "", scene.camera, alone, prior, scene.truth))
    for problem in problems([scene for scene in scenes if scene.kind in LIDARS], seen):
        yield from answers(problem)


def answers(problem: Problem) -> Iterator[Given]:
    """All answers of a problem; none where no pose shows it."""
    frame = problem.frame
    try:
        estimate = rp.estimate_pose(problem.camera, frame.image_regions, frame.world_regions, prior=problem.prior)
    except rp.PoseError:
        return
    seen = PhotoCloud.of(problem.camera, frame)
    for answer in (estimate, *estimate.diagnostics.alternatives):
        yield Given(problem.mistake, seen, answer.pose, problem.truth)


def measured(given: Given) -> Pose:
    """What edges and visibility measure at a pose."""
    seen, pose, camera = given.seen, given.pose, given.seen.camera
    points = seen.points[np.isfinite(seen.points).all(axis=1)]
    edges = rp.check_alignment(camera, seen.frame, pose).edge_log_odds
    hidden = {gap: most_hidden(replace(seen, points=points), pose, gap) for gap in GAPS}
    nearest = float(cKDTree(points).query(pose.camera_center)[0])
    assert camera.width is not None and camera.height is not None
    pixels = camera.project(pose.transform(points))
    ends = np.array([camera.width, camera.height]) - 0.5
    in_view = float(((pixels >= -0.5) & (pixels < ends)).all(axis=1).mean())
    return Pose(given.kind, is_wrong(pose, given.truth), edges, hidden, nearest, in_view)


def most_hidden(seen: PhotoCloud, pose: rp.Pose, gap: int) -> float:
    """The fraction of the most hidden region, with surfaces that close gaps of so many cells."""
    with patch.object(visibility, "GAP_CELLS", gap):
        found = visibility.occlusions(seen, pose)
    return max((each.hidden_fraction for each in found if each.hidden_fraction > 0.0), default=0.0)


def table(poses: Sequence[Pose], gap: int) -> Iterator[str]:
    """Lines of a Markdown table, by kind."""
    yield "| poses | right | of them hidden | wrong | edges contradict | hidden | hidden alone |"
    yield "|" + "---|" * 7
    for kind in dict.fromkeys(pose.kind for pose in poses):
        right, wrong = ([pose for pose in poses if pose.kind == kind and pose.wrong == way] for way in (False, True))
        edges = [pose.edges < -DECISIVE for pose in wrong]
        hides = [pose.hidden[gap] > visibility.MOSTLY for pose in wrong]
        alone = sum(hidden and not edge for hidden, edge in zip(hides, edges, strict=True))
        false = sum(pose.hidden[gap] > visibility.MOSTLY for pose in right)
        yield f"| {kind} | {len(right)} | {false} | {len(wrong)} | {sum(edges)} | {sum(hides)} | {alone} |"


def summary(poses: Sequence[Pose], gap: int) -> Iterator[str]:
    """The largest shares of right poses, other gaps, and what else was tried."""
    true = [pose for pose in poses if pose.kind == "true"]
    right, wrong = ([pose for pose in poses if pose.wrong == way] for way in (False, True))
    for name, group in (("true", true), ("right", right)):
        shares = sorted((pose.hidden[gap] for pose in group), reverse=True)[:5]
        yield f"largest hidden shares at {len(group)} {name} poses: {', '.join(f'{share:.2f}' for share in shares)}"
    for width in GAPS:
        false, hidden = (sum(pose.hidden[width] > visibility.MOSTLY for pose in group) for group in (right, wrong))
        yield f"gaps of {width} cells: {false} right and {hidden} wrong poses hide a region"
    near = [sum(pose.nearest_m < WITHIN_M for pose in group) for group in (right, wrong)]
    yield f"a point within {WITHIN_M} m of the camera: {near[0]} right and {near[1]} wrong poses"
    views = [np.percentile([pose.in_view for pose in group], (0, 10, 50, 90, 100)) for group in (right, wrong)]
    for name, view in zip(("right", "wrong"), views, strict=True):
        listed = ", ".join(f"{share:.3f}" for share in view)
        yield f"share of the cloud in view, {name}: {listed} (least, 10, 50, 90 %, most)"


def main() -> None:
    """Print the table and what is below it."""
    warnings.simplefilter("ignore", SparseSamplingWarning)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    data = parser.parse_args().data
    gap = visibility.GAP_CELLS
    seen = {held.name: held.frame for held in frames(data)}
    folders = [data / name for name in seen if (data / name / "regions.json").exists()]
    if not folders:
        print(f"no frames in {data}: nothing to measure")
        return
    with tempfile.TemporaryDirectory() as temporary:
        scenes = [scene_of(folder, Path(temporary)) for folder in folders]
    tried = list(given_poses([scene for scene in scenes if "samples" in scene.worlds], seen))
    poses = [measured(given) for given in track(tried, "poses", console=Console(stderr=True))]
    print(*table(poses, gap), *summary(poses, gap), sep="\n")


if __name__ == "__main__":
    main()
