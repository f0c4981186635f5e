"""Pictures of a pose: the regions of the world drawn onto the image beside those that were observed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from regionpose.cameras import Camera
from regionpose.pose import Pose
from regionpose.regions import ImageRegion, WorldRegion

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

OBSERVED = (0, 114, 178)
"""Blue of the observed contours; with the orange it can be told apart by every kind of colour vision."""

PREDICTED = (255, 159, 0)
"""Orange of the projected regions."""

STEP_SHARE = 0.01
"""Edges of a projected ring are split into parts of this share of its extent, so that distortion bends them."""

SUPERSAMPLING = 2
"""The picture is drawn at this multiple of its size and reduced, which smooths lines."""

LINE_SHARE = 1.0 / 500.0
"""Width of a line over the picture's larger side."""

TEXT_SHARE = 1.0 / 55.0
"""Height of text over the picture's larger side."""


def projected_rings(camera: Camera, pose: Pose, region: WorldRegion) -> list[Array]:
    """The rings of a world region in the image, (m, 2) pixels each, without the points that the camera does not see."""
    rings = []
    for ring in region.rings:
        pixels = camera.project(pose.transform(_split(ring)))
        rings.append(pixels[np.isfinite(pixels).all(axis=1)])
    return rings


def overlay_regions(
    image: ArrayLike,
    camera: Camera,
    pose: Pose,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    labels: Sequence[str] = (),
) -> Picture:
    """The image (h, w) or (h, w, 3) uint8 with observed contours in blue and projected regions in orange, (h, w, 3).

    `labels`: a text for each region, written at its projection. ValueError for an image of another shape or type.
    """
    picture = Image.fromarray(_colour_image(image))
    size = picture.size
    picture = picture.resize((size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING), Image.Resampling.BICUBIC)
    draw = ImageDraw.Draw(picture)
    width = max(1, round(LINE_SHARE * max(picture.size)))
    for region in image_regions:
        for ring in region.rings:
            _draw_ring(draw, ring, OBSERVED, 2 * width)
    projections = [projected_rings(camera, pose, region) for region in world_regions]
    for ring in (ring for rings in projections for ring in rings):
        _draw_ring(draw, ring, PREDICTED, width)
    font = ImageFont.load_default(TEXT_SHARE * max(picture.size))
    for rings, label in zip(projections, labels, strict=False):
        if len(rings[0]):
            _write(draw, _canvas(rings[0].mean(axis=0)), label, font)
    _draw_legend(draw, font)
    return np.asarray(picture.resize(size, Image.Resampling.BOX))


def save_png(path: str | os.PathLike[str], picture: Picture, *, overwrite: bool = False) -> Path:
    """Write a picture (h, w, 3) uint8 whole or not at all; FileExistsError unless `overwrite`."""
    target = Path(path)
    if target.exists() and not overwrite:
        raise FileExistsError(f"{target} exists; needed a new name or overwrite=True")
    with tempfile.NamedTemporaryFile(dir=target.parent, suffix=".png", delete=False) as file:
        temporary = Path(file.name)
    try:
        Image.fromarray(picture).save(temporary)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)
    return target


def _colour_image(image: ArrayLike) -> Picture:
    given = np.asarray(image)
    if given.dtype != np.uint8 or given.ndim not in (2, 3) or (given.ndim == 3 and given.shape[2] != 3):
        raise ValueError(f"image has shape {given.shape} and type {given.dtype}; needed (h, w) or (h, w, 3) uint8")
    return np.repeat(given[:, :, None], 3, axis=2) if given.ndim == 2 else given


def _split(ring: Array) -> Array:
    """A closed ring (n, 3) with its edges split into short parts."""
    step = STEP_SHARE * float(np.ptp(ring, axis=0).max())
    following = np.roll(ring, -1, axis=0)
    counts = np.maximum(np.ceil(np.linalg.norm(following - ring, axis=1) / step), 1.0).astype(np.int64)
    parts = [
        start + (end - start) * (np.arange(count) / count)[:, None]
        for start, end, count in zip(ring, following, counts, strict=True)
    ]
    return np.concatenate(parts)


def _canvas(pixels: Array) -> Array:
    """Places on the enlarged picture: an integer pixel is its pixel's centre."""
    return (pixels + 0.5) * SUPERSAMPLING


def _draw_ring(draw: ImageDraw.ImageDraw, ring: Array, colour: tuple[int, int, int], width: int) -> None:
    places = _canvas(ring)
    if len(places) > 1:
        draw.line([tuple(place) for place in (*places, places[0])], fill=colour, width=width, joint="curve")


def _write(
    draw: ImageDraw.ImageDraw, place: Array, text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont
) -> None:
    """White text with a dark rim, its middle at `place`."""
    rim = max(2, round(LINE_SHARE * max(draw.im.size)))
    draw.text(tuple(place), text, fill="white", font=font, anchor="mm", stroke_width=rim, stroke_fill="black")


def _draw_legend(draw: ImageDraw.ImageDraw, font: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> None:
    """A dark panel at the upper left with a line and a word for each colour."""
    height = TEXT_SHARE * max(draw.im.size)
    draw.rectangle([height, height, 9.5 * height, 4.6 * height], fill=(32, 32, 32))
    for row, (text, colour) in enumerate((("observed", OBSERVED), ("projected", PREDICTED))):
        middle = (2.0 + 1.6 * row) * height
        draw.line([(1.6 * height, middle), (3.4 * height, middle)], fill=colour, width=max(2, round(0.2 * height)))
        draw.text((4.0 * height, middle), text, fill=(255, 255, 255), font=font, anchor="lm")
