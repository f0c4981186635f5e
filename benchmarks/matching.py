"""Share of scenes in which `match_regions` finds every pair and no other, and its time.

k regions of different shapes on several planes (25 shapes of 1 m, pinhole 2376 x 1584 px at 4 to 6 m, any world frame,
either side of a plane to the camera), binary masks, both lists shuffled. Distractors are regions of further shapes from
another scene: so many masks without a world region, and as many world regions without a mask. Noise is the share of
each mask's area that squares along its boundary change. "Wrong unsaid" are scenes with other pairs than the true ones
and no warning of the matching. Time is that of one thread, `match_regions` alone.

    python -m benchmarks.matching [--scenes 100] [--rows ROW [ROW ...]]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.solve.matching import Pairs

from benchmarks.synthetic import SyntheticScene, binary_mask, perspective_scene, problem_generator, squares_on_mask

LAYOUTS = {2: (2, 1), 4: (2, 2), 8: (4, 2)}
"""Planes, and regions on each, of a number of regions."""

ROWS = (
    (2, 0, 0.0),
    (4, 0, 0.0),
    (8, 0, 0.0),
    (8, 3, 0.0),
    (4, 3, 0.05),
    (8, 0, 0.05),
    (8, 3, 0.05),
)
"""Regions, distractors on each side, noise."""


@dataclass(frozen=True)
class Task:
    """What `match_regions` gets, and the true pairs."""

    scene: SyntheticScene
    images: list[rp.ImageRegion]
    worlds: list[rp.WorldRegion]
    pairs: Pairs


@dataclass
class Tally:
    """What came of the scenes of a row."""

    right: int = 0
    unsaid: int = 0
    seconds: list[float] = field(default_factory=list)


def scene_of(regions: int, seed: int, study: str) -> SyntheticScene:
    """A scene of so many regions."""
    planes, on_each = LAYOUTS[regions]
    return perspective_scene(seed, planes, regions_per_plane=on_each, world="arbitrary", front=False, study=study)


def distractors(scene: SyntheticScene, count: int, seed: int) -> tuple[list[NDArray[np.bool_]], list[rp.WorldRegion]]:
    """So many masks, and world regions of others, of shapes that the scene and one another do not hold."""
    masks: list[NDArray[np.bool_]] = []
    worlds: list[rp.WorldRegion] = []
    used, draws = set(scene.names), 0
    width, height = scene.camera.width, scene.camera.height
    assert width is not None and height is not None
    while len(worlds) < count:
        other = scene_of(8, 1000 * seed + draws, "matching distractors")
        fresh = [index for index, name in enumerate(other.names) if name not in used]
        for index in fresh[: 2 * count - len(masks) - len(worlds)]:
            used.add(other.names[index])
            if len(masks) < count:
                masks.append(binary_mask(other.image_rings[index], width, height))
            else:
                worlds.append(rp.WorldRegion.from_polygon(other.regions[index]))
        draws += 1
    return masks, worlds


def task_of(regions: int, extra: int, noise: float, seed: int) -> Task:
    """The task of a seed."""
    scene, rng = scene_of(regions, seed, "matching"), problem_generator(seed, "matching noise")
    extra_masks, extra_worlds = distractors(scene, extra, seed)
    masks = [squares_on_mask(mask, noise, rng) if noise else mask for mask in [*scene.masks(), *extra_masks]]
    worlds = [*(rp.WorldRegion.from_polygon(rings) for rings in scene.regions), *extra_worlds]
    to_image, to_world = rng.permutation(len(masks)).tolist(), rng.permutation(len(worlds)).tolist()
    images = [rp.ImageRegion.from_mask(masks[k]) for k in to_image]
    pairs = tuple((i, to_world.index(k)) for i, k in enumerate(to_image) if k < regions)
    return Task(scene, images, [worlds[k] for k in to_world], pairs)


def run(row: tuple[int, int, float], scenes: Sequence[int]) -> Tally:
    """The row's tally."""
    tally = Tally()
    for seed in scenes:
        task = task_of(*row, seed)
        start = time.process_time()
        try:
            found = rp.match_regions(task.scene.camera, task.images, task.worlds, threads=1)
        except rp.PoseError:
            continue
        finally:
            tally.seconds.append(time.process_time() - start)
        tally.right += found.pairs == task.pairs
        tally.unsaid += found.pairs != task.pairs and not found.warnings
    return tally


def main() -> None:
    """Print a table row by row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--rows", type=int, nargs="+", default=range(len(ROWS)), help="which rows, from 0")
    arguments = parser.parse_args()
    print("| regions | distractors a side | noise | all pairs right | wrong unsaid | median time | longest |")
    print("|---|---|---|---|---|---|---|")
    for index in arguments.rows:
        regions, extra, noise = ROWS[index]
        tally = run(ROWS[index], range(arguments.scenes))
        right, unsaid = (f"{100.0 * count / arguments.scenes:.1f} %" for count in (tally.right, tally.unsaid))
        times = f"{np.median(tally.seconds):.2f} s | {max(tally.seconds):.2f} s"
        print(f"| {regions} | {extra} | {100.0 * noise:.0f} % | {right} | {unsaid} | {times} |", flush=True)


if __name__ == "__main__":
    main()
