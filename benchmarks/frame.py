"""Where the processor time of one frame goes, from its files to the report, and how it grows with what a frame holds.

Frames: the demo's scene with its regions, and without, and with real frames at hand the first street, its heading known
to 20 degrees. The time of each stage is without those within it. `--growth`: points, pixels and frames of the room of
`benchmarks.scale`, and regions, are doubled three times. `--clicks`: the pose by the demo's regions alone, as the page
shows it after each pair of clicks.

    python -m benchmarks.frame [--data ../shared/data] [--growth] [--clicks]
"""

from __future__ import annotations

import argparse
import functools
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import regionpose as rp
from regionpose.alignment import calibration
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.pose_search import Density
from regionpose.app.edge_scene import without_regions
from regionpose.app.scene_text import scene_of
from regionpose.app.session import Session
from regionpose.datasets.demo import demo_folder
from regionpose.scene import estimate, exposure, sensors
from regionpose.scene.bundle import bundle
from regionpose.scene.loading import load_scene
from regionpose.scene.stages import Stages
from scipy.spatial.transform import Rotation

from benchmarks._demo_clicks import BOARD, CHALKBOARD, DOOR, click_sign, demo_session
from benchmarks.automatic import mounted, photo_and_cloud
from benchmarks.real_frames import load_frames
from benchmarks.real_scenes import DEFAULT_DATA
from benchmarks.scale import Loaded, make_inputs

STAGES: tuple[tuple[str, Any, str], ...] = (
    ("photo decoded", sensors, "read_picture"),
    ("cloud read", sensors, "read_cloud"),
    ("masks in the photo", exposure, "image_side"),
    ("planes in the cloud", exposure, "_world_sides"),
    ("pose by regions", estimate, "estimate_regions"),
    ("pictures of the photo", EdgeFrame, "_made"),
    ("edges of the cloud", EdgeFrame, "_edges"),
    ("search and ascents", Density, "modes"),
    ("focal lengths", calibration, "focal_evidence"),
    ("agreement of the pose", calibration, "aligned"),
    ("planes that confirm it", estimate, "region_check"),
)
"""Names of stages, and the functions that these are."""

SIZES = {"points": 50_000, "pixels": 500_000, "frames": 1, "regions": 3}
"""What is doubled three times, from these."""


class Clock:
    """Processor time of stages, seconds, each without those that run within it."""

    def __init__(self) -> None:
        """Nothing yet."""
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._running, self._since = ["all else"], time.process_time()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count a block as a stage."""
        self._turn()
        self._running.append(name)
        try:
            yield
        finally:
            self._turn()
            self._running.pop()

    def _turn(self) -> None:
        now = time.process_time()
        self.seconds[self._running[-1]] += now - self._since
        self._since = now

    def timed(self, name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        """A function that counts as a stage."""

        @functools.wraps(work)
        def called(*arguments: Any, **options: Any) -> Any:
            with self.stage(name):
                return work(*arguments, **options)

        return called


def seconds_of(work: Callable[[Clock], object]) -> Mapping[str, float]:
    """Processor time by stage."""
    clock = Clock()
    with ExitStack() as patched:
        for name, owner, attribute in STAGES:
            patched.enter_context(patch.object(owner, attribute, clock.timed(name, getattr(owner, attribute))))
        with clock.stage("all else"):
            work(clock)
    return clock.seconds


def demo_run(clock: Clock, *, with_regions: bool) -> None:
    """The demo's scene from its files, all results written to a folder."""
    path = demo_folder() / "scene.yaml"
    scene = load_scene(path)
    if not with_regions:
        assert isinstance(scene.document.value, dict)
        scene = scene_of(path, without_regions(scene.document.value))
    run = estimate.estimate_scene(scene)
    with clock.stage("pictures and report"), tempfile.TemporaryDirectory() as folder:
        for name, write in bundle(run, Stages()).writers.items():
            write(Path(folder) / name)


def street_run(data: Path) -> Callable[[Clock], object] | None:
    """The first street, by its arrays; None where it is not at hand."""
    frame = next(iter(load_frames(data, ["natural"])), None) if data.is_dir() else None
    if frame is None:
        return None
    pair, prior = photo_and_cloud(frame), mounted(frame)
    return lambda clock: rp.calibrate(frame.camera, [pair], prior=prior, sensor_origin=frame.scanner)


def room_run(folder: Path, sizes: Mapping[str, int]) -> Callable[[Clock], object]:
    """The room, of so many points, pixels and equal frames."""
    megapixels = 1e-6 * sizes["pixels"]
    action = Loaded(make_inputs(folder, sizes["points"], megapixels), megapixels).calibration(sizes["frames"])
    return lambda clock: action()


def regions_run(count: int) -> Callable[[Clock], object]:
    """The pose of so many regions of the room's size, seen from its camera."""
    generator = np.random.default_rng(3)
    camera = rp.PinholeCamera(800.0, 800.0, 639.5, 479.5, width=1280, height=960)
    corners = np.array([[-0.5, -0.4, 0.0], [0.6, -0.5, 0.0], [0.5, 0.4, 0.0], [-0.4, 0.6, 0.0]])
    worlds = []
    for _ in range(count):
        turn = Rotation.from_rotvec(generator.normal(0.0, 0.4, 3))
        worlds.append(turn.apply(corners) + generator.uniform([-4.0, -3.0, 9.0], [4.0, 3.0, 12.0]))
    images = [rp.ImageRegion.from_polygon(camera.project(world)) for world in worlds]
    sides = [rp.WorldRegion.from_polygon(world) for world in worlds]
    return lambda clock: rp.estimate_pose(camera, images, sides)


def clicked(*pairs: tuple[list[float], list[float]], as_signs: bool = True) -> Session:
    """The demo with regions by clicks in photo and cloud: the first ones take whole walls in the cloud, further ones
    the signs on them.
    """
    session = demo_session(Path("scene.yaml"))
    for pixel, place in pairs:
        session.click_photo(pixel)
        if as_signs:
            click_sign(session, place)
        else:
            session.click_cloud(place)
    return session


def click_rows() -> Iterator[str]:
    """A row for each number of pairs that were clicked: the pose by them, seconds, and what it is called."""
    yield "| clicked | pose by regions | |"
    yield "|---|---|---|"
    cases = {
        "a sign in the photo, its whole wall in the cloud": clicked(DOOR, as_signs=False),
        "a sign on one wall in the photo, another wall's in the cloud": clicked((DOOR[0], CHALKBOARD[1])),
        "one sign": clicked(DOOR),
        "two signs": clicked(DOOR, BOARD),
        "three signs": clicked(DOOR, BOARD, CHALKBOARD),
    }
    for name, session in cases.items():
        start = time.process_time()
        status = session.estimate_regions().estimate.status
        yield f"| {name} | {time.process_time() - start:.2g} s | {status} |"


def table(columns: Mapping[str, Mapping[str, float]]) -> Iterator[str]:
    """A row for each stage, seconds of processor time, and their sum."""
    yield "| stage | " + " | ".join(columns) + " |"
    yield "|---|" + "---|" * len(columns)
    for name in [*(name for name, _, _ in STAGES), "pictures and report", "all else"]:
        if any(name in seconds for seconds in columns.values()):
            yield f"| {name} | " + " | ".join(f"{seconds.get(name, 0.0):.2f}" for seconds in columns.values()) + " |"
    yield "| all | " + " | ".join(f"{sum(seconds.values()):.2f}" for seconds in columns.values()) + " |"


def growth() -> Iterator[str]:
    """A row for each size that is doubled: seconds, and how many times the first."""
    yield "| what | from | 1 | 2 | 4 | 8 |"
    yield "|---|---|---|---|---|---|"
    for name, first in SIZES.items():
        seconds = []
        for factor in (1, 2, 4, 8):
            with tempfile.TemporaryDirectory() as folder:
                run = (
                    regions_run(first * factor)
                    if name == "regions"
                    else room_run(Path(folder), {**SIZES, name: first * factor})
                )
                seconds.append(sum(seconds_of(run).values()))
        ratios = " | ".join(f"{value:.2g} s ({value / seconds[0]:.1f})" for value in seconds)
        yield f"| {name} | {first:,} | {ratios} |"


def main() -> None:
    """Run the frames and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--growth", action="store_true")
    parser.add_argument("--clicks", action="store_true")
    options = parser.parse_args()
    runs: dict[str, Callable[[Clock], object]] = {
        "demo, regions and edges": functools.partial(demo_run, with_regions=True),
        "demo, edges": functools.partial(demo_run, with_regions=False),
    }
    street = street_run(options.data)
    if street is None:
        print(f"no real frames in {options.data}: the street is left out")
    else:
        runs["a street, mounted"] = street
    # What is loaded once a process is no part of a frame.
    seconds_of(functools.partial(demo_run, with_regions=True))
    for line in table({name: seconds_of(run) for name, run in runs.items()}):
        print(line)
    for rows in (growth() if options.growth else (), click_rows() if options.clicks else ()):
        for line in rows:
            print(line, flush=True)


if __name__ == "__main__":
    main()
