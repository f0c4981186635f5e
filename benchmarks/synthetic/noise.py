"""Disturbances of the benchmark: segmentation error, occlusion, truncation, calibration error.

Each function returns a new object, changes none of its inputs, and draws only from the generator it is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from regionpose.cameras import Camera
from scipy.optimize import brentq
from shapely.geometry.base import BaseGeometry
from skimage.measure import find_contours

from benchmarks.synthetic.masks import Array, Window
from benchmarks.synthetic.planar import PlaneFrame, area_vector, as_multipolygon

Mask = NDArray[np.bool_]

# Side of a segmentation-error square, as a share of the square root of the region's area. The first holds up to a fifth
# of the area; beyond that squares grow with the share (second figure): they change only a band of their own width.
SQUARE_SIDE_SHARE = 0.1
SQUARE_SIDE_GROWTH = 0.5
# Squares are laid until their sides add up to so many boundary lengths; then the band beside it is full (1 - e^-12).
MAX_BOUNDARY_COVER = 24.0
# Squares looked at first, in target areas: one changes about half of itself, and some of that twice.
SQUARES_LAID = 3.0
# Relative precision in length to which the last square and the edge of an occlusion are placed.
SHARE_PRECISION = 1e-9
# Grid of polygon operations as a share of the square root of the region's area: snapping to it keeps the many
# coinciding edges of squares and region from breaking an operation, and moves areas by about 1e-8.
GRID_SHARE = 1e-9
# How far a region that lies elsewhere is moved, as a share of the square root of its area.
MOVED_SHARE = 0.5


POLYGON_TYPES = (shapely.GeometryType.POLYGON, shapely.GeometryType.MULTIPOLYGON)


def _checked_share(share: float) -> float:
    if not 0.0 <= share < 1.0:
        raise ValueError(f"share is {share}; it must be at least 0 and under 1")
    return float(share)


def _checked_mask(mask: ArrayLike) -> Mask:
    array = np.asarray(mask)
    if array.ndim != 2 or array.dtype != np.bool_:
        raise ValueError(f"mask has shape {array.shape} and type {array.dtype}; needed is (height, width), bool")
    if not array.any():
        raise ValueError("mask is empty; a region of at least one pixel is needed")
    return array


def square_side(share: float, area: float, side_share: float | None = None) -> float:
    """Side of the squares that disturb a region of that area, in the unit of its square root.

    `side_share`: the side over that root; without it, one at which the share of the area can be reached.
    """
    if side_share is None:
        side_share = max(SQUARE_SIDE_SHARE, SQUARE_SIDE_GROWTH * share)
    return float(side_share * np.sqrt(area))


def points_along(rings: Sequence[Array], distances: Array) -> Array:
    """(n, 2) points at arc lengths `distances` (n,) along the (m, 2) closed rings, one ring after the other."""
    start = np.concatenate(rings)
    step = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings])
    lengths = np.hypot(step[:, 0], step[:, 1])
    ends = np.cumsum(lengths)
    edge = np.minimum(np.searchsorted(ends, distances, side="right"), len(ends) - 1)
    along = (distances - (ends[edge] - lengths[edge])) / np.where(lengths[edge] > 0.0, lengths[edge], 1.0)
    points: Array = start[edge] + along[:, None] * step[edge]
    return points


class Squares(NamedTuple):
    """Where segmentation errors fall: (n, 2) centers and (n,) whether each adds (True) or removes (False)."""

    centers: Array
    adds: Mask


def squares_along(rings: Sequence[Array], side: float, rng: np.random.Generator) -> Squares:
    """More squares than can be needed, uniform along the (m, 2) rings, each adding or removing with probability 1/2."""
    perimeter = sum(float(np.hypot(*(np.roll(ring, -1, axis=0) - ring).T).sum()) for ring in rings)
    count = int(np.ceil(MAX_BOUNDARY_COVER * perimeter / side)) + 1
    centers = points_along(rings, rng.uniform(0.0, perimeter, size=count))
    return Squares(centers, rng.random(count) < 0.5)


def mask_boundary(mask: Mask) -> list[Array]:
    """Closed (m, 2) rings, (x, y) in px, half-way between the pixels inside and outside a mask."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    region = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    corner = (columns[0] - 1.0, rows[0] - 1.0)
    contours = find_contours(np.pad(region, 1).astype(np.float64), 0.5)  # type: ignore[no-untyped-call]
    return [contour[:-1, ::-1] + corner for contour in contours]


def squares_on_mask(
    mask: ArrayLike,
    share: float,
    rng: np.random.Generator,
    side: float | None = None,
    boundary: Sequence[Array] | None = None,
) -> Mask:
    """The mask after squares were added or removed along its boundary until `share` of its area has changed.

    Exact to half a pixel: of the last square only as many pixels change as are needed. Pixels once changed stay so.
    `side`: px, else `square_side`. `boundary`: the (m, 2) rings along which squares lie, px, where they are known; else
    they are traced. ValueError when the squares are too small ever to reach the share.
    """
    region = _checked_mask(mask)
    target = round(_checked_share(share) * int(region.sum()))
    length = square_side(share, float(region.sum())) if side is None else _checked_side(side)
    changed = np.zeros_like(region)
    missing = target
    squares = squares_along(mask_boundary(region) if boundary is None else boundary, length, rng)
    for center, adds in zip(squares.centers, squares.adds, strict=True):
        if missing <= 0:
            break
        missing -= _change_square(region, changed, center, length, bool(adds), missing)
    if missing > 0:
        raise ValueError(_unreached(share, 1.0 - missing / target, length, "px"))
    return region ^ changed


def squares_painted(
    mask: ArrayLike, share: float, rng: np.random.Generator, side: float, boundary: Sequence[Array] | None = None
) -> Mask:
    """The mask after squares of `side` px were painted in or out along its boundary until `share` of its area differs.

    Each covers what was painted before: where all was painted nothing of the boundary is left.
    `boundary` as of `squares_on_mask`. ValueError when the squares are too small ever to reach the share.
    """
    region = _checked_mask(mask)
    target, length = _checked_share(share) * float(region.sum()), _checked_side(side)
    painted, most = region.copy(), 0
    squares = squares_along(mask_boundary(region) if boundary is None else boundary, length, rng)
    for center, adds in zip(squares.centers, squares.adds, strict=True):
        changed = int((painted ^ region).sum())
        most = max(most, changed)
        if changed >= target:
            return painted
        painted[_square_block(region, center, length)] = adds
    raise ValueError(_unreached(share, most / float(region.sum()) / share, length, "px"))


def _checked_side(side: float) -> float:
    if not side > 0.0:
        raise ValueError(f"square side is {side}; it must be positive")
    return float(side)


def _change_square(region: Mask, changed: Mask, center: Array, side: float, adds: bool, most: int) -> int:
    """Mark up to `most` pixels of one square as changed, in place; how many were."""
    block = _square_block(region, center, side)
    fresh = np.flatnonzero((region[block] != adds) & ~changed[block])[:most]
    changed[block][np.unravel_index(fresh, region[block].shape)] = True
    return len(fresh)


def _square_block(region: Mask, center: Array, side: float) -> tuple[slice, slice]:
    """The pixels of a square in a mask indexed [row, column]."""
    height, width = region.shape
    low = np.ceil(center - 0.5 * side).astype(int)
    high = np.maximum(np.ceil(center + 0.5 * side).astype(int), low + 1)
    left, top = np.clip(low, 0, (width, height)).tolist()
    right, bottom = np.clip(high, 0, (width, height)).tolist()
    return slice(top, bottom), slice(left, right)


def _unreached(share: float, reached: float, side: float, unit: str) -> str:
    return (
        f"squares of side {side:.4g} {unit} along the boundary changed {reached:.1%} of the {share:.1%} of the area"
        " asked for; a larger side or a smaller share is needed"
    )


def squares_on_region(
    rings: Sequence[Array], share: float, rng: np.random.Generator, side: float | None = None
) -> list[Array]:
    """(n, 3) rings of a planar region after squares were added or removed along its boundary, in its plane.

    `share` of its area has changed, to 1e-6 of it: the last square is shrunk to fit. Several outer rings are possible,
    each followed by its holes; outer rings turn as in the input. `side`: meters, else `square_side`.
    """
    frame = PlaneFrame.of_region(rings)
    grid = GRID_SHARE * np.sqrt(float(np.linalg.norm(area_vector(rings))))
    region = shapely.set_precision(frame.polygon(rings), grid)
    target = _checked_share(share) * region.area
    length = square_side(share, region.area) if side is None else _checked_side(side)
    squares = squares_along([frame.flat(ring) for ring in rings], length, rng)
    if target == 0.0:
        return frame.rings(region)
    pieces = _pieces_reaching(region, squares, length, target, grid)
    if pieces is None:
        reached = _union_area(changed_pieces(region, squares, length), grid) / target
        raise ValueError(_unreached(share, reached, length, "m"))
    count = len(pieces)
    before = as_multipolygon(shapely.union_all(pieces[: count - 1], grid_size=grid))
    while before.area > target:
        # Without the grid the union of touching squares may come out too small.
        count -= 1
        before = as_multipolygon(shapely.union_all(pieces[: count - 1], grid_size=grid))
    last = _fitting_piece(region, before, squares, count - 1, length, target - before.area, grid)
    changed = as_multipolygon(before.union(last, grid_size=grid))
    return frame.rings(region.symmetric_difference(changed, grid_size=grid))


def changed_pieces(region: BaseGeometry, squares: Squares, side: float) -> NDArray[np.object_]:
    """(n,) what each square alone changes of the plane: its part outside the region when it adds, inside otherwise."""
    corners = squares.centers - 0.5 * side
    boxes = shapely.box(corners[:, 0], corners[:, 1], corners[:, 0] + side, corners[:, 1] + side)
    pieces = np.empty(len(boxes), dtype=np.object_)
    pieces[squares.adds] = shapely.difference(boxes[squares.adds], region)
    pieces[~squares.adds] = shapely.intersection(boxes[~squares.adds], region)
    # A square that touches an edge leaves lines beside polygons, which the overlay refuses.
    for index in np.flatnonzero(~np.isin(shapely.get_type_id(pieces), POLYGON_TYPES)):
        pieces[index] = as_multipolygon(pieces[index])
    return pieces


def _pieces_reaching(
    region: BaseGeometry, squares: Squares, side: float, target: float, grid: float
) -> NDArray[np.object_] | None:
    """The least first pieces whose union has the target area; None when all of them have less."""
    laid = int(np.ceil(SQUARES_LAID * target / side**2))
    while True:
        pieces = changed_pieces(region, Squares(squares.centers[:laid], squares.adds[:laid]), side)
        area = _union_area(pieces, grid)
        if area >= target:
            return pieces[: _least_count(pieces, area, target, grid)]
        if laid >= len(squares.adds):
            return None
        laid *= 2


def _least_count(pieces: NDArray[np.object_], area: float, target: float, grid: float) -> int:
    """The least count of pieces whose union has the target area, all of them having `area`.

    The area of the union grows almost evenly with the count, so that it is looked for in proportion.
    """
    low, low_area, high, high_area = 0, 0.0, len(pieces), area
    while high - low > 1:
        share = (target - low_area) / (high_area - low_area)
        middle = int(np.clip(round(low + share * (high - low)), low + 1, high - 1))
        area = _union_area(pieces[:middle], grid)
        if area < target:
            low, low_area = middle, area
        else:
            high, high_area = middle, area
    return high


def _union_area(pieces: NDArray[np.object_], grid: float) -> float:
    try:
        return float(shapely.union_all(pieces).area)
    except shapely.GEOSException:
        # The grid is what coinciding edges need, at three times the cost.
        return float(shapely.union_all(pieces, grid_size=grid).area)


def _fitting_piece(
    region: BaseGeometry, before: BaseGeometry, squares: Squares, index: int, side: float, missing: float, grid: float
) -> BaseGeometry:
    """What a square shrunk about its center adds to the disturbance before it: the missing area."""
    # Squares that miss the target by a rounding leave nothing to place.
    if missing <= 0.0:
        return shapely.Polygon()
    center, adds = squares.centers[index], squares.adds[index]

    def piece(size: float) -> BaseGeometry:
        square = shapely.box(*(center - 0.5 * size), *(center + 0.5 * size))
        part = square.difference(region, grid_size=grid) if adds else square.intersection(region, grid_size=grid)
        left: BaseGeometry = as_multipolygon(part).difference(before, grid_size=grid)
        # Lines beside polygons, where the square touches what is there, are refused by the overlay.
        return as_multipolygon(left) if isinstance(left, shapely.GeometryCollection) else left

    if piece(side).area <= missing:
        return piece(side)
    return piece(brentq(lambda size: piece(size).area - missing, 0.0, side, xtol=SHARE_PRECISION * side))


def occlude_mask(mask: ArrayLike, share: float, rng: np.random.Generator) -> Mask:
    """The mask without the `share` of its pixels, to half a pixel, that lies furthest in a random direction."""
    region = _checked_mask(mask)
    rows, columns = np.nonzero(region)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    order = np.argsort(columns * np.cos(angle) + rows * np.sin(angle), kind="stable")
    hidden = order[len(order) - round(_checked_share(share) * len(order)) :]
    kept = region.copy()
    kept[rows[hidden], columns[hidden]] = False
    return kept


def occlude_region(rings: Sequence[Array], share: float, rng: np.random.Generator) -> list[Array]:
    """(n, 3) rings of a planar region without the `share` of its area, to 1e-6, that a random half plane hides."""
    frame = PlaneFrame.of_region(rings)
    region = frame.polygon(rings)
    kept_area = (1.0 - _checked_share(share)) * region.area
    angle = rng.uniform(0.0, 2.0 * np.pi)
    direction = np.array([np.cos(angle), np.sin(angle)])
    reach = 1.0 + float(max(np.linalg.norm(frame.flat(ring), axis=1).max() for ring in rings))

    across = reach * np.array([-direction[1], direction[0]])

    def kept(offset: float) -> BaseGeometry:
        near, far = -reach * direction, offset * direction
        return region.intersection(shapely.Polygon([near + across, near - across, far - across, far + across]))

    if share == 0.0:
        return [ring.copy() for ring in rings]
    return frame.rings(kept(brentq(lambda d: kept(d).area - kept_area, -reach, reach, xtol=SHARE_PRECISION * reach)))


def another_shape(rings: Sequence[Array], other: Sequence[Array], rng: np.random.Generator) -> list[Array]:
    """(n, 3) rings of `other`, a planar region too, in the place of a region: its plane, side, centroid and area.

    It is turned in the plane by any angle.
    """
    frame, shape = PlaneFrame.of_region(rings), PlaneFrame.of_region(other)
    scale = np.sqrt(np.linalg.norm(area_vector(rings)) / np.linalg.norm(area_vector(other)))
    turn = scale * _turn_in_plane(rng)
    return [frame.lifted(shape.flat(ring) @ turn.T) for ring in other]


def elsewhere(rings: Sequence[Array], rng: np.random.Generator) -> list[Array]:
    """(n, 3) rings of a planar region moved in its plane, by half the square root of its area, and turned at will."""
    frame = PlaneFrame.of_region(rings)
    angle = rng.uniform(0.0, 2.0 * np.pi)
    distance = MOVED_SHARE * np.sqrt(np.linalg.norm(area_vector(rings)))
    shift = distance * np.array([np.cos(angle), np.sin(angle)])
    turn = _turn_in_plane(rng)
    return [frame.lifted(frame.flat(ring) @ turn.T + shift) for ring in rings]


def _turn_in_plane(rng: np.random.Generator) -> Array:
    angle = rng.uniform(0.0, 2.0 * np.pi)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


class TruncatedMasks(NamedTuple):
    """Masks cut off by an image border, and the window of the image that is left."""

    masks: list[Mask]
    window: Window


def truncate_masks(masks: Sequence[ArrayLike], share: float, rng: np.random.Generator) -> TruncatedMasks:
    """All masks as seen by a smaller sensor, one random border of which cuts `share` of the first mask off.

    The border falls between two columns or rows, where the share cut is nearest to the one asked for. Masks keep their
    size; pixels outside the returned window are empty.
    """
    regions = [_checked_mask(mask) for mask in masks]
    if not regions:
        raise ValueError("no mask is given; at least one is needed")
    height, width = regions[0].shape
    axis, from_end = int(rng.integers(2)), bool(rng.integers(2))
    counts = regions[0].sum(axis=axis)
    lost = np.concatenate([[0], np.cumsum(counts[::-1] if from_end else counts)])
    border = int(np.argmin(np.abs(lost - _checked_share(share) * lost[-1])))
    size = len(counts)
    first, last = (0, size - border) if from_end else (border, size)
    window = Window(first, 0, last, height) if axis == 0 else Window(0, first, width, last)
    inside = np.zeros((height, width), dtype=np.bool_)
    inside[window.top : window.bottom, window.left : window.right] = True
    return TruncatedMasks([region & inside for region in regions], window)


@dataclass(frozen=True)
class MiscalibratedCamera(Camera):
    """A camera whose focal length and principal point are wrong: its image is scaled about that point, then shifted.

    `pixel = principal + shift + focal_scale * (true pixel - principal)`, for any central camera; `shift` is (2,) px.
    """

    camera: Camera
    focal_scale: float
    shift: Array
    width: int | None = field(init=False)
    height: int | None = field(init=False)

    def __post_init__(self) -> None:
        """Take over the true camera's image size; check the scale."""
        if not self.focal_scale > 0.0:
            raise ValueError(f"focal_scale is {self.focal_scale}; it must be positive")
        object.__setattr__(self, "width", self.camera.width)
        object.__setattr__(self, "height", self.camera.height)

    @property
    def max_angle(self) -> float:
        """Largest angle off the optical axis of the true camera, rad."""
        return self.camera.max_angle

    @property
    def straight_lines(self) -> bool:
        """Whether straight lines of the world are straight in the image."""
        return self.camera.straight_lines

    @cached_property
    def principal(self) -> Array:
        """(2,) pixel of the true camera's optical axis."""
        pixel: Array = self.camera.project(np.array([[0.0, 0.0, 1.0]]))[0]
        return pixel

    def _bearings(self, u: Array, v: Array) -> tuple[Array, ...]:
        shifted = np.column_stack([u, v]) - self.principal - self.shift
        return tuple(self.camera.bearings(self.principal + shifted / self.focal_scale).T)

    def _project(self, x: Array, y: Array, z: Array) -> tuple[Array, ...]:
        pixels = self.camera.project(np.column_stack([x, y, z]))
        return tuple((self.principal + self.shift + self.focal_scale * (pixels - self.principal)).T)


def miscalibrate(camera: Camera, focal_share: float, center_px: float, rng: np.random.Generator) -> MiscalibratedCamera:
    """The camera with normal errors in its focal length and principal point.

    Standard deviations: `focal_share` of the focal length (as a share), `center_px` of each coordinate of the point.
    """
    for name, deviation in (("focal_share", focal_share), ("center_px", center_px)):
        if deviation < 0.0:
            raise ValueError(f"{name} is {deviation}; a standard deviation must be 0 or more")
    # The exponential keeps the focal length positive however large the error.
    return MiscalibratedCamera(camera, float(np.exp(rng.normal(0.0, focal_share))), rng.normal(0.0, center_px, size=2))
