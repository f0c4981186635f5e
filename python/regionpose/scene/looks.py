"""Small copies of a recording's photos: how much they move, how many edges they have, and which photos to take."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionpose.io.bags.place import NANOSECONDS
from regionpose.validation.arrays import Array

Thumbnail = NDArray[np.float32]

MOST_LOOKS = 120
"""Photos that are looked at, evenly over a recording: many for each frame, and seconds to a minute of decoding."""

THUMBNAIL_PX = 320
"""Width to which photos are averaged before they are compared: it takes noise away, and leaves a rig's motion."""

EDGE_LEVELS = 8.0
"""A gradient of a thumbnail, of 256 levels a pixel, from which on it is an edge: above noise and shading."""

STILL_SHARE, STILL_FACTOR = 0.25, 2.0
"""Photos of a part among which the number of edges chooses: those that move at most so many times as much as this share
of them does. Conventions; noise alone differs by less."""

LEAST_CHANGE = 1e-6
"""Levels; far less than noise."""


class Look(NamedTuple):
    """A photo that was looked at: its place among all photos, how fast the next one differs from it (levels a second),
    the share of its pixels that are edges, and by how many levels it differs from the photo looked at before.
    """

    photo: int
    change_rate: float
    edge_share: float
    changed: float


class _Open(NamedTuple):
    """A photo whose next one has not been looked at yet."""

    photo: int
    time_ns: int
    thumbnail: Thumbnail
    changed: float


class Looks:
    """Looks at photos that are due, `period_ns` after one another, and at the next one of each."""

    def __init__(self, period_ns: int) -> None:
        """Nothing is looked at yet."""
        self._period_ns, self._due_ns = period_ns, 0
        self._open: _Open | None = None
        self._last: Thumbnail | None = None
        self._found: list[Look] = []

    def is_due(self, time_ns: int) -> bool:
        """Whether a photo of this time is to be added."""
        return self._open is not None or time_ns >= self._due_ns

    def add(self, photo: int, time_ns: int, picture: NDArray[np.uint8]) -> None:
        """Look at a photo (h, w, 3), the next one after the last that was due if that was the last to be added."""
        thumbnail, before = _thumbnail(picture), self._open
        if before is not None:
            seconds = max(time_ns - before.time_ns, 1) / NANOSECONDS
            self._close(before, _difference(before.thumbnail, thumbnail) / seconds)
        if time_ns >= self._due_ns:
            changed = 0.0 if self._last is None else _difference(self._last, thumbnail)
            self._open, self._last = _Open(photo, time_ns, thumbnail, changed), thumbnail
            self._due_ns = time_ns + self._period_ns

    def finished(self) -> list[Look]:
        """All looks; the last photo of a recording moves as the one before it."""
        if self._open is not None:
            self._close(self._open, self._found[-1].change_rate if self._found else 0.0)
        return list(self._found)

    def _close(self, held: _Open, change_rate: float) -> None:
        self._found.append(Look(held.photo, change_rate, _edge_share(held.thumbnail), held.changed))
        self._open = None


def chosen_looks(looks: Sequence[Look], motion: Array, count: int) -> list[int]:
    """Places of at most so many looks, one of each part in which as much changes as in any other.

    Of a part's looks with little `motion` (n,) the one with the most edges. Parts of equal change, not of equal
    time: a rig that stands for long shows one place.
    """
    count = min(count, len(looks))
    # More than nothing, so that photos that are all the same are parted evenly.
    change = np.cumsum([look.changed + LEAST_CHANGE for look in looks])
    parts = np.searchsorted(change, change[-1] * np.arange(1, count) / count, side="right")
    # Each has a look at least.
    steps = np.arange(1, count)
    parts = np.maximum.accumulate(np.maximum(parts - steps, 0)) + steps
    parts = np.minimum(parts, len(looks) - count + steps)
    chosen = []
    for part in np.split(np.arange(len(looks)), parts):
        still = part[motion[part] <= STILL_FACTOR * np.quantile(motion[part], STILL_SHARE, method="lower")]
        chosen.append(int(max(still, key=lambda index: looks[index].edge_share)))
    return chosen


def _thumbnail(picture: NDArray[np.uint8]) -> Thumbnail:
    """The luminance of a picture (h, w, 3), averaged over squares."""
    side = max(1, picture.shape[1] // THUMBNAIL_PX)
    height, width = (max(1, size // side) for size in picture.shape[:2])
    whole = picture[: height * side, : width * side].astype(np.float32).mean(axis=2)
    return np.asarray(whole.reshape(height, whole.shape[0] // height, width, whole.shape[1] // width).mean(axis=(1, 3)))


def _difference(first: Thumbnail, second: Thumbnail) -> float:
    """The mean difference, levels; the most of pictures of different sizes."""
    return float(np.abs(first - second).mean()) if first.shape == second.shape else 255.0


def _edge_share(thumbnail: Thumbnail) -> float:
    """The share of pixels at which the gradient is an edge's."""
    if min(thumbnail.shape) < 2:
        return 0.0
    down, across = np.gradient(thumbnail)
    return float((np.hypot(down, across) >= EDGE_LEVELS).mean())
