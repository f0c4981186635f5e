"""Very many estimates, files and commands in one process: memory and open files stay as they are.

    python fuzz/soak.py
    python fuzz/soak.py --estimates 2000 --files 200 --commands 20

Memory is what the process holds, after a first tenth of each kind that fills caches; the exit code is 1 where it grows
by more than 20 MB over the rest or a file is left open. Runs on Linux.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import io
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import regionpose as rp
from readers import CALIBRATIONS, OWN
from regionpose.cli import main as command
from samples import samples

from benchmarks.synthetic import perspective_scene

MOST_GROWTH = 20
"""Megabytes: pages that the allocator keeps, far less than a kilobyte a run."""


def held() -> tuple[int, int]:
    """Megabytes of memory, and open files."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") >> 20, len(os.listdir("/proc/self/fd"))


def grown(name: str, count: int, run: Callable[[int], object]) -> bool:
    """Whether memory or open files grow with the runs but the first tenth."""
    begin = time.monotonic()
    first = max(count // 10, 1)
    for number in range(first):
        run(number)
    before = held()
    for number in range(first, count):
        run(number)
    after, seconds = held(), time.monotonic() - begin
    print(f"{count} {name} in {seconds:.0f} s: {before[0]} MB to {after[0]} MB, {before[1]} to {after[1]} open files")
    return after[0] - before[0] > MOST_GROWTH or after[1] > before[1]


def estimates() -> Callable[[int], object]:
    """Estimates of a few dozen scenes, in turn, some of them in batches."""
    problems = []
    for seed in range(24):
        scene = perspective_scene(seed, 1 + seed % 3)
        images = [rp.ImageRegion.from_polygon(rings) for rings in scene.image_rings]
        problems.append((scene.camera, images, [rp.WorldRegion.from_polygon(rings) for rings in scene.regions]))

    def run(number: int) -> object:
        problem = problems[number % len(problems)]
        if number % 50 == 0:
            return rp.estimate_poses([problem], threads=2)
        return rp.estimate_pose(*problem, solver=rp.Solver(driver="native" if number % 2 else "scipy"))

    return run


def files(folder: Path) -> Callable[[int], object]:
    """Whole files of every kind, in turn."""
    every = samples(CALIBRATIONS)
    for sample in every:
        (folder / sample.name).write_bytes(sample.content)

    def run(number: int) -> object:
        sample = every[number % len(every)]
        # Some want an option more; their errors are to leave nothing behind, too.
        with contextlib.suppress(*OWN):
            return sample.read(folder / sample.name)

    return run


def commands(folder: Path) -> Callable[[int], object]:
    """Commands that read and tell."""
    named = sorted(path for path in folder.iterdir() if path.suffix in (".ply", ".pcd", ".npy", ".las", ".json"))

    def run(number: int) -> object:
        words = ["schema"] if number % 5 == 0 else ["info", str(named[number % len(named)])]
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            return command(words)

    return run


def main() -> int:
    """Run as the arguments say; 1 where something grows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--estimates", type=int, default=20_000)
    parser.add_argument("--files", type=int, default=2_000)
    parser.add_argument("--commands", type=int, default=200)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        growing = [
            grown("estimates", given.estimates, estimates()),
            grown("files", given.files, files(Path(name))),
            grown("commands", given.commands, commands(Path(name))),
        ]
    return 1 if any(growing) else 0


if __name__ == "__main__":
    sys.exit(main())
