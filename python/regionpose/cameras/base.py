"""What every central camera shares: array checks, parameter checks, the two public maps."""

from __future__ import annotations

import math
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import Self, SupportsFloat

import numpy as np
from numpy.typing import ArrayLike

from regionpose.validation.arrays import Array, real_array, row_array
from regionpose.validation.quoting import quoted

Components = tuple[Array, ...]

BLOCK_ROWS = 16384
"""Rows mapped at a time, so that the temporaries of a block stay in the processor's cache."""

MOST_SIDE = 2**31 - 1
"""Largest height or width of an image, pixels: what image formats can state."""

TURNED = "turned by a quarter, as by the EXIF turn of a photo, which viewers and OpenCV apply"

LIMIT_SLACK = 1e-12
"""Relative slack of a projected point on the limit of a model: a few roundings of a bearing found there."""


class Camera(ABC):
    """A central camera: every pixel sees along one ray through the camera center."""

    width: int | None
    height: int | None

    def bearings(self, pixels: ArrayLike) -> Array:
        """Unit vectors in the camera frame along which pixels see.

        Parameters
        ----------
        pixels : (n, 2) or (2,) array
            x right, y down; the image size does not limit them.

        Returns
        -------
        (n, 3) or (3,) array
            A row is NaN where the pixel is not finite or where the model maps no direction to it, as beyond the fold of
            a distortion.

        Raises
        ------
        ValueError
            For another shape.
        """
        return _mapped(self._bearings, pixels, "pixels", 2, 3)

    def project(self, points: ArrayLike) -> Array:
        """Pixels of points in the camera frame; only the direction of a point matters.

        Parameters
        ----------
        points : (n, 3) or (3,) array
            In any unit.

        Returns
        -------
        (n, 2) or (2,) array
            Not cropped by the image size. A row is NaN where the point is not finite, is the camera center, or is not
            visible: behind the camera or further off the axis than the model resolves (`max_angle`), or where its
            pixel is too far out to be a finite number.

        Raises
        ------
        ValueError
            For another shape.
        """
        return _mapped(self._project, points, "points", 3, 2)

    def resized(self, width: int, height: int) -> Self:
        """The camera of the same photos resized, as by cv2.resize.

        Outer corners go to outer corners, so that a pixel `u` goes to `s (u + 0.5) - 0.5`.

        Parameters
        ----------
        width, height : int
            Of the resized photos, pixels.

        Raises
        ------
        ValueError
            For a camera without a size, and where no one factor, to a pixel of rounding, scales its size to the
            other.
        """
        size = image_length("width", width), image_length("height", height)
        if self.width is None or self.height is None:
            raise ValueError("camera: found no width and height; needed the size of the photos that were calibrated")
        if resize_factor((self.width, self.height), (width, height)) is None:
            found = f"{width} x {height} pixels for {self.width} x {self.height}"
            raise ValueError(f"size: found {found}; needed both sides by one factor, a resized photo without a cut")
        return self._scaled(width / self.width, height / self.height, size)

    def check_size(self, shape: Sequence[int], item: str = "image") -> None:
        """Check that a photo's or mask's array is as large as the photos that were calibrated.

        A camera without a size fits all.

        Parameters
        ----------
        shape : sequence of int
            Height and width first, pixels.
        item : str
            What the array is, for the error.

        Raises
        ------
        ValueError
            For another size, with both and what to do.
        """
        remark = self.other_size(shape[1], shape[0])
        if remark is not None:
            cure = f", or camera.resized({shape[1]}, {shape[0]})" * self._is_copy(shape[1], shape[0])
            raise ValueError(f"{item}: {remark}{cure}")

    def other_size(self, width: int, height: int) -> str | None:
        """What is wrong with a photo of this size, in pixels; None where it is that of the calibrated ones or these are
        of none.
        """
        calibrated = (self.width or width, self.height or height)
        if calibrated == (width, height):
            return None
        needed = f"needed the calibrated {calibrated[0]} x {calibrated[1]}"
        factor = resize_factor(calibrated, (width, height))
        if factor is not None:
            return f"found {width} x {height} pixels, {factor:.4g} of the camera's; {needed}"
        turned = resize_factor(calibrated[::-1], (width, height)) is not None
        how = TURNED if turned else "cut, or another camera's: no one factor scales one to the other"
        return f"found {width} x {height} pixels ({how}); {needed}"

    def _is_copy(self, width: int, height: int) -> bool:
        """Whether a photo of this size may be a resized copy of the calibrated ones."""
        sized = self.width is not None and self.height is not None
        return sized and resize_factor((self.width or 0, self.height or 0), (width, height)) is not None

    def _scaled(self, horizontal: float, vertical: float, size: tuple[int | None, int | None]) -> Self:
        """The camera of photos whose sides are scaled by two factors to `size`, width and height."""
        raise ValueError(f"camera: found a {type(self).__name__}; needed one that knows how to be resized")

    def project_near(self, points: ArrayLike, column: float) -> Array:
        """As `project`, of a panorama the columns nearest to `column`, beyond the image's sides where that is so."""
        pixels = self.project(points)
        if self.period is not None:
            pixels[:, 0] -= self.period * np.round((pixels[:, 0] - column) / self.period)
        return pixels

    @property
    def period(self) -> float | None:
        """Pixels after which columns repeat, of a panorama of one turn; None of other cameras."""
        return None

    @property
    @abstractmethod
    def max_angle(self) -> float:
        """Largest angle off the optical axis, in radians, up to which the model is one-to-one."""

    @property
    @abstractmethod
    def straight_lines(self) -> bool:
        """Whether straight lines of the world are straight in the image."""

    @abstractmethod
    def _bearings(self, u: Array, v: Array) -> Components:
        """Components of the bearings of pixels (u, v), NaN where there is none."""

    @abstractmethod
    def _project(self, x: Array, y: Array, z: Array) -> Components:
        """Pixel coordinates of points, NaN where not visible."""


def resize_factor(size: tuple[int, int], other: tuple[int, int]) -> float | None:
    """The factor that scales one width and height to another, each rounded by less than a pixel; None if none does.

    Of the factors that do, the middle one.
    """
    low = max((there - 1.0) / here for here, there in zip(size, other, strict=True))
    high = min((there + 1.0) / here for here, there in zip(size, other, strict=True))
    return 0.5 * (low + high) if low < high else None


def _map_rows(mapping: Callable[..., Components], rows: Array, columns: int) -> Array:
    """`mapping` of the columns of `rows`, block by block; NaN rows where anything is not finite."""
    mapped = np.empty((len(rows), columns))
    for start in range(0, len(rows), BLOCK_ROWS):
        block, values = rows[start : start + BLOCK_ROWS], mapped[start : start + BLOCK_ROWS]
        with np.errstate(all="ignore"):
            for column, component in enumerate(mapping(*np.ascontiguousarray(block.T))):
                values[:, column] = component
        # Row by row only where it matters: for a hundred rows the checks would take longer than the mapping.
        if not (np.isfinite(block).all() and np.isfinite(values).all()):
            values[~(np.isfinite(block).all(axis=1) & np.isfinite(values).all(axis=1))] = np.nan
    return mapped


def _mapped(mapping: Callable[..., Components], given: object, item: str, columns: int, mapped: int) -> Array:
    """Rows (n, mapped) of rows (n, columns), or one of one."""
    array = real_array(given, item, f"(n, {columns}) or ({columns},)")
    if array.shape == (columns,):
        return np.asarray(_map_rows(mapping, row_array(array[None], item, columns), mapped)[0])
    return _map_rows(mapping, row_array(array, item, columns), mapped)


def finite_number(name: str, value: SupportsFloat) -> float:
    """`value` as a finite float; ValueError that names it otherwise."""
    try:
        if isinstance(value, str | bytes) or np.asarray(value).dtype.kind == "c":
            raise TypeError("text and complex numbers are no real numbers")
        number = float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{name}: found {quoted(value)}; needed a number") from error
    if not math.isfinite(number):
        raise ValueError(f"{name}: found {number}; needed a finite number")
    return number


def positive_number(name: str, value: SupportsFloat) -> float:
    """`value` as a finite float above zero; ValueError that names it otherwise."""
    number = finite_number(name, value)
    if number <= 0.0:
        raise ValueError(f"{name}: found {number}; needed a number above 0")
    return number


def finite_numbers(name: str, values: Iterable[SupportsFloat]) -> tuple[float, ...]:
    """`values` as a tuple of finite floats; ValueError that names the one that is not."""
    try:
        items = list(values)
    except TypeError as error:
        raise ValueError(f"{name}: found {quoted(values)}; needed a sequence of numbers") from error
    return tuple(finite_number(f"{name}[{index}]", value) for index, value in enumerate(items))


def image_length(name: str, value: int | None) -> int | None:
    """An image width or height in pixels, None when unknown; ValueError unless a whole number from 1 to `MOST_SIDE`."""
    if value is None:
        return None
    try:
        length = operator.index(value)
    except TypeError as error:
        raise ValueError(f"{name}: found {quoted(value)}; needed a whole number of pixels or None") from error
    if not 0 < length <= MOST_SIDE:
        raise ValueError(f"{name}: found {quoted(length)}; needed a whole number from 1 to {MOST_SIDE}")
    return length
