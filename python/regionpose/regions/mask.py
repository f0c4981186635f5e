"""The window of a mask that holds its region, and the contours traced in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose import _core
from regionpose.validation.arrays import Array, KeptArrays, read_only
from regionpose.validation.foreign import as_array


@dataclass(frozen=True, eq=False, init=False)
class MaskWindow(KeptArrays):
    """The part of a mask that holds any coverage; all other pixels are empty.

    Parameters
    ----------
    coverage : (rows, columns) array
        Of the window, bool for a binary mask, else floats in [0, 1]. A binary one is kept at a bit a pixel.
    offset : tuple of 2 int
        Column and row (x, y) of its first pixel in the image.
    shape : tuple of 2 int
        Height and width of the whole mask.

    Raises
    ------
    ValueError
        For a window of another shape or one that leaves the image.
    """

    offset: tuple[int, int]
    shape: tuple[int, int]
    size: tuple[int, int]
    """Rows and columns of the window."""
    _is_binary: bool = field(repr=False)
    _kept: NDArray[Any] = field(repr=False)

    def __init__(self, coverage: NDArray[Any], offset: tuple[int, int], shape: tuple[int, int]) -> None:
        """Check that the window lies in the image, and keep a read-only array."""
        if coverage.ndim != 2:
            raise ValueError(f"coverage has shape {coverage.shape}; needed (rows, columns)")
        (rows, columns), (left, top), (height, width) = coverage.shape, offset, shape
        if min(left, top) < 0 or left + columns > width or top + rows > height:
            raise ValueError(
                f"a window of {rows} rows and {columns} columns at (x, y) = {offset} leaves the image of shape"
                f" {shape}; needed one inside"
            )
        is_binary = coverage.dtype == np.bool_
        kept = read_only(np.packbits(coverage) if is_binary else coverage)
        self.__dict__.update(offset=offset, shape=shape, size=(rows, columns), _is_binary=is_binary, _kept=kept)

    @property
    def coverage(self) -> NDArray[Any]:
        """The coverage (rows, columns) of the window, read-only."""
        if not self._is_binary:
            return self._kept
        rows, columns = self.size
        unpacked = np.unpackbits(self._kept, count=rows * columns).view(np.bool_).reshape(self.size)
        unpacked.setflags(write=False)
        return unpacked

    def full(self) -> NDArray[Any]:
        """The whole mask (h, w), of the coverage's type."""
        coverage = self.coverage
        mask = np.zeros(self.shape, dtype=coverage.dtype)
        (rows, columns), (left, top) = self.size, self.offset
        mask[top : top + rows, left : left + columns] = coverage
        return mask

    def covered_pixels(self) -> tuple[Array, Array]:
        """Centers (m, 2) of the pixels that hold any coverage, in the image, and the coverage (m,) of each."""
        coverage = self.coverage
        rows, columns = np.nonzero(coverage)
        pixels = np.column_stack([columns, rows]).astype(np.float64) + self.offset
        return pixels, coverage[rows, columns].astype(np.float64)


def traced_mask(mask: ArrayLike) -> tuple[list[Array], MaskWindow]:
    """Rings (n, 2) of a mask's contour, pixels, and its window; ValueError as of `ImageRegion.from_mask`."""
    given = checked_mask(mask)
    rings, (left, top, right, bottom), binary = _core.mask_contours(_native(given))
    cropped = given[top:bottom, left:right]
    coverage = cropped.astype(np.bool_, copy=False) if binary else _native(cropped).copy()
    coverage.setflags(write=False)
    return rings, MaskWindow(coverage, (left, top), (given.shape[0], given.shape[1]))


def seam_free(mask: ArrayLike) -> int:
    """The last empty column of a panorama's mask, where the mask is on both its sides; else 0.

    ValueError for a mask without an empty column, which no turn of it can show whole.
    """
    covered = (checked_mask(mask) != 0).any(axis=0)
    if not (covered[0] and covered[-1]):
        return 0
    empty = np.flatnonzero(~covered)
    if not len(empty):
        raise ValueError("mask covers every column of the panorama; needed a region that leaves some free")
    return int(empty[-1])


def checked_mask(mask: ArrayLike) -> NDArray[Any]:
    """The mask as an array (h, w) of a type that masks may have; ValueError for another."""
    given = as_array(mask, "mask", "(h, w)")
    if given.ndim != 2 or 0 in given.shape:
        raise ValueError(f"mask has shape {given.shape}; needed (h, w)")
    if given.dtype.kind not in "biuf":
        raise ValueError(f"mask has type {given.dtype}; needed bool, integers or floats in [0, 1]")
    return given


def _native(mask: NDArray[Any]) -> NDArray[Any]:
    """The mask in one of the types that the core reads, in place where it is."""
    if mask.dtype.kind == "b":
        return mask.view(np.uint8)
    if mask.dtype.kind == "f":
        return mask.astype(np.float32 if mask.dtype.itemsize <= 4 else np.float64, copy=False)
    return mask.astype(mask.dtype.newbyteorder("="), copy=False)
