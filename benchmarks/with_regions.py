"""Errors of poses by regions alone, by edges alone and by both, on real scenes with ground truth.

The regions are those of the scenes as a scan knows them, the camera within 1 m of the scanner: of single frames, and of
frames of one rig, two and four at once (`benchmarks/real_scenes.py` has them by other ways). A line each: errors of
rotation and of the camera's center, in brackets over their standard deviation in that direction, by the three; the
confidence by both and the warnings; and seconds. Then a table of medians and worst cases by kind, and how many poses by
both are worse than the better of the others by a tenth of a degree. Where all poses of a kind have one truth, the table
has their scatter, too: the median of the distance from their own median, in which what that truth is off plays no part.
Where there are no scenes this says so and ends.

    python -m benchmarks.with_regions [--data ../shared/data] [--rigs 8] [--only natural kitti] [--without-edges-alone]
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

from benchmarks.agreement import frames
from benchmarks.real_scenes import DEFAULT_DATA, NATURAL, RIG, Errors, RealScene, errors_of, lidar_scenes, written

Array = NDArray[np.float64]

SAME_TRUTH, LEAST_SCATTERED = 1e-6, 4
"""Truths nearer than this, rad and meters, are one; poses from which on their scatter is given."""

WORSE_DEG = 0.1
"""A rotation is worse than another beyond this."""

WAY, PRIOR = "samples", "near"


class Row(NamedTuple):
    """Errors by regions, by edges (None where not asked) and by both; where the pose by both lies from the truth (6,),
    rad and meters; whether it has no warning.
    """

    kind: str
    regions: Errors
    edges: Errors | None
    both: Errors
    way: Array
    truth: rp.Pose
    is_trusted: bool


def choices(scenes: Sequence[RealScene], most: int) -> Iterator[Sequence[RealScene]]:
    """Single frames, and of each rig so many of two and of four at random."""
    yield from ([scene] for scene in scenes)
    for kind in (NATURAL, RIG):
        rig = [scene for scene in scenes if scene.kind == kind]
        for count in (2, 4):
            all_of_rig = list(combinations(rig, count))
            for number in sorted(np.random.default_rng(0).permutation(len(all_of_rig))[:most]):
                yield all_of_rig[number]


def row_of(scenes: Sequence[RealScene], seen: dict[str, rp.Frame], *, edges_alone: bool) -> Row | None:
    """The errors of the pose of frames, printed; None where the regions have none."""
    held = [replace(seen[scene.name], image_regions=scene.images, world_regions=scene.worlds[WAY]) for scene in scenes]
    prior, truth, begun = scenes[0].priors[PRIOR], scenes[0].truth, time.perf_counter()
    try:
        found = rp.calibrate(scenes[0].camera, held, prior=prior)
    except rp.PoseError:
        return None
    seconds, alone = time.perf_counter() - begun, None
    if edges_alone:
        bare = [replace(frame, image_regions=(), world_regions=()) for frame in held]
        alone = _errors(rp.calibrate(scenes[0].camera, bare, prior=prior), truth)
    edges = found.diagnostics.edges
    assert edges is not None and edges.regions_only is not None
    kind, name = f"{scenes[0].kind}, {len(scenes)}", "+".join(scene.name[-6:] for scene in scenes)
    regions, both = _errors(edges.regions_only.estimate, truth), _errors(found, truth)
    codes = " ".join(warning.code for warning in found.warnings)
    print(
        f"{kind:16} {name:28} {written(regions)} | {'' if alone is None else written(alone)} -> {written(both)}"
        f"  {edges.log_odds:6.1f} {100 * found.confidence:5.1f} %  {seconds:4.1f} s  {codes}",
        flush=True,
    )
    return Row(kind, regions, alone, both, _way(truth, found.pose), truth, not found.warnings)


def _errors(estimate: rp.PoseEstimate, truth: rp.Pose) -> Errors:
    return errors_of(estimate.pose, estimate.covariance, truth)


def _way(truth: rp.Pose, pose: rp.Pose) -> Array:
    """The rotation vector (3,) from the truth, and how far the camera's center is from the true one, (3,)."""
    turn = (pose.rotation * truth.rotation.inv()).as_rotvec()
    return np.concatenate([turn, pose.camera_center - truth.camera_center])


def scatter(rows: Sequence[Row]) -> list[str]:
    """Medians of how far poses are from their median, deg and m; of several truths there are none."""
    if len(rows) < LEAST_SCATTERED or any(np.abs(_way(rows[0].truth, row.truth)).max() > SAME_TRUTH for row in rows):
        return ["", ""]
    ways = np.array([row.way for row in rows])
    off = ways - np.median(ways, axis=0)
    turn, shift = (np.median(np.linalg.norm(off[:, part], axis=1)) for part in (slice(3), slice(3, 6)))
    return [f"{np.degrees(turn):.2f}", f"{shift:.2f}"]


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of a Markdown table, by kind: medians and worst cases by the three, and how many got worse."""
    yield (
        "| frames | number | trusted | deg: regions | edges | both | worst: regions | both | m: regions | edges | both"
        " | worse | scatter, deg | m |"
    )
    yield "|" + "---|" * 14
    for kind in dict.fromkeys(row.kind for row in rows):
        held = [row for row in rows if row.kind == kind]
        alone = [row.edges for row in held if row.edges is not None]
        cells = [
            f"{sum(row.is_trusted for row in held)}",
            _median([row.regions.rotation for row in held]),
            _median([each.rotation for each in alone]),
            _median([row.both.rotation for row in held]),
            f"{max(row.regions.rotation for row in held):.2f}",
            f"{max(row.both.rotation for row in held):.2f}",
            _median([row.regions.center for row in held]),
            _median([each.center for each in alone]),
            _median([row.both.center for row in held]),
            f"{sum(_is_worse(row) for row in held)}",
            *scatter(held),
        ]
        yield f"| {kind} | {len(held)} | {' | '.join(cells)} |"


def _is_worse(row: Row) -> bool:
    others = [row.regions, *([] if row.edges is None else [row.edges])]
    return row.both.rotation > min(other.rotation for other in others) + WORSE_DEG


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.2f}" if values else ""


def main() -> None:
    """Print a line for each start, then the table."""
    warnings.simplefilter("ignore", SparseSamplingWarning)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--rigs", type=int, default=8, help="rigs of two and of four frames")
    parser.add_argument("--only", nargs="+", help="kinds of scenes, all when left out")
    parser.add_argument("--without-edges-alone", action="store_true", help="leave out poses by edges alone")
    arguments = parser.parse_args()
    seen = {frame.name: frame.frame for frame in frames(arguments.data)}
    scenes = [scene for scene in lidar_scenes(arguments.data) if scene.name in seen]
    scenes = [scene for scene in scenes if arguments.only is None or scene.kind in arguments.only]
    if not scenes:
        print(f"no scenes with ground truth below {arguments.data}")
        return
    chosen = choices(scenes, arguments.rigs)
    rows = [row_of(each, seen, edges_alone=not arguments.without_edges_alone) for each in chosen]
    print("", *table([row for row in rows if row is not None]), sep="\n")


if __name__ == "__main__":
    main()
