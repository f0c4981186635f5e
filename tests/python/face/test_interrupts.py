"""Ctrl-C ends what takes long within a second, wherever it is; threads and forks change no answer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp

from benchmarks.synthetic import perspective_scene

pytestmark = pytest.mark.slow

SOON_S = 1.0
"""A user waits so long at the most."""

START_S = 60.0
"""Imports on a busy machine."""

PROBLEM = """
import numpy as np, regionpose as rp, shapely
from benchmarks.synthetic import perspective_scene

def given(seed, planes=3):
    scene = perspective_scene(seed, planes)
    noise = np.random.default_rng(seed)
    rings = [[ring + noise.normal(0.0, 0.3, ring.shape) for ring in rings] for rings in scene.image_rings]
    images = [rp.ImageRegion.from_polygon(each) for each in rings]
    return scene.camera, images, [rp.WorldRegion.from_polygon(each) for each in scene.regions]

def sampled(count=6_000):
    # One place in ten is said to be on the wrong side: rounds of beliefs go on for a minute.
    scene, noise, worlds = perspective_scene(1, 3), np.random.default_rng(1), []
    for rings in scene.regions:
        ring = rings[0]
        middle, axes = ring.mean(axis=0), np.linalg.svd(ring - ring.mean(axis=0))[2][:2]
        flat = (ring - middle) @ axes.T
        places = noise.uniform(flat.min(axis=0), flat.max(axis=0), (count, 2))
        inside = shapely.contains_xy(shapely.Polygon(flat), *places.T) ^ (noise.uniform(size=count) < 0.1)
        world = middle + places @ axes
        worlds.append(rp.WorldRegion.from_samples(world[inside], world[~inside]))
    images = [rp.ImageRegion.from_polygon(each) for each in scene.image_rings]
    return scene.camera, images, worlds
"""

LONG = {
    "estimate_poses": "problems = [given(seed) for seed in range(3)] * 20000\nready()\nrp.estimate_poses(problems)",
    "estimate_pose": (
        "problem, native = given(1), rp.Solver(driver='native')\nready()\n"
        "while True: rp.estimate_pose(*problem, solver=native)"
    ),
    "estimate_rig": (
        "camera, *sides = given(1)\nready()\nwhile True: rp.estimate_rig(camera, [rp.Frame(*sides)] * 200)"
    ),
    "match_regions": (
        "camera, images, worlds = given(1)\nready()\nwhile True: rp.match_regions(camera, images, worlds[::-1])"
    ),
    "estimate_pose_of_samples": "problem = sampled()\nready()\nwhile True: rp.estimate_pose(*problem)",
    "estimate_poses_of_samples": "problem = sampled()\nready()\nrp.estimate_poses([problem] * 50, threads=2)",
    "estimate_rig_of_samples": (
        "camera, *sides = sampled()\nready()\nwhile True: rp.estimate_rig(camera, [rp.Frame(*sides)] * 5)"
    ),
    "match_many_regions": (
        "camera, images, worlds = given(1)\nready()\nwhile True: rp.match_regions(camera, images * 12, worlds * 12)"
    ),
    "alpha_shape": (
        "points = np.random.default_rng(0).uniform(0.0, 1.0, (1_000_000, 2))\nready()\n"
        "while True: rp.kernels.alpha_shape(points, 0.01)"
    ),
    "find_planes": (
        "points = np.random.default_rng(0).uniform(0.0, 9.0, (900_000, 3))\nready()\n"
        "while True: rp.segment.find_planes(points)"
    ),
}
"""Work of minutes, once `ready()` is said."""


def interruptible(command: list[str]) -> subprocess.Popen[str]:
    """A process that hears Ctrl-C, which what a shell starts in the background does not."""

    def hear() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=paths, preexec_fn=hear
    )


def interrupted(process: subprocess.Popen[str]) -> tuple[str, float]:
    """What a process says on standard error after Ctrl-C, and the seconds until it ends."""
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    _, said = process.communicate(timeout=START_S)
    return said, time.monotonic() - start


def soon() -> float:
    """Seconds that a user waits at the most, on a machine as busy as this one and this test."""
    return SOON_S * max(1.0, (os.getloadavg()[0] + 1.0) / (os.cpu_count() or 1))


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_long_work_within_a_second(name: str, tmp_path: Path) -> None:
    body = f"{PROBLEM}\ndef ready(): print('ready', flush=True)\n\n{LONG[name]}\n"
    script = tmp_path / "long.py"
    script.write_text(body)
    process = interruptible([sys.executable, str(script)])
    try:
        assert process.stdout is not None and process.stdout.readline().strip() == "ready"
        time.sleep(0.7)
        assert process.poll() is None, "the work was short"
        said, taken = interrupted(process)
    finally:
        process.kill()
    assert "KeyboardInterrupt" in said
    assert process.returncode in (-signal.SIGINT, 130, 1)
    assert taken < soon(), f"{taken:.2f} s"


def test_a_handler_that_only_takes_note_ends_nothing() -> None:
    """A signal whose handler raises nothing leaves the batch its answers."""
    scene = perspective_scene(1, 1)
    images = [rp.ImageRegion.from_polygon(rings) for rings in scene.image_rings]
    problem = (scene.camera, images, [rp.WorldRegion.from_polygon(rings) for rings in scene.regions])
    noted: list[int] = []
    before = signal.signal(signal.SIGALRM, lambda number, _: noted.append(number))
    signal.setitimer(signal.ITIMER_REAL, 0.02)
    try:
        found = rp.estimate_poses([problem] * 200, threads=2)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert len(found) == 200 and not any(isinstance(each, rp.PoseError) for each in found)


def test_batches_from_several_threads_are_the_same_to_the_last_bit() -> None:
    problems = []
    for seed in range(6):
        scene = perspective_scene(seed, 1 + seed % 3)
        images = [rp.ImageRegion.from_polygon(rings) for rings in scene.image_rings]
        problems.append((scene.camera, images, [rp.WorldRegion.from_polygon(rings) for rings in scene.regions]))

    def poses(threads: int) -> list[bytes]:
        found = rp.estimate_poses(problems, threads=threads)
        assert not any(isinstance(each, rp.PoseError) for each in found)
        return [np.concatenate([e.pose.matrix.ravel(), e.covariance.ravel()]).tobytes() for e in found]  # type: ignore[union-attr]

    expected = poses(1)
    with ThreadPoolExecutor(4) as pool:
        assert all(found == expected for found in pool.map(poses, (1, 2, 1, 2, 4, 2)))


def test_a_study_ends_by_ctrl_c_within_a_second(tmp_path: Path) -> None:
    words = ["-m", "benchmarks", "perspective", "--scenes", "5000", "--no-plots", "-j", "1"]
    command = [sys.executable, *words, "--out", str(tmp_path / "study.csv")]
    process = interruptible(command)
    try:
        end = time.monotonic() + START_S
        while not list(tmp_path.iterdir()) and time.monotonic() < end:
            time.sleep(0.1)
        time.sleep(1.0)
        said, taken = interrupted(process)
    finally:
        process.kill()
    assert process.returncode == 130, said
    assert taken < soon(), textwrap.shorten(said, 200)
