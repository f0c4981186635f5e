"""What becomes of users' mistakes on real scenes, by the regions alone and with the edges of photo and cloud.

Of each frame below --data with labeled points and a photo, the pose is estimated with the regions as a scan knows them,
without a prior and with the camera within 1 m of the scanner,

- as it is ("none"), and with one mistake:
- "pair": the pairs of two regions are swapped;
- "focal": the camera's focal lengths are a fifth or a tenth too short, or a ninth or a quarter too long;
- "photo": another frame of the same kind is taken for the photo, with its regions;
- "place": a region is drawn beside its place in the photo, half its width away.

The table has a row for each mistake: problems; how many poses are wrong, beyond 5 degrees or 1 meter; how many of these
come without a warning by the regions alone, and with the edges; how many of the right ones have no warning in the same
two; and how many of all that have none with the edges are off by more than three of their standard deviations. A second
one has the confidences of all poses with edges, and how many of these are within 5 degrees, as they state. `--verbose`
prints a line for each wrong pose that is trusted. Where there are no frames this says so and ends.

    python -m benchmarks.real_mistakes [--data ../shared/data] [--only none focal] [--every 1] [--verbose]
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera
from regionpose.regions.outline import SparseSamplingWarning
from rich.console import Console
from rich.progress import track

from benchmarks.agreement import frames
from benchmarks.real_scenes import DEFAULT_DATA, MOST_SIGMAS, RealScene, confidences, errors_of, lidar_scenes

Array = NDArray[np.float64]

WRONG_DEG, WRONG_M = 5.0, 1.0
"""A pose beyond either is another one: what a confidence is about, and twice what single frames err."""

FOCAL = (0.8, 0.9, 1.0 / 0.9, 1.25)
PRIORS = ("none", "near")
MOST_PAIRS = 3


class Problem(NamedTuple):
    """A problem with a mistake, or with none."""

    mistake: str
    name: str
    camera: Camera
    frame: rp.Frame
    prior: rp.Prior | None
    truth: rp.Pose


class Row(NamedTuple):
    """What came of a problem: by the regions and with edges, whether the pose is wrong and whether trusted; of the
    latter its confidence, how far it is turned from the true one, degrees, and its errors over their standard
    deviations, the larger of rotation's and place's.
    """

    mistake: str
    wrong: tuple[bool, bool]
    trusted: tuple[bool, bool]
    confidence: float
    turned_deg: float
    sigmas: float


def problems(scenes: Sequence[RealScene], seen: dict[str, rp.Frame]) -> Iterator[Problem]:
    """All mistakes of all scenes."""
    for scene in scenes:
        for prior in PRIORS:
            if prior in scene.priors:
                yield from _of_scene(scene, prior, scenes, seen)


def _of_scene(
    scene: RealScene, prior: str, scenes: Sequence[RealScene], seen: dict[str, rp.Frame]
) -> Iterator[Problem]:
    worlds, name = scene.worlds["samples"], f"{scene.name}, {prior}"
    frame = seen[scene.name]

    def problem(
        mistake: str,
        camera: Camera = scene.camera,
        images: Sequence[rp.ImageRegion] = scene.images,
        photo: rp.Frame = frame,
    ) -> Problem:
        count = min(len(images), len(worlds))
        images = list(images[:count])
        held = rp.Frame(images, worlds[:count], image=photo.image, points=frame.points, intensity=frame.intensity)
        return Problem(mistake, name, camera, held, scene.priors[prior], scene.truth)

    yield problem("none")
    for a, b in list(combinations(range(len(worlds)), 2))[:MOST_PAIRS]:
        images = list(scene.images)
        images[a], images[b] = images[b], images[a]
        yield problem("pair", images=images)
    for factor in FOCAL:
        if isinstance(scene.camera, PinholeCamera | FisheyeCamera):
            yield problem("focal", camera=scene.camera.zoomed(factor))
    others = [other for other in scenes if other.kind == scene.kind and other is not scene]
    for other in others[:2]:
        yield problem("photo", camera=other.camera, images=other.images, photo=seen[other.name])
    for number, image in enumerate(scene.images[:MOST_PAIRS]):
        moved = beside(image, scene.camera)
        if moved is not None:
            yield problem("place", images=[*scene.images[:number], moved, *scene.images[number + 1 :]])


def beside(region: rp.ImageRegion, camera: Camera) -> rp.ImageRegion | None:
    """The region half its width to the right, or to the left where it would leave the image; None where both do."""
    ring = max(region.rings, key=len)
    half = 0.5 * float(np.ptp(ring[:, 0]))
    for step in (half, -half):
        moved = ring + np.array([step, 0.0])
        if camera.width is not None and moved[:, 0].min() > 0.0 and moved[:, 0].max() < camera.width - 1.0:
            return rp.ImageRegion.from_polygon(moved)
    return None


def row_of(problem: Problem, *, verbose: bool) -> Row | None:
    """What comes of a problem, in both ways; None where no pose shows it."""
    try:
        found = rp.calibrate(problem.camera, [problem.frame], prior=problem.prior)
    except rp.PoseError:
        return None
    edges = found.diagnostics.edges
    assert edges is not None and edges.regions_only is not None
    ways = (edges.regions_only.estimate, found)
    wrong = (is_wrong(ways[0].pose, problem.truth), is_wrong(ways[1].pose, problem.truth))
    trusted = (not ways[0].warnings, not ways[1].warnings)
    turn = turned_deg(found.pose, problem.truth)
    if verbose and any(np.logical_and(wrong, trusted)):
        place = np.linalg.norm(found.pose.camera_center - problem.truth.camera_center)
        print(f"{problem.mistake:6} {problem.name:28} {turn:6.1f} deg {place:6.2f} m  {trusted}  {found}", flush=True)
    errors = errors_of(found.pose, found.covariance, problem.truth)
    sigmas = max(errors.rotation_sigmas, errors.center_sigmas)
    return Row(problem.mistake, wrong, trusted, found.confidence, turn, sigmas)


def is_wrong(pose: rp.Pose, truth: rp.Pose) -> bool:
    """Whether a pose is another one than the true one."""
    is_near = np.linalg.norm(pose.camera_center - truth.camera_center) < WRONG_M
    return not (is_near and turned_deg(pose, truth) < WRONG_DEG)


def turned_deg(pose: rp.Pose, truth: rp.Pose) -> float:
    """The angle between two poses, degrees."""
    return float(np.degrees((pose.rotation * truth.rotation.inv()).magnitude()))


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of a Markdown table, by mistake."""
    ways = "by the regions | with edges"
    yield (
        f"| mistake | problems | wrong, {ways} | of them trusted, {ways} | right and trusted, {ways} |"
        f" trusted with edges, beyond {MOST_SIGMAS:g} sigmas |"
    )
    yield "|" + "---|" * 9
    for mistake in dict.fromkeys(row.mistake for row in rows):
        held = [row for row in rows if row.mistake == mistake]
        wrong, trusted = (np.array([getattr(row, name) for row in held]) for name in ("wrong", "trusted"))
        beyond = sum(row.trusted[1] and row.sigmas > MOST_SIGMAS for row in held)
        counts = [*wrong.sum(0), *(wrong & trusted).sum(0), *(~wrong & trusted).sum(0), beyond]
        yield f"| {mistake} | {len(held)} | {' | '.join(map(str, counts))} |"


def main() -> None:
    """Print the tables."""
    warnings.simplefilter("ignore", SparseSamplingWarning)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--only", nargs="+", help="mistakes, all when left out")
    parser.add_argument("--every", type=int, default=1, help="take one problem in so many of each mistake")
    parser.add_argument("--verbose", action="store_true", help="a line for each wrong pose that is trusted")
    given = parser.parse_args()
    seen = {held.name: held.frame for held in frames(given.data)}
    scenes = [scene for scene in lidar_scenes(given.data) if scene.name in seen and "samples" in scene.worlds]
    if not scenes:
        print(f"no frames in {given.data}: nothing to measure")
        return
    whole = [each for each in problems(scenes, seen) if given.only is None or each.mistake in given.only]
    by_mistake = [[each for each in whole if each.mistake == name] for name in dict.fromkeys(e.mistake for e in whole)]
    tried = [each for held in by_mistake for each in held[:: given.every]]
    shown = track(tried, "poses", console=Console(stderr=True))
    rows = [row_of(problem, verbose=given.verbose) for problem in shown]
    found = [row for row in rows if row is not None]
    print(*table(found), "", *confidences([(row.confidence, row.turned_deg) for row in found]), sep="\n")


if __name__ == "__main__":
    main()
