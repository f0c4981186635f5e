"""Pictures that show how well a pose fits: projected regions over observed contours, and a cloud colored by depth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from regionpose.cameras import Camera
from regionpose.fusion.colors import SeenPoints, seen_points
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.core_inputs import check_camera
from regionpose.solve.edge_diagnostics import Alignment
from regionpose.solve.sample_fit import SampleFit, sample_fit
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import Array, checked_image
from regionpose.viz.depths import checked_limits, depth_colors, draw_depths, with_bar
from regionpose.viz.labels import annotated
from regionpose.viz.pens import CASING, Bytes, Color, draw_dots, draw_lines
from regionpose.viz.projections import projected_lines, projected_rings, repeated, visible_pieces

__all__ = ["depth_colors", "overlay_depth", "overlay_edges", "overlay_regions", "projected_lines"]


OBSERVED: Color = (64, 176, 255)
PROJECTED: Color = (255, 140, 0)
AGREES: Color = (0, 230, 90)
DISAGREES: Color = (255, 0, 200)
OUTSIDE: Color = (255, 255, 255)
"""A blue, an orange and white: distinct with every common color blindness (after Okabe and Ito 2008)."""

LINE_FRACTION, DOT_FRACTION = 1 / 700, 1 / 1300
"""Width of a line and radius of a dot over the image's diagonal."""

EDGE_DOT_FRACTION = 1 / 600
"""Radius of a step's dot over the image's diagonal: seen without hiding the edge that it lies on."""

THINNEST_LINE = 1.5
"""Pixels; what is thinner can't be seen."""

BACKGROUND_FRACTION = 0.55
"""Brightness that is left of the gray image under a colored cloud."""


@checked_arguments
def overlay_regions(
    camera: Camera,
    image: ArrayLike,
    image_regions: Sequence[ImageRegion] | None,
    world_regions: Sequence[WorldRegion],
    pose: Pose,
    labels: Sequence[str] = (),
) -> Bytes:
    """The image (h, w, 3) with the projected regions' contours over the observed ones.

    Of regions with samples those are drawn as well that lie on the wrong side of the observed contour: orange ones
    belong within it, white ones beyond. Edges are followed through the camera's distortion; parts that it doesn't see
    are left out.

    Parameters
    ----------
    camera : Camera
        That took the image.
    image : (h, w) or (h, w, 3) array
        uint8, uint16 or floats in [0, 1].
    image_regions : sequence of ImageRegion or None
        The observed ones.
    world_regions : sequence of WorldRegion
        The projected ones.
    pose : Pose
        `camera_from_world`.
    labels : sequence of str
        Written beside each region; its number without.

    Raises
    ------
    ValueError
        Where the numbers of regions and labels differ, and for an image or a mask of another size than the camera's.
    """
    picture = checked_image(image).copy()
    camera.check_size(picture.shape)
    observed = _checked_pairs(camera, image_regions, world_regions, labels)
    width = max(THINNEST_LINE, LINE_FRACTION * float(np.hypot(*picture.shape[:2])))
    projected = [projected_rings(camera, region, pose) for region in world_regions]
    lines = repeated(camera, [np.concatenate([ring, ring[:1]]) for region in observed for ring in region.rings])
    _draw_outlines(picture, lines, [ring for region in projected for ring in region], width)
    pairs = zip(observed, world_regions, strict=False)
    fits = [fit for pair in pairs if (fit := sample_fit(camera, *pair, pose)) is not None]
    _draw_samples(picture, fits, width)
    names = list(labels) or [f"region {k}" for k in range(len(world_regions))]
    legend = [("observed", OBSERVED)] if observed else []
    legend += [("projected, samples beyond", PROJECTED), ("samples within", OUTSIDE)] if fits else []
    legend += [] if fits else [("projected", PROJECTED)]
    return annotated(picture, names, projected, lines, legend, width)


def _draw_outlines(picture: Bytes, observed: Sequence[Array], projected: Sequence[Array], width: float) -> None:
    """Draw lines (n, 2) of pixels in place, and over them, thinner, rings that may hold NaN."""
    arcs = visible_pieces(projected)
    draw_lines(picture, [*observed, *arcs], 2.8 * width, CASING, 0.55)
    draw_lines(picture, observed, 2.0 * width, OBSERVED)
    draw_lines(picture, arcs, width, PROJECTED)


def _draw_samples(picture: Bytes, fits: Sequence[SampleFit], width: float) -> None:
    """Draw the samples on the wrong side of their region's contour, in place."""
    for wrong, color in (([fit.beyond for fit in fits], PROJECTED), ([fit.within for fit in fits], OUTSIDE)):
        places = np.concatenate([np.empty((0, 2)), *wrong])
        draw_dots(picture, places, 2.0 * width, CASING)
        draw_dots(picture, places, 1.4 * width, color)


def _checked_pairs(
    camera: Camera,
    image_regions: Sequence[ImageRegion] | None,
    world_regions: Sequence[WorldRegion],
    labels: Sequence[str],
) -> list[ImageRegion]:
    observed = check_camera(camera, image_regions or [])
    for name, count in (("image regions", len(observed)), ("labels", len(labels))):
        if count not in {0, len(world_regions)}:
            raise ValueError(f"there are {count} {name} and {len(world_regions)} world regions; needed as many of both")
    return observed


@checked_arguments
def overlay_depth(
    camera: Camera,
    image: ArrayLike,
    points: ArrayLike,
    pose: Pose,
    *,
    limits_m: tuple[float, float] | None = None,
    radius_px: float | None = None,
) -> Bytes:
    """The image, gray and dimmed, with world points colored by their distance from the camera, and a strip with the
    scale beside its right side: (h, w + strip, 3).

    Points behind others are left out, as in `colorize`, and near ones lie over far ones. The colors run evenly in
    lightness and hue over the logarithm of the distance, light is near; the scale shows meters.

    Parameters
    ----------
    camera : Camera
        That took the image.
    image : (h, w) or (h, w, 3) array
        uint8, uint16 or floats in [0, 1].
    points : (n, 3) array
        World coordinates.
    pose : Pose
        `camera_from_world`.
    limits_m : tuple of 2 float, optional
        Nearest and farthest distance of the scale; percentiles 1 and 99 by default.
    radius_px : float, optional
        Of a dot; by the image's size by default.

    Raises
    ------
    ValueError
        For limits that aren't increasing and positive, and for an image of another size than the camera's.
    """
    colors = checked_image(image)
    camera.check_size(colors.shape)
    seen = seen_points(camera, points, pose, colors.shape[:2])
    return overlay_seen(colors, seen, limits_m=limits_m, radius_px=radius_px)


def overlay_seen(
    image: ArrayLike,
    seen: SeenPoints,
    *,
    limits_m: tuple[float, float] | None = None,
    radius_px: float | None = None,
) -> Bytes:
    """As `overlay_depth`, of what the image's camera sees of the points."""
    colors = checked_image(image)
    indices = np.flatnonzero(seen.visible & (seen.distances > 0.0))
    distances = seen.distances[indices]
    limits = checked_limits(limits_m, distances)
    dot = DOT_FRACTION * float(np.hypot(*colors.shape[:2])) if radius_px is None else radius_px
    picture = _dimmed(colors)
    draw_depths(picture, seen.pixels[indices], distances, dot, limits)
    return with_bar(picture, *limits)


def overlay_edges(image: ArrayLike, alignment: Alignment) -> Bytes:
    """The image (h, w, 3) with the steps of an `Alignment`: green where an edge of the photo stands out, magenta
    where none does.
    """
    picture = checked_image(image).copy()
    radius = EDGE_DOT_FRACTION * float(np.hypot(*picture.shape[:2]))
    for agrees, color in ((False, DISAGREES), (True, AGREES)):
        draw_dots(picture, alignment.places[alignment.agrees == agrees], radius, color)
    return picture


def _dimmed(colors: Bytes) -> Bytes:
    """The image in gray, (h, w, 3), its brightness reduced."""
    levels = np.round(BACKGROUND_FRACTION * np.arange(256)).astype(np.uint8)
    gray = levels[np.asarray(Image.fromarray(colors).convert("L"))]
    return np.repeat(gray[..., None], 3, axis=2)
