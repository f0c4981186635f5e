"""Where the time of an estimate goes: seconds of each stage from masks to pose, as a share of the whole.

Scenes of the perspective benchmark, all shapes, arbitrary world frames, binary masks of the whole image with squares
along the boundary that change the share `--noise` of their area. The stages are those of `estimate_pose` by scipy's
driver, whose least squares can be timed alone, one after another; each time is the median over the scenes, of the
processor, and the share that of the sum of medians. The contours' refinement is what the verdict takes more with it
than without.

    OMP_NUM_THREADS=1 python -m benchmarks.stages [--scenes 20] [--planes 1 3] [--noise 0 0.05 0.2]
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose import _core
from regionpose.cameras import Camera
from regionpose.solve.core_inputs import observed_regions
from regionpose.solve.options import System
from regionpose.solve.scipy_driver import scipy_minimum

from benchmarks.synthetic import perspective_scene, problem_generator, squares_on_mask

Result = TypeVar("Result")

SYSTEMS: tuple[System, ...] = ("plane", "sphere")


class Given(NamedTuple):
    """What an estimate starts from."""

    camera: Camera
    masks: list[NDArray[np.bool_]]
    worlds: list[rp.WorldRegion]


class Stages(NamedTuple):
    """Seconds of each stage."""

    contours: float
    bearings: float
    problem: float
    search: float
    refinement: float
    least_squares: float
    verdict: float


HEADS = ("mask to contour", "to bearings", "problem", "search", "contour refinement", "least squares", "verdict")


def drawn(seed: int, planes: int, noise: float) -> Given:
    """The masks and world regions of a seed."""
    scene = perspective_scene(seed, planes, world="arbitrary")
    rng = problem_generator(seed, "stages")
    masks = [squares_on_mask(mask, noise, rng) if noise else mask for mask in scene.masks()]
    return Given(scene.camera, masks, [rp.WorldRegion.from_polygon(rings) for rings in scene.regions])


def timed(run: Callable[[], Result]) -> tuple[Result, float]:
    """What comes of a call, and its processor time."""
    begin = time.process_time()
    result = run()
    return result, time.process_time() - begin


def stages(given: Given, system: System) -> tuple[Stages, _core.Estimate | None]:
    """The time of each stage, and the estimate that they end in."""
    images, contours = timed(lambda: [rp.ImageRegion.from_mask(mask) for mask in given.masks])
    observed, bearings = timed(lambda: observed_regions(given.camera, images, "boundary"))
    cores = [world.core for world in given.worlds]
    raw, build = timed(lambda: _core.Problem(observed, cores, system=system, integration="boundary"))
    _, search = timed(lambda: raw.search(refine=None))
    found, whole = timed(raw.search)
    minima, solve = timed(lambda: [scipy_minimum(found, *candidate) for candidate in found.candidates])
    estimate, verdict = timed(lambda: found.assess(minima))
    return Stages(contours, bearings, build, search, max(whole - search, 0.0), solve, verdict), estimate


def line(system: System, planes: int, noise: float, scenes: int) -> str:
    """A row of the table."""
    times = np.array([stages(drawn(seed, planes, noise), system)[0] for seed in range(scenes)])
    medians = np.median(times, axis=0)
    shares = " | ".join(f"{100.0 * share:.0f} %" for share in medians / medians.sum())
    return f"| {system} | {planes} | {100.0 * noise:g} % | {shares} | {1e3 * medians.sum():.1f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--planes", type=int, nargs="+", default=[1, 3])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0, 0.05, 0.2])
    arguments = parser.parse_args()
    stages(drawn(0, 1, 0.0), "plane")  # What is loaded at the first call is no stage's time.
    print(f"| system | planes | noise | {' | '.join(HEADS)} | ms |")
    print(f"|{'---|' * (len(HEADS) + 4)}")
    for system, planes, noise in itertools.product(SYSTEMS, arguments.planes, arguments.noise):
        print(line(system, planes, noise, arguments.scenes), flush=True)


if __name__ == "__main__":
    main()
