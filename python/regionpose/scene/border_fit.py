"""How well the sides of a border fit the edges of a photo, against the same border at other places of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionpose.alignment.photo import DIRECTIONS, Photo
from regionpose.cameras import Camera
from regionpose.scene.plane_borders import Border, Pieces
from regionpose.validation.arrays import Array

Flags = NDArray[np.bool_]

SPREAD_PX, SNAP_SPREAD_PX = 2.0, 1.0
"""Spread of the edges that a border is compared with, that of a good pose; and of those that its sides are moved onto,
that of the photo's gradient."""

REACH_GAPS, STEPS = 0.7, 9
"""How far the ends of a side are moved along its normal either way, over the gap between neighboring points, and at how
many places: a surface ends anywhere between its last point and the next."""

TURNED_DEG, ROLLED_DEG, TURNED_COUNT, SEED = (1.5, 8.0), 2.0, 80, 1
"""Turns of the camera that a border is compared at: across the optical axis, about it, how many, and their seed. They
project to similar parts of the photo, farther than a side is moved."""

LEAST_IN_VIEW = 0.5
"""Fraction of a border's pieces that a turned camera sees at the least."""

LEAST_TURNED = 20
"""Turned cameras that see so much of it at the least: a rank of one in ten is known then."""

LEAST_PIECES = 15
"""Pieces of a border at the least: 30 px."""

LEAST_RATIO = 0.3
"""Mean log likelihood ratio along a side from which on the photo shows an edge there: a convention, three times the
mean of what sides find elsewhere in a photo, and a third of what the strongest edge has."""


@dataclass(frozen=True, eq=False)
class BorderFit:
    """The sides of a border on the edges of a photo.

    `offsets` (n, 2): how far the start and the end of each side are moved outward, pixels of the reduced photo.
    `ratios` (n,): the mean log likelihood ratio along each then. `score`: the sum of log ratios along the border, each
    side being moved to where it is largest; `turned` (t,): the same at turned poses, NaN where these see too little of
    it. `pieces`: how many pieces it has.
    """

    border: Border
    offsets: Array
    ratios: Array
    score: float
    turned: Array
    pieces: int

    @property
    def has_edge(self) -> Flags:
        """Of which sides (n,) the photo shows an edge."""
        return np.asarray(self.border.is_end & (self.ratios >= LEAST_RATIO))

    @property
    def log_odds(self) -> float:
        """Logarithm of the odds that the border fits by more than chance, by its rank among the turned ones."""
        return rank_log_odds(self.score, self.turned)

    @cached_property
    def edge_fraction(self) -> float:
        """Fraction of the border where the photo shows an edge."""
        return float(self.has_edge[self.border.pieces.sides].mean())

    @cached_property
    def least_information(self) -> float:
        """What the shown sides determine of the border's place and size: the least eigenvalue of the mean information
        of a shift and a scale, 0.5 of a circle that is shown all around.
        """
        pieces = self.border.pieces
        has_edge = self.has_edge[pieces.sides]
        offsets = pieces.places - pieces.places.mean(axis=0)
        size = float(np.sqrt(np.mean(np.sum(offsets**2, axis=1))))
        rows = np.column_stack([pieces.normals, np.sum(pieces.normals * offsets, axis=1) / size])[has_edge]
        return float(np.linalg.eigvalsh(rows.T @ rows / len(pieces.sides))[0])


def fitted(photo: Photo, camera: Camera, border: Border, gap_px: float) -> BorderFit | None:
    """How a border fits a photo; None where too little of it is a surface's end.

    `gap_px`: the gap between neighboring points of the cloud.
    """
    everywhere, count, reach = border.pieces, len(border.ring), REACH_GAPS * gap_px
    pieces = everywhere.chosen(border.is_end[everywhere.sides])
    if len(pieces.places) < LEAST_PIECES:
        return None
    turned = _scores(photo, _turned(photo, camera, pieces, count), count, reach)
    (score,) = _scores(photo, pieces, count, reach).tolist()
    if np.isnan(score) or np.count_nonzero(np.isfinite(turned)) < LEAST_TURNED:
        return None
    offsets, sums = _best(photo, SNAP_SPREAD_PX, pieces, count, reach)[:2]
    ratios = sums / np.maximum(np.bincount(pieces.sides, minlength=count), 1)
    return BorderFit(border, offsets, ratios, score, turned, len(pieces.places))


def joint_log_odds(fits: Sequence[BorderFit]) -> float:
    """Logarithm of the odds that borders together fit by more than chance; 0 without any.

    Each counts by its score over the root of its pieces, whose deviation chance makes alike.
    """
    if not fits:
        return 0.0
    weights = [1.0 / np.sqrt(fit.pieces) for fit in fits]
    # A border that a turned camera does not see is there what it is elsewhere.
    turned = [np.where(np.isnan(fit.turned), np.nanmean(fit.turned), fit.turned) for fit in fits]
    score = sum(weight * fit.score for weight, fit in zip(weights, fits, strict=True))
    null_scores = sum((weight * each for weight, each in zip(weights, turned, strict=True)), np.zeros(TURNED_COUNT))
    return rank_log_odds(float(score), null_scores)


def rank_log_odds(score: float, null_scores: Array) -> float:
    """Logarithm of the odds that a score is no other one of (n,), NaN left out: by its rank among all, so that of
    scores by chance one in ten has odds of 9 to 1 or more.
    """
    finite = null_scores[np.isfinite(null_scores)]
    fraction = (1.0 + np.count_nonzero(finite >= score)) / (1.0 + len(finite))
    return float(np.log((1.0 - fraction) / fraction)) if fraction < 1.0 else -np.inf


def _turned(photo: Photo, camera: Camera, pieces: Pieces, count: int) -> Pieces:
    """The pieces as turned cameras see them, camera after camera, with so many sides of each; NaN where they don't."""
    ends = camera.bearings(photo.pixels(np.concatenate([pieces.places, pieces.places + pieces.normals])))
    seen = photo.places(camera.project(np.concatenate([turn.apply(ends) for turn in _turns()])))
    starts, tips = np.moveaxis(seen.reshape(TURNED_COUNT, 2, -1, 2), 1, 0).reshape(2, -1, 2)
    normals = tips - starts
    lengths = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    sides = (pieces.sides + count * np.arange(TURNED_COUNT)[:, None]).ravel()
    return Pieces(starts, normals / lengths, sides, np.tile(pieces.along, TURNED_COUNT))


@cache
def _turns() -> tuple[Rotation, ...]:
    rng = np.random.default_rng(SEED)
    directions = rng.uniform(0.0, 2.0 * np.pi, TURNED_COUNT)
    angles = np.radians(rng.uniform(*TURNED_DEG, TURNED_COUNT))
    rolls = np.radians(rng.uniform(-ROLLED_DEG, ROLLED_DEG, TURNED_COUNT))
    vectors = np.column_stack([angles * np.cos(directions), angles * np.sin(directions), rolls])
    return tuple(Rotation.from_rotvec(vector) for vector in vectors)


def _scores(photo: Photo, pieces: Pieces, count: int, reach: float) -> Array:
    """For each camera, of so many sides each, the sum of log ratios along sides that are moved to where it is largest,
    as of all pieces where the photo shows some alone; NaN where it shows too few.
    """
    cameras = int(pieces.sides.max()) // count + 1
    _, sums, is_inside = _best(photo, SPREAD_PX, pieces, cameras * count, reach)
    fractions = is_inside.reshape(cameras, -1).mean(axis=1)
    shown = np.where(fractions >= LEAST_IN_VIEW, fractions, np.nan)
    return np.asarray(sums.reshape(cameras, count).sum(axis=1) / shown)


def _best(photo: Photo, spread_px: float, pieces: Pieces, count: int, reach: float) -> tuple[Array, Array, Flags]:
    """Offsets (n, 2) of the starts and ends of so many sides, the sums (n,) of log ratios along these, and which pieces
    (m,) the photo shows.
    """
    # At half steps, between which the offsets of pieces are rounded.
    offsets = np.linspace(-reach, reach, 2 * STEPS - 1)
    places = pieces.places[:, None] + offsets[:, None] * pieces.normals[:, None]
    values, is_inside = _log_ratios(photo, spread_px, places, pieces.normals)
    starts, ends = (each.ravel() for each in np.indices((STEPS, STEPS)))
    columns = np.round(2.0 * (starts + (ends - starts) * pieces.along[:, None])).astype(np.int64)
    sums = np.zeros((count, len(starts)))
    np.add.at(sums, pieces.sides, np.take_along_axis(values, columns, axis=1))
    moved = offsets[::2]
    # A surface's end is off by half the reach, one sigma.
    prior = np.square(moved[starts] / reach) + np.square(moved[ends] / reach)
    best = np.argmax(sums - prior, axis=1)
    return np.column_stack([moved[starts], moved[ends]])[best], sums[np.arange(count), best], is_inside[:, STEPS - 1]


def _log_ratios(photo: Photo, spread_px: float, places: Array, normals: Array) -> tuple[Array, Flags]:
    """Log ratios (m, k) at places (m, k, 2) of edges with normals (m, 2), 0 where the photo does not show them, and
    where it does.
    """
    pictures = photo.log_ratios(spread_px)
    height, width = pictures.shape[1:]
    across = np.nan_to_num(np.arctan2(normals[:, 1], normals[:, 0]) / np.pi * DIRECTIONS)
    direction = (np.round(across).astype(np.int64) % DIRECTIONS)[:, None]
    is_inside = np.asarray(np.all((places >= 0.0) & (places <= (width - 1.0, height - 1.0)), axis=-1))
    x, y = np.moveaxis(np.where(is_inside[..., None], places, 0.0), -1, 0)
    left, top = (np.clip(each.astype(np.int64), 0, size - 2) for each, size in ((x, width), (y, height)))
    u, v = x - left, y - top
    upper, lower = (
        pictures[direction, row, left] * (1.0 - u) + pictures[direction, row, left + 1] * u for row in (top, top + 1)
    )
    return np.where(is_inside, upper * (1.0 - v) + lower * v, 0.0), is_inside
