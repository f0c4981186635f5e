"""Regions grown from one seed on rendered images, against the exact coverage.

Each row draws scenes of the synthetic benchmark, paints every region and the background with a color, a shading and a
texture of its own, blurs as a lens does, adds sensor noise, and grows each region from the pixel deepest inside it.
Run as `python -m benchmarks.image_segmentation`.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from regionpose import ImageRegion, WorldRegion, estimate_pose
from regionpose.io import mask_from_file
from regionpose.segment import grow_image_region
from scipy import ndimage
from skimage.color import lab2rgb

from benchmarks.synthetic import SyntheticScene, fisheye_scene, perspective_scene, pose_errors

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PLANES = 2
FAILED_IOU = 0.9
BLUR_PX = 0.8
"""Standard deviation of the lens's blur, pixels."""

SAMPLING_PX = 0.5
"""Step along a contour at which its distance from the true one is taken."""

DEMO = Path(__file__).parents[1] / "python" / "regionpose" / "demo" / "files"


class Row(NamedTuple):
    """How one row's images are made: CIELAB difference of the colors, their texture, noise in levels of 255."""

    name: str
    scene: Callable[..., SyntheticScene]
    contrast: float
    texture: float
    noise: float


ROWS = (
    Row("plain", perspective_scene, 40.0, 2.0, 2.0),
    Row("noisy", perspective_scene, 40.0, 2.0, 8.0),
    Row("low contrast", perspective_scene, 20.0, 2.0, 2.0),
    Row("low contrast, noisy", perspective_scene, 20.0, 2.0, 8.0),
    Row("textured", perspective_scene, 40.0, 6.0, 2.0),
    Row("fisheye, plain", fisheye_scene, 40.0, 2.0, 2.0),
    Row("fisheye, textured", fisheye_scene, 40.0, 6.0, 2.0),
)


class Quality(NamedTuple):
    """One grown region against the true one: overlap, and distances of its contour (pixels, positive outside)."""

    iou: float
    offset: float
    spread: float


def texture(height: int, width: int, rng: np.random.Generator) -> Array:
    """Noise (h, w) of unit spread: patches of about 60, 15 and 4 px, on a shading across the image of the same size."""
    total = np.zeros((height, width))
    for size in (60, 15, 4):
        patches = rng.normal(size=(height // size + 2, width // size + 2)).astype(np.float32)
        total += np.asarray(Image.fromarray(patches).resize((width, height), Image.Resampling.BICUBIC))
    down, right = rng.normal(size=2)
    shading = down * np.linspace(-1.0, 1.0, height)[:, None] + right * np.linspace(-1.0, 1.0, width)
    return np.asarray(total / total.std() + shading)


def painted(scene: SyntheticScene, coverages: list[Array], row: Row, rng: np.random.Generator) -> NDArray[np.uint8]:
    """The image (h, w, 3) of a scene, sRGB."""
    height, width = coverages[0].shape
    ground = np.array([rng.uniform(35.0, 65.0), *rng.uniform(-20.0, 20.0, size=2)])
    light = linear_of(ground, row.texture * texture(height, width, rng))
    for coverage in coverages:
        direction = rng.normal(size=3)
        color = ground + row.contrast * direction / np.linalg.norm(direction)
        rows, columns = np.nonzero(coverage)
        window = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
        share = coverage[window][..., None]
        surface = linear_of(color, row.texture * texture(share.shape[0], share.shape[1], rng))
        light[window] = share * surface + (1.0 - share) * light[window]
    blurred = ndimage.gaussian_filter(light, (BLUR_PX, BLUR_PX, 0))
    levels = np.where(blurred <= 0.0031308, 12.92 * blurred, 1.055 * np.maximum(blurred, 0.0) ** (1 / 2.4) - 0.055)
    noisy = 255.0 * levels + rng.normal(0.0, row.noise, levels.shape)
    return np.clip(np.round(noisy), 0.0, 255.0).astype(np.uint8)


def linear_of(color: Array, lightness: Array) -> Array:
    """Linear light (h, w, 3) of a CIELAB color whose lightness is changed by `lightness`."""
    steps = np.linspace(0.0, 100.0, 256)
    lab = np.column_stack([steps, np.full(256, color[1]), np.full(256, color[2])])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # Colors outside sRGB are clipped.
        srgb = np.clip(lab2rgb(lab[None])[0], 0.0, 1.0)
    table = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    value = np.clip(color[0] + lightness, 0.0, 100.0)
    return np.stack([np.interp(value, steps, table[:, channel]) for channel in range(3)], axis=-1)


def deepest(mask: Mask) -> tuple[int, int]:
    """Pixel (x, y) of a mask farthest from its outline."""
    rows, columns = np.nonzero(mask)
    top, left = rows.min(), columns.min()
    depth = ndimage.distance_transform_edt(np.pad(mask[top : rows.max() + 1, left : columns.max() + 1], 1))
    y, x = np.unravel_index(np.argmax(depth), depth.shape)
    return int(x + left - 1), int(y + top - 1)


def quality(grown: NDArray[np.float32], truth: shapely.Polygon, mask: Mask) -> Quality:
    """How well a grown coverage matches a true outline and its mask."""
    held = grown >= 0.5
    iou = float((held & mask).sum() / (held | mask).sum())
    lines = [shapely.segmentize(shapely.LinearRing(ring), SAMPLING_PX) for ring in ImageRegion.from_mask(grown).rings]
    points = shapely.points(np.concatenate([shapely.get_coordinates(line) for line in lines]))
    shapely.prepare(truth)
    distances = shapely.distance(points, truth.boundary) * np.where(shapely.contains(truth, points), -1.0, 1.0)
    return Quality(iou, float(np.mean(distances)), float(np.std(distances)))


def run_scene(row: Row, seed: int) -> tuple[list[Quality], tuple[float, ...], tuple[float, ...], float]:
    """Quality of each region; rotation (deg) and position (mm) error of grown and of exact masks; seconds a region."""
    scene = row.scene(seed, PLANES, study="image segmentation")
    coverages = scene.coverages()
    image = painted(scene, coverages, row, np.random.default_rng(seed))
    qualities, grown, seconds = [], [], 0.0
    for coverage, rings in zip(coverages, scene.image_rings, strict=True):
        start = time.process_time()
        shares = grow_image_region(image, deepest(coverage >= 0.5), fill_holes=len(rings) == 1, coverage=True)
        seconds += (time.process_time() - start) / len(coverages)
        qualities.append(quality(shares, shapely.Polygon(rings[0], rings[1:]), coverage >= 0.5))
        grown.append(shares)
    return qualities, errors(scene, grown), errors(scene, coverages), seconds


def errors(scene: SyntheticScene, coverages: Sequence[NDArray[np.floating[Any]]]) -> tuple[float, ...]:
    """Rotation error (deg) and position error at the anchor (mm) of the pose that coverages give."""
    world = [WorldRegion.from_polygon(rings) for rings in scene.regions]
    pose = estimate_pose(scene.camera, [ImageRegion.from_mask(coverage) for coverage in coverages], world).pose
    found = pose_errors(pose.rotation.as_matrix(), pose.translation, scene.rotation, scene.translation, scene.anchor)
    return found.rotation_deg, 1e3 * found.translation_m


def print_row(row: Row, scenes: int) -> None:
    """Print one line of the table."""
    results = [run_scene(row, seed) for seed in range(scenes)]
    regions = np.array([entry for qualities, *_ in results for entry in qualities])
    grown, exact = (np.median([result[k] for result in results], axis=0) for k in (1, 2))
    iou, offset, spread = np.median(regions, axis=0)
    failed = np.mean(regions[:, 0] < FAILED_IOU)
    print(
        f"{row.name:20s} {iou:7.4f} {offset:+7.3f} {spread:7.3f} {100 * failed:6.1f} %"
        f" {grown[0]:9.4f} {exact[0]:9.4f} {grown[1]:8.2f} {exact[1]:8.2f} {np.mean([r[3] for r in results]):6.2f}",
        flush=True,
    )


def print_demo() -> None:
    """Print the demo's regions against its label picture."""
    image = np.asarray(Image.open(DEMO / "image.jpg"))
    print("\ndemo              IoU  offset  spread")
    for region in json.loads((DEMO / "regions.json").read_text(encoding="utf-8"))["regions"]:
        mask = mask_from_file(DEMO / "labels.png", region["label"])
        ring = shapely.Polygon(ImageRegion.from_mask(mask).rings[0])
        found = quality(grow_image_region(image, region["seed_pixel"], coverage=True), ring, mask)
        print(f"{region['name']:14s} {found.iou:.4f} {found.offset:+7.3f} {found.spread:7.3f}")


def real_regions(folder: Path) -> Iterator[tuple[str, Path, list[Array]]]:
    """Image file and outer and inner rings of every region of the real scenes."""
    for file in sorted(folder.glob("**/regions.json")):
        picture = next((path for path in sorted(file.parent.glob("image.*"))), None)
        regions = json.loads(file.read_text(encoding="utf-8"))
        for region in regions["regions"] if isinstance(regions, dict) else regions:
            rings = region.get("image") or region.get("image_polygon") or region.get("image_rings")
            if picture is not None and rings is not None:
                listed = rings if isinstance(rings[0][0], list) else [rings]
                name = f"{file.parent.relative_to(folder)} {region.get('name', '')}"
                yield name, picture, [np.asarray(ring, dtype=np.float64) for ring in listed]


def print_real(folder: Path) -> None:
    """Print the overlap with the outlines drawn by hand on real images."""
    print("\nreal scene: IoU with the polygon, region's size in px")
    found = False
    for name, picture, rings in real_regions(folder):
        found = True
        with Image.open(picture) as opened:
            image = np.asarray(opened.convert("RGB"))
        drawing = Image.new("1", image.shape[1::-1])
        for level, ring in zip((1, *[0] * len(rings)), rings, strict=False):
            ImageDraw.Draw(drawing).polygon([(float(x), float(y)) for x, y in ring], fill=level)
        mask = np.asarray(drawing)
        grown = grow_image_region(image, deepest(mask))
        print(f"{name:45s} {(grown & mask).sum() / (grown | mask).sum():.3f} {mask.sum():8d}")
    if not found:
        print(f"none in {folder}")


def print_large() -> None:
    """Print processor time and memory at 24 megapixels, of regions that take 2 % and half of the image."""
    noise = np.random.default_rng(0).integers(0, 9, size=(4000, 6000, 3), dtype=np.uint8)
    for radius in (390, 1955):
        picture = Image.new("L", (6000, 4000), 86)
        ImageDraw.Draw(picture).ellipse([3000 - radius, 2000 - radius, 3000 + radius, 2000 + radius], fill=146)
        image = noise + np.asarray(picture)[..., None]
        before, start = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
        mask = grow_image_region(image, (3000, 2000), coverage=True)
        seconds = time.process_time() - start
        peak = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e6
        print(
            f"24 Mpx, {100 * mask.mean():4.1f} % of them: {seconds:.2f} s, peak {peak:.2f} GB over what was held before"
        )


def main() -> None:
    """Read the command line and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", type=int, default=100, help="scenes in each row")
    parser.add_argument("--row", choices=[row.name for row in ROWS], help="one row alone")
    parser.add_argument("--real", type=Path, help="folder with real scenes (regions.json beside an image)")
    parser.add_argument("--only", choices=["large", "demo", "real"], help="no rendered scenes, one other part alone")
    options = parser.parse_args()
    if options.only in (None, "large") and options.row is None:
        print_large()
    if options.only is None:
        print("\nrendered               IoU  offset  spread   failed   rot deg     exact   pos mm    exact  cpu s")
        for row in ROWS:
            if options.row in (None, row.name):
                print_row(row, options.scenes)
    if options.only in (None, "demo") and options.row is None:
        print_demo()
    if options.only in (None, "real") and options.row is None and options.real:
        print_real(options.real)


if __name__ == "__main__":
    main()
