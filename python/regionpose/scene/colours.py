"""The image and the cloud on each other: which points the camera sees, their colours, and their depths over the
image.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, minimum_filter

from regionpose.cameras import Camera
from regionpose.clouds import Cloud
from regionpose.pose import Pose

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Picture = NDArray[np.uint8]

VISIBLE_FIELD = "visible"

HIDDEN_SHARE = 0.10
"""A point further away than its neighbours in the image by this share is behind them: more than a slanted surface
falls off
between neighbouring points, less than what separates an object from what it stands before."""

CELL_SPACINGS = 1.5
"""Side of a cell of the depth buffer in mean spacings of the points in the image, so that few cells of a surface are
empty."""

LARGEST_CELL = 24.0
"""Largest side of a cell, pixels: beyond it a sparse cloud hides nothing reliably."""

DOT_SHARE = 1.0 / 900.0
"""Radius of a point's dot over the picture's larger side."""

NEAR_PERCENTILE, FAR_PERCENTILE = 2.0, 98.0
"""Percentiles of the depth at the ends of the colour scale, so that single points do not stretch it."""

DIMMED = 0.45
"""Brightness of the image below the dots."""

SCALE = np.array([[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [110, 40, 140]], dtype=np.float64)
"""Colours from near to far; their brightness falls, so that they can be told apart without hue."""


def coloured_cloud(cloud: Cloud, picture: Picture, camera: Camera, pose: Pose) -> tuple[Cloud, Flags]:
    """The cloud with the colours of a picture (h, w, 3), and which points (n,) the camera sees.

    `pose` is for points about the cloud's origin. Points that are outside the picture or hidden by others keep their
    colour, or are
    black; the field `visible` (0, 1) tells.
    """
    pixels, visible = seen_pixels(cloud.points, picture.shape[:2], camera, pose)
    colours = np.zeros((len(cloud), 3), dtype=np.uint8) if cloud.colours is None else cloud.colours.copy()
    places = pixels[visible].T[::-1]
    for channel in range(3):
        sampled = map_coordinates(picture[:, :, channel].astype(np.float32), places, order=1, mode="nearest")
        colours[visible, channel] = np.clip(np.rint(sampled), 0, 255)
    fields = {**cloud.fields, VISIBLE_FIELD: visible.astype(np.uint8)}
    return replace(cloud, colours=colours, fields=fields), visible


def seen_pixels(points: Array, shape: tuple[int, ...], camera: Camera, pose: Pose) -> tuple[Array, Flags]:
    """Pixels (n, 2) of points (n, 3), and which are inside an image of `shape` (h, w) and not hidden by nearer ones."""
    seen = pose.transform(points)
    pixels = camera.project(seen)
    with np.errstate(invalid="ignore"):
        inside: Flags = np.all((pixels >= -0.5) & (pixels < [shape[1] - 0.5, shape[0] - 0.5]), axis=1)
    visible: Flags = inside.copy()
    visible[inside] = _in_front(pixels[inside], np.linalg.norm(seen[inside], axis=1), shape)
    return pixels, visible


def _in_front(pixels: Array, ranges: Array, shape: tuple[int, ...]) -> Flags:
    """Which points are not behind others in their cell of the image or in the ones around it."""
    if not len(pixels):
        return np.zeros(0, dtype=np.bool_)
    side = float(np.clip(CELL_SPACINGS * np.sqrt(shape[0] * shape[1] / len(pixels)), 1.0, LARGEST_CELL))
    columns, rows = ((pixels + 0.5) / side).astype(np.intp).T
    nearest = np.full((int(shape[0] / side) + 1, int(shape[1] / side) + 1), np.inf)
    np.minimum.at(nearest, (rows, columns), ranges)
    around = minimum_filter(nearest, size=3, mode="nearest")
    return np.asarray(ranges <= (1.0 + HIDDEN_SHARE) * around[rows, columns])


def overlay_depth(picture: Picture, points: Array, camera: Camera, pose: Pose) -> Picture:
    """The picture (h, w, 3), dimmed, with the points that the camera sees as dots from yellow (near) to violet
    (far).
    """
    from PIL import Image, ImageDraw

    pixels, visible = seen_pixels(points, picture.shape[:2], camera, pose)
    canvas = Image.fromarray((DIMMED * picture).astype(np.uint8))
    if not visible.any():
        return np.asarray(canvas)
    ranges = np.linalg.norm(pose.transform(points[visible]), axis=1)
    colours = depth_colours(ranges)
    radius = max(1.0, DOT_SHARE * max(picture.shape[:2]))
    draw = ImageDraw.Draw(canvas)
    places = pixels[visible]
    for k in np.argsort(-ranges):
        (x, y), colour = places[k], colours[k]
        draw.ellipse(
            [x - radius, y - radius, x + radius, y + radius], fill=(int(colour[0]), int(colour[1]), int(colour[2]))
        )
    return np.asarray(canvas)


def depth_colours(depths: Array) -> Picture:
    """Colours (n, 3) of depths (n,): the scale spans their 2nd to 98th percentile."""
    near, far = np.percentile(depths, [NEAR_PERCENTILE, FAR_PERCENTILE])
    share = np.clip((depths - near) / max(float(far - near), np.finfo(float).tiny), 0.0, 1.0)
    steps = np.linspace(0.0, 1.0, len(SCALE))
    return np.stack([np.interp(share, steps, SCALE[:, channel]) for channel in range(3)], axis=1).astype(np.uint8)
