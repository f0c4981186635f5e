"""Very many problems: `estimate_poses` on 1 to k threads, and on a dask cluster of this machine's processes.

Problems are the undisturbed scenes of three outlines of 100 vertices of `benchmarks.speed`. On threads the wall and the
processor time of the same problems are divided by those on one; where cores are shared, processor time
says what several threads cost. On the cluster each task draws and estimates a chunk and sends back how many poses are
how far off; the memory of this process and the greatest of a worker in each tenth are printed.

    OMP_NUM_THREADS=1 python -m benchmarks.many [--problems 1000000] [--workers 2] [--threads 2]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache, partial
from itertools import islice
from typing import NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.cameras import Camera
from scipy.spatial.transform import Rotation

from benchmarks.speed import REGIONS, resampled
from benchmarks.synthetic import perspective_scene
from benchmarks.synthetic.scenes import SyntheticScene
from benchmarks.workers import local_cluster

SCENES = 50
"""Different scenes; each problem moves one of their cameras."""

TURN, SHIFT = 0.02, 0.05
"""Standard deviations of a camera's pose from its scene's, rad and meters: the regions stay in view."""

ERRORS_DEG = (0.0, 1e-6, 1e-3, 1.0, 180.0)
"""Edges between which rotation errors are counted."""

CHUNK = 1000
"""Problems of a task, about a second of work."""

THREADED = 2000
"""Problems that are compared on threads."""

RUNNING = 2
"""Tasks handed to the cluster for each of its workers at a time."""

Problem = tuple[Camera, list[rp.ImageRegion], list[rp.WorldRegion]]


class Summary(NamedTuple):
    """Of a chunk: poses by their error (4,), and the memory of the process that estimated it, MB."""

    errors: NDArray[np.int64]
    megabytes: float


class Shared(NamedTuple):
    """What the problems of a scene share: outlines (n, 3), and their regions."""

    scene: SyntheticScene
    outlines: list[NDArray[np.float64]]
    regions: list[rp.WorldRegion]


@cache
def shared() -> tuple[Shared, ...]:
    """All scenes."""
    found = []
    for seed in range(SCENES):
        scene = perspective_scene(seed, REGIONS, world="arbitrary")
        outlines = [resampled(rings[0]) for rings in scene.regions]
        found.append(Shared(scene, outlines, [rp.WorldRegion.from_polygon([ring]) for ring in outlines]))
    return tuple(found)


def drawn(seed: int) -> tuple[Problem, Rotation]:
    """The problem of a seed, and its true rotation."""
    generator = np.random.default_rng(seed)
    scene, outlines, regions = shared()[seed % SCENES]
    turn = Rotation.from_rotvec(generator.normal(0.0, TURN, 3))
    rotation = turn * Rotation.from_matrix(scene.rotation)
    translation = turn.apply(scene.translation) + generator.normal(0.0, SHIFT, 3)
    seen = [scene.camera.project(rotation.apply(ring) + translation) for ring in outlines]
    return (scene.camera, [rp.ImageRegion.from_polygon([ring]) for ring in seen], regions), rotation


def megabytes() -> float:
    """Memory of this process."""
    from psutil import Process

    return float(Process().memory_info().rss / 2**20)


def estimated(first: int) -> Summary:
    """The chunk of problems with seeds from `first` on."""
    problems, rotations = zip(*map(drawn, range(first, first + CHUNK)), strict=True)
    found = rp.estimate_poses(problems, threads=1)
    errors = [
        180.0 if isinstance(each, rp.PoseError) else (each.pose.rotation * true.inv()).magnitude() * 180.0 / np.pi
        for each, true in zip(found, rotations, strict=True)
    ]
    return Summary(np.histogram(errors, ERRORS_DEG)[0], megabytes())


@contextmanager
def executor_of(workers: int) -> Iterator[Executor]:
    """A dask cluster of so many workers, or without any a thread of this process."""
    if workers == 0:
        with ThreadPoolExecutor(1) as thread:
            yield thread
    else:
        with local_cluster(workers) as options:
            yield options["executor"]


def summaries(executor: Executor, count: int, workers: int) -> Iterator[Summary]:
    """Those of so many chunks, as they end; few wait at a time, however many there are."""
    left = iter(range(0, count * CHUNK, CHUNK))
    running: set[Future[Summary]] = {
        executor.submit(estimated, first) for first in islice(left, RUNNING * max(workers, 1))
    }
    while running:
        ended, running = wait(running, return_when=FIRST_COMPLETED)
        running |= {executor.submit(estimated, first) for first in islice(left, len(ended))}
        yield from (future.result() for future in ended)


def print_cluster(problems: int, workers: int) -> None:
    """A row at each tenth of the problems."""
    count = max(1, problems // CHUNK)
    edges = ", ".join(f"to {edge:g}" for edge in ERRORS_DEG[1:])
    print(f"| problems | seconds | a worker, MB | this process, MB | errors {edges} deg |\n|---|---|---|---|---|")
    errors, most, begin = np.zeros(len(ERRORS_DEG) - 1, dtype=np.int64), 0.0, time.perf_counter()
    with executor_of(workers) as executor:
        for done, summary in enumerate(summaries(executor, count, workers), 1):
            errors, most = errors + summary.errors, max(most, summary.megabytes)
            if done * 10 // count > (done - 1) * 10 // count:
                counts = ", ".join(map(str, errors.tolist()))
                seconds = time.perf_counter() - begin
                print(f"| {done * CHUNK} | {seconds:.0f} | {most:.0f} | {megabytes():.0f} | {counts} |", flush=True)
                most = 0.0


def seconds_of(work: Callable[[], object]) -> tuple[float, float]:
    """Wall and processor time."""
    wall, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - processor


def print_threads(most: int) -> None:
    """A row for each number of threads, doubled up to the most."""
    problems = [drawn(seed)[0] for seed in range(THREADED)]
    rp.estimate_poses(problems[:SCENES], threads=1)
    counts = [2**power for power in range(most.bit_length()) if 2**power <= most]
    found = {count: seconds_of(partial(rp.estimate_poses, problems, threads=count)) for count in counts}
    wall, processor = found[1]
    print("| threads | ms a problem | of one thread's | processor time of one thread's |\n|---|---|---|---|")
    for count, (own_wall, own_processor) in found.items():
        row = f"{1e3 * own_wall / THREADED:.2f} | {own_wall / wall:.2f} | {own_processor / processor:.2f}"
        print(f"| {count} | {row} |", flush=True)


def main() -> int:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--problems", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=2, help="of dask; 0: in this process")
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    print_threads(arguments.threads)
    print()
    print_cluster(arguments.problems, arguments.workers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
