"""Errors of poses before and after the rest of the scene refines them, on real scenes with ground truth.

The poses are those of the scenes' regions as a scan knows them, the camera within 1 m of the scanner: of single frames,
and of frames of one rig, two and four at once (`benchmarks/real_scenes.py` has them by other ways). `--drawn` adds
poses drawn about the true one, 0.6 deg and 12 cm about and along each axis, of every frame with a photo and a cloud;
`--wrong` takes poses of every frame that are turned by 5 to 180 degrees instead, most of them moved, too, with these
deviations and with 2 deg and 40 cm: none should be refined, but for one that is led to the truth.

A line each: errors of rotation and of the camera's center, in brackets over their standard deviation in that direction,
before and after; the logarithm of the odds for the edges, the largest about turned poses; and seconds. Then a
table of medians and worst cases by kind. Where all poses of a kind have one truth, the table has their scatter, too:
medians of the distance from their own median, in which what that truth is off plays no part. Where there are no scenes
this says so and ends.

    python -m benchmarks.refinement [--data ../shared/data] [--rigs 8] [--drawn] [--wrong]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.regions.outline import SparseSamplingWarning
from scipy.spatial.transform import Rotation

from benchmarks.real_scenes import (
    DEFAULT_DATA,
    NATURAL,
    RIG,
    Errors,
    RealScene,
    errors_of,
    joined,
    lidar_scenes,
    written,
)
from benchmarks.witness import RealFrame, frames, wrong_poses

Array = NDArray[np.float64]

DRAWN = np.array([*np.radians([0.6] * 3), 0.12, 0.12, 0.12])
"""Deviations of drawn poses: those of poses by two natural regions."""

SAME_TRUTH, LEAST_SCATTERED = 1e-6, 4
"""Truths nearer than this, rad and meters, are one; poses from which on their scatter is told."""

ROUGH = np.array([*np.radians([2.0] * 3), 0.4, 0.4, 0.4])
"""Deviations of poses that the regions hold weakly."""

NEAR_TURN_DEG, NEAR_SHIFT_M = (5.0, 12.0), 0.4
"""Half of the wrong poses are turned by so little, and moved by about so much along each axis."""

DRAWS = 3
WRONG = 6
PRIOR = "near"


class Start(NamedTuple):
    """A pose to refine, and what is true: kind, name, frames, pose, covariance, truth."""

    kind: str
    name: str
    scene: list[rp.SceneFrame]
    pose: rp.Pose
    covariance: Array
    truth: rp.Pose


class Row(NamedTuple):
    """Errors before and after a refinement, and where the poses (2, 6) lie from the truth, rad and meters."""

    kind: str
    before: Errors
    after: Errors
    refined: bool
    ways: Array
    truth: rp.Pose


def estimated(scenes: Sequence[RealScene], seen: dict[str, rp.SceneFrame], most: int) -> Iterator[Start]:
    """Single frames, and of each rig so many of two and of four at random."""
    for scene in scenes:
        yield from _estimated([scene], seen)
    for kind in (NATURAL, RIG):
        rig = [scene for scene in scenes if scene.kind == kind]
        for count in (2, 4):
            choices = list(combinations(rig, count))
            for number in sorted(np.random.default_rng(0).permutation(len(choices))[:most]):
                yield from _estimated(choices[number], seen)


def _estimated(scenes: Sequence[RealScene], seen: dict[str, rp.SceneFrame]) -> Iterator[Start]:
    """The estimate of frames, unless they have none."""
    whole = joined(scenes, "+".join(scene.name for scene in scenes)) if len(scenes) > 1 else scenes[0]
    try:
        found = whole.estimate("samples", PRIOR)
    except rp.PoseError:
        return
    parts = [replace(seen[s.name], camera=s.camera, regions=s.images) for s in scenes]
    kind = f"{whole.kind}, {len(scenes)}"
    yield Start(kind, "+".join(s.name[-6:] for s in scenes), parts, found.pose, found.covariance, whole.truth)


def drawn(seen: dict[str, rp.SceneFrame], truths: dict[str, rp.Pose]) -> Iterator[Start]:
    """Poses drawn about the true one."""
    for name, frame in seen.items():
        for seed in range(DRAWS):
            pose = truths[name].moved(DRAWN * np.random.default_rng(seed).normal(size=6))
            yield Start(f"{name.split('/')[0]}, drawn", name, [frame], pose, np.diag(DRAWN**2), truths[name])


def wrong(held: Sequence[RealFrame], seen: dict[str, rp.SceneFrame]) -> Iterator[Start]:
    """Wrong poses of every frame: near the true one, and anywhere."""
    for number, one in enumerate(held):
        rng = np.random.default_rng(number)
        poses = [*(_turned(one.pose, rng) for _ in range(WRONG)), *wrong_poses(one.pose, WRONG, number)]
        for place, pose in enumerate(poses):
            covariance = np.diag((DRAWN if place % 2 else ROUGH) ** 2)
            yield Start("wrong", one.name, [seen[one.name]], pose, covariance, one.pose)


def _turned(pose: rp.Pose, rng: np.random.Generator) -> rp.Pose:
    axis, angle = rng.normal(size=3), np.radians(rng.uniform(*NEAR_TURN_DEG))
    rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * pose.rotation
    return rp.Pose(rotation, -rotation.apply(pose.camera_center + NEAR_SHIFT_M * rng.normal(size=3)))


def row_of(start: Start) -> Row:
    """The refinement of a start, printed."""
    begun = time.perf_counter()
    found = rp.refine_with_scene(start.pose, start.covariance, start.scene)
    seconds = time.perf_counter() - begun
    before = errors_of(start.pose, start.covariance, start.truth)
    after = errors_of(found.pose, found.covariance, start.truth)
    print(
        f"{start.kind:18} {start.name:30} {written(before)} -> {written(after)}"
        f"  {'refined' if found.refined else 'left':8} {found.log_odds:6.1f} {found.chance:6.1f}  {seconds:4.1f} s",
        flush=True,
    )
    ways = np.array([_way(start.truth, pose) for pose in (start.pose, found.pose)])
    return Row(start.kind, before, after, found.refined, ways, start.truth)


def _way(truth: rp.Pose, pose: rp.Pose) -> Array:
    """The rotation vector (3,) from the truth, and how far the camera's center is from the true one, (3,)."""
    turn = (pose.rotation * truth.rotation.inv()).as_rotvec()
    return np.concatenate([turn, pose.camera_center - truth.camera_center])


def scatter(rows: Sequence[Row]) -> list[str]:
    """Medians of how far poses are from their median before and after, deg and m; of several truths there are none."""
    if len(rows) < LEAST_SCATTERED or any(np.abs(_way(rows[0].truth, row.truth)).max() > SAME_TRUTH for row in rows):
        return [""] * 4
    ways = np.array([row.ways for row in rows])
    off = ways - np.median(ways, axis=0)
    sizes = [np.median(np.linalg.norm(off[..., part], axis=2), axis=0) for part in (slice(3), slice(3, 6))]
    return [f"{value:.2f}" for value in (*np.degrees(sizes[0]), *sizes[1])]


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of a Markdown table, by kind: medians and worst cases before and after, and how many got worse."""
    errors = "deg before | after | worst | after | m before | after | worse"
    yield f"| frames | number | refined | {errors} | scatter, deg before | after | m before | after |"
    yield "|" + "---|" * 14
    for kind in dict.fromkeys(row.kind for row in rows):
        held = [row for row in rows if row.kind == kind]
        turns = np.array([[row.before.rotation, row.after.rotation] for row in held])
        centers = np.array([[row.before.center, row.after.center] for row in held])
        cells = [*np.median(turns, axis=0), *turns.max(axis=0), *np.median(centers, axis=0)]
        worse = int((turns[:, 1] > turns[:, 0] + 0.1).sum())
        refined = sum(row.refined for row in held)
        written_cells = [*(f"{cell:.2f}" for cell in cells), str(worse), *scatter(held)]
        yield f"| {kind} | {len(held)} | {refined} | {' | '.join(written_cells)} |"


def main() -> None:
    """Print a line for each start, then the table."""
    warnings.simplefilter("ignore", SparseSamplingWarning)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--rigs", type=int, default=8, help="rigs of two and of four frames")
    parser.add_argument("--drawn", action="store_true", help="also poses drawn about the true ones")
    parser.add_argument("--wrong", action="store_true", help="wrong poses in place of those of the regions")
    given = parser.parse_args()
    held = list(frames(given.data))
    if not held:
        print(f"no frames in {given.data}: nothing to measure")
        return
    seen = {frame.name: frame.of_scene() for frame in held}
    scenes = lidar_scenes(given.data)
    starts = [*wrong(held, seen)] if given.wrong else [*estimated(scenes, seen, given.rigs)]
    if given.drawn:
        starts += drawn(seen, {frame.name: frame.pose for frame in held})
    rows = [row_of(start) for start in starts]
    print("", *table(rows), sep="\n")


if __name__ == "__main__":
    main()
