"""Time of a pose from nothing against OpenCV's iterative PnP on the same points, in one run.

Three regions of 100 vertices each, all seen by one camera; regionpose sees contours without correspondences or a start,
on one thread; OpenCV sees the 300 vertices with their exact correspondences. Each row is the median over rounds that
alternate between all rows and their references:

    batch      `estimate_poses` on exact outlines
    noisy      the batch, each image vertex off by 0.5 px (one standard deviation along either axis)
    single     one `estimate_pose` a scene
    distorted  the batch by a camera with five coefficients of distortion, which OpenCV is given, too
    bitten     the batch, a notch of 5 % of its area cut out of each image outline
    masks      the batch on masks of 2376 x 1584 px with errors on 20 % of the area, contours traced beforehand
    from_mask  tracing such a mask, over `cv2.findContours` on it
    samples    the batch on scans of 64 beams, whose regions are given as samples of all beams, over the outlines of the
               same scans' points

    python -m benchmarks.speed [--rows batch single ...] [--scenes 20] [--rounds 11]
"""

from __future__ import annotations

import argparse
import statistics
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np
import regionpose as rp
import shapely
from numpy.typing import NDArray
from regionpose.cameras import Camera
from regionpose.regions.outline import SparseSamplingWarning
from scipy.optimize import brentq

from benchmarks.synthetic import perspective_scene, perspective_setup
from benchmarks.synthetic.setups import perspective_camera
from benchmarks.synthetic.studies.conditions import Condition, Scan
from benchmarks.synthetic.studies.problems import draw_problem

Array = NDArray[np.float64]
Problem = tuple[Camera, Sequence[rp.ImageRegion], Sequence[rp.WorldRegion]]

CAMERA = perspective_camera()
"""What all scenes are seen by, one object as of the frames of a video."""

DISTORTED = replace(CAMERA, distortion=(-0.1, 0.02, 5e-4, -5e-4, 0.0))
"""The same with the distortion of a usual lens."""

VERTICES = 100
REGIONS = 3

BITE = 0.05
"""Share of an outline's area that a notch takes."""

VERTEX_NOISE = 0.5
"""Standard deviation of an image vertex along either axis, pixels: that of a careful click."""

MASK_ERRORS = 0.2
"""Share of a mask's area that errors along its boundary change."""

BEAMS, RANGE_NOISE_M = 64, 0.01
"""Beams of a scan and the error along them: those of most rows of the study `lidar`."""

MASKS = 8
"""Masks that are traced in a round: together they are larger than a processor's cache."""


class Outlined(NamedTuple):
    """A scene by its outlines: (n, 3) in the world, (n, 2) in the image."""

    camera: rp.PinholeCamera
    world: list[Array]
    image: list[Array]

    @classmethod
    def of_seed(cls, seed: int, camera: rp.PinholeCamera = CAMERA) -> Outlined:
        """The scene of a seed, each outline as `VERTICES` vertices."""
        scene = perspective_scene(seed, REGIONS, world="arbitrary")
        world = [resampled(rings[0]) for rings in scene.regions]
        image = [camera.project(ring @ scene.rotation.T + scene.translation) for ring in world]
        return cls(camera, world, image)

    def problem(self, change: Callable[[Array], Array] = np.asarray) -> Problem:
        """The regions of both sides, of the image's after a change."""
        images = [rp.ImageRegion.from_polygon([change(ring)]) for ring in self.image]
        return self.camera, images, [rp.WorldRegion.from_polygon([ring]) for ring in self.world]


class Row(NamedTuple):
    """What is timed, the poses or masks in it, and the name of its reference."""

    run: Callable[[], object]
    items: int
    reference: str


def resampled(ring: Array) -> Array:
    """The ring as `VERTICES` vertices at equal distances along it."""
    following = np.roll(ring, -1, axis=0)
    lengths = np.linalg.norm(following - ring, axis=1)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    along = np.linspace(0.0, ends[-1], VERTICES, endpoint=False)
    edge = np.searchsorted(ends, along, side="right") - 1
    share = ((along - ends[edge]) / lengths[edge])[:, None]
    return np.asarray(ring[edge] * (1.0 - share) + following[edge] * share)


def bitten(ring: Array) -> Array:
    """The ring without the square about one of its vertices that takes the share `BITE` of its area.

    About the first vertex at which that leaves one part without a hole.
    """
    outline = shapely.Polygon(ring)
    target, reach = BITE * outline.area, float(np.ptp(ring, axis=0).max())
    for vertex in ring:

        def square(half: float, center: Array = vertex) -> shapely.Polygon:
            return shapely.box(*(center - half), *(center + half))

        half = brentq(lambda half, at=square: outline.intersection(at(half)).area - target, 0.0, reach)
        rest = outline.difference(square(half))
        if isinstance(rest, shapely.Polygon) and not rest.interiors:
            return np.asarray(shapely.get_coordinates(rest)[:-1])
    raise ValueError(f"a notch of {BITE:.0%} cuts the outline apart wherever it is")


def noisy(ring: Array) -> Array:
    """The ring with noise on its vertices."""
    random = np.random.default_rng(int(np.ptp(ring) * 1e6))
    return ring + random.normal(scale=VERTEX_NOISE, size=ring.shape)


def drawn(condition: Condition, seeds: Sequence[int]) -> list[Problem]:
    """Problems as the studies draw them."""
    problems = [draw_problem(perspective_setup(), condition, seed) for seed in seeds]
    return [(problem.camera, problem.image_regions, problem.world_regions) for problem in problems]


def masked(seeds: Sequence[int]) -> list[Problem]:
    """Problems on masks with errors."""
    return drawn(Condition(planes=REGIONS, noise=MASK_ERRORS), seeds)


def scanned(seeds: Sequence[int], scan: Scan) -> list[Problem]:
    """Problems of a lidar, by all beams as samples or by outlines of the regions' points."""
    setting = Condition(planes=REGIONS, templates="asymmetric", lidar_beams=BEAMS, range_noise_m=RANGE_NOISE_M)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SparseSamplingWarning)
        return drawn(replace(setting, scan=scan), seeds)


def whole_masks(seeds: Sequence[int]) -> list[NDArray[Any]]:
    """A whole mask of each of the first seeds."""
    regions = [images[0] for _, images, _ in masked(seeds[:MASKS])]
    return [region.mask.full() for region in regions if region.mask is not None]


def batch(problems: Sequence[Problem], reference: str = "solvePnP") -> Row:
    """The batch on one thread."""
    return Row(lambda: rp.estimate_poses(problems, threads=1), len(problems), reference)


def single(problems: Sequence[Problem]) -> Row:
    """One call for each."""
    return Row(lambda: [rp.estimate_pose(*problem) for problem in problems], len(problems), "solvePnP")


def traced(masks: Sequence[NDArray[Any]]) -> Row:
    """The contours of masks."""
    return Row(lambda: [rp.ImageRegion.from_mask(mask) for mask in masks], len(masks), "findContours")


def pnp(scenes: Sequence[Outlined]) -> Row:
    """OpenCV's iterative PnP on the vertices."""
    points = [
        (
            np.concatenate(scene.world),
            np.concatenate(scene.image),
            scene.camera.matrix,
            np.array(scene.camera.distortion) if scene.camera.distortion else None,
        )
        for scene in scenes
    ]
    flags = cv2.SOLVEPNP_ITERATIVE
    return Row(lambda: [cv2.solvePnP(*held, flags=flags) for held in points], len(points), "")


def contours(masks: Sequence[NDArray[Any]]) -> Row:
    """OpenCV's contours of masks."""
    pixels = [mask.view(np.uint8) for mask in masks]
    kind = (cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return Row(lambda: [cv2.findContours(mask, *kind) for mask in pixels], len(pixels), "")


ROWS = ("batch", "noisy", "single", "distorted", "bitten", "masks", "from_mask", "samples")


def rows_of(names: Sequence[str], seeds: Sequence[int]) -> tuple[dict[str, Row], dict[str, Row]]:
    """The chosen rows and what they are compared with."""
    scenes = [Outlined.of_seed(seed) for seed in seeds]
    distorted = [Outlined.of_seed(seed, DISTORTED) for seed in seeds]
    masks = whole_masks(seeds) if "from_mask" in names else []
    make: dict[str, Callable[[], Row]] = {
        "batch": lambda: batch([scene.problem() for scene in scenes]),
        "noisy": lambda: batch([scene.problem(noisy) for scene in scenes]),
        "single": lambda: single([scene.problem() for scene in scenes]),
        "distorted": lambda: batch([scene.problem() for scene in distorted], "solvePnP (k)"),
        "bitten": lambda: batch([scene.problem(bitten) for scene in scenes]),
        "masks": lambda: batch(masked(seeds)),
        "from_mask": lambda: traced(masks),
        "samples": lambda: batch(scanned(seeds, "samples"), "outlines"),
    }
    rows = {name: make[name]() for name in ROWS if name in names}
    references: dict[str, Callable[[], Row]] = {
        "solvePnP": lambda: pnp(scenes),
        "solvePnP (k)": lambda: pnp(distorted),
        "findContours": lambda: contours(masks),
        "outlines": lambda: batch(scanned(seeds, "outline")),
    }
    return rows, {name: references[name]() for name in {row.reference for row in rows.values()}}


def milliseconds(row: Row) -> float:
    """Wall time of one pose or mask."""
    start = time.perf_counter()
    row.run()
    return 1e3 * (time.perf_counter() - start) / row.items


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=ROWS)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=11)
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    rows, references = rows_of(arguments.rows, range(arguments.scenes))
    rounds = [
        {name: milliseconds(row) for name, row in {**references, **rows}.items()} for _ in range(arguments.rounds)
    ]
    print(f"regionpose {rp.__version__}, cv2 {cv2.__version__}, {arguments.scenes} scenes, {arguments.rounds} rounds\n")
    print(f"{'row':<10} {'ms':>8}  {'over':<12} {'ms':>8} {'ratio':>7}")
    for name, row in rows.items():
        ours, theirs = ([times[key] for times in rounds] for key in (name, row.reference))
        ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
        medians = statistics.median(ours), statistics.median(theirs)
        print(f"{name:<10} {medians[0]:>8.3f}  {row.reference:<12} {medians[1]:>8.3f} {ratio:>7.2f}")


if __name__ == "__main__":
    main()
