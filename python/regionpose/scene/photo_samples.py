"""Small copies of a recording's photos: how much they move, how many edges they have, and which photos to take."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionpose.io.bags.place import NANOSECONDS
from regionpose.validation.arrays import Array

Thumbnail = NDArray[np.float32]

MOST_SAMPLES = 120
"""Photos that are sampled, evenly over a recording: many for each frame, and seconds to a minute of decoding."""

THUMBNAIL_PX = 320
"""Width to which photos are averaged before they are compared: it takes noise away, and leaves a rig's motion."""

EDGE_LEVELS = 8.0
"""A gradient of a thumbnail, of 256 levels a pixel, from which on it is an edge: above noise and shading."""

STILL_FRACTION, STILL_FACTOR = 0.25, 2.0
"""Photos of a part among which the number of edges chooses: those that move at most so many times as much as this
fraction of them does. Conventions; noise alone differs by less."""

LEAST_CHANGE = 1e-6
"""Levels; far less than noise."""


class PhotoSample(NamedTuple):
    """A sampled photo: its place among all photos, how fast the next one differs from it (levels a second),
    the fraction of its pixels that are edges, and by how many levels it differs from the sample before.
    """

    photo: int
    change_rate: float
    edge_fraction: float
    changed: float


class _Pending(NamedTuple):
    """A sampled photo whose next one is still to come."""

    photo: int
    time_ns: int
    thumbnail: Thumbnail
    changed: float


class PhotoSampler:
    """Samples of photos that are due, each `period_ns` after the last, compared with the photo after each."""

    def __init__(self, period_ns: int) -> None:
        """Start without samples."""
        self._period_ns, self._due_ns = period_ns, 0
        self._open: _Pending | None = None
        self._last: Thumbnail | None = None
        self._found: list[PhotoSample] = []

    def is_due(self, time_ns: int) -> bool:
        """Whether a photo of this time is to be added."""
        return self._open is not None or time_ns >= self._due_ns

    def add(self, photo: int, time_ns: int, picture: NDArray[np.uint8]) -> None:
        """Add a photo (h, w, 3): the next one after a due photo if that was the last to be added."""
        thumbnail, before = _thumbnail(picture), self._open
        if before is not None:
            seconds = max(time_ns - before.time_ns, 1) / NANOSECONDS
            self._close(before, _difference(before.thumbnail, thumbnail) / seconds)
        if time_ns >= self._due_ns:
            changed = 0.0 if self._last is None else _difference(self._last, thumbnail)
            self._open, self._last = _Pending(photo, time_ns, thumbnail, changed), thumbnail
            self._due_ns = time_ns + self._period_ns

    def finished(self) -> list[PhotoSample]:
        """Return all samples; the last photo of a recording moves as the one before it."""
        if self._open is not None:
            self._close(self._open, self._found[-1].change_rate if self._found else 0.0)
        return list(self._found)

    def _close(self, pending: _Pending, change_rate: float) -> None:
        self._found.append(PhotoSample(pending.photo, change_rate, _edge_fraction(pending.thumbnail), pending.changed))
        self._open = None


def select_photos(samples: Sequence[PhotoSample], motion: Array, count: int) -> list[int]:
    """Return the places of at most `count` samples, one of each part with an equal fraction of all change.

    Of a part's samples with little `motion` (n,) the one with the most edges. Parts of equal change, not of equal
    time: a rig that stands for long shows one place.
    """
    count = min(count, len(samples))
    # More than nothing, so that photos that are all the same are parted evenly.
    change = np.cumsum([sample.changed + LEAST_CHANGE for sample in samples])
    parts = np.searchsorted(change, change[-1] * np.arange(1, count) / count, side="right")
    # Each has at least one sample.
    steps = np.arange(1, count)
    parts = np.maximum.accumulate(np.maximum(parts - steps, 0)) + steps
    parts = np.minimum(parts, len(samples) - count + steps)
    chosen = []
    for part in np.split(np.arange(len(samples)), parts):
        still = part[motion[part] <= STILL_FACTOR * np.quantile(motion[part], STILL_FRACTION, method="lower")]
        chosen.append(int(max(still, key=lambda index: samples[index].edge_fraction)))
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


def _edge_fraction(thumbnail: Thumbnail) -> float:
    """The fraction of pixels at which the gradient is an edge's."""
    if min(thumbnail.shape) < 2:
        return 0.0
    down, across = np.gradient(thumbnail)
    return float((np.hypot(down, across) >= EDGE_LEVELS).mean())
