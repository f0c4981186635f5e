"""How likely edges a photo makes, comparable between bright and dark, busy and bare parts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d, uniform_filter

from regionpose import _core
from regionpose.validation.arrays import checked_image

Array = NDArray[np.float64]
Pictures = NDArray[np.float32]

DIRECTIONS = 4
"""Directions across which gradients are taken, 45 degrees apart: convention."""

MOST_PIXELS = 1_000_000
"""Most pixels of the reduced photo; of a larger one several are averaged. Photos of half as many find poses to a
quarter of a degree."""

GRADIENT_PX = 1.0
"""Standard deviation of the Gaussian whose derivative is the gradient: convention."""

CONTRAST_PX = 30.0
"""Standard deviation of the window within which gradients are made comparable: wider than what single edges fill."""

NOISE_LEVELS = 0.5
"""A gradient of so many of 256 levels a pixel is noise: rounding."""

SHOWN, POWER = 0.5, 4.0
"""The fraction of steps whose edge the photo shows, and the power of the density of its rank, 4 u^3: conventions,
between an uninformative rank and one that is the edge itself."""

LEAST_WINDOW_PX, WINDOW_SPREADS = 41, 5
"""Least width of the window within which densities are made comparable, a few times as wide as an edge is spread by the
smallest photos' reduction, and so many spreads where that is more. By a window no wider than what edges are spread by,
true poses do not stand out."""

LEVELS = 1 << 12
"""Bins of the distribution of strengths, for their ranks: far more than ranks need."""


@dataclass(frozen=True, eq=False)
class Photo:
    """A photo's luminance (h, w), 0 to 255; each pixel is a square of the original's, `reduction` wide, which has
    `shape`, height and width.
    """

    luminance: Pictures
    reduction: int
    shape: tuple[int, int]

    @classmethod
    def of(cls, image: ArrayLike) -> Photo:
        """The photo of an image (h, w) or (h, w, 3): uint8, uint16 or floats in [0, 1]; ValueError for others."""
        levels = _luminance(checked_image(image))
        reduction = int(np.ceil(np.sqrt(levels.size / MOST_PIXELS)))
        height, width = (max(size // reduction, 1) for size in levels.shape)
        whole = levels[: height * reduction, : width * reduction]
        blocks = whole.reshape(height, whole.shape[0] // height, width, whole.shape[1] // width)
        return cls(blocks.mean(axis=(1, 3), dtype=np.float32), reduction, (levels.shape[0], levels.shape[1]))

    def places(self, pixels: Array) -> Array:
        """Pixels (n, 2) of the original photo as pixels of this one."""
        return (pixels + 0.5) / self.reduction - 0.5

    def pixels(self, places: Array) -> Array:
        """Pixels (n, 2) of this photo as pixels of the original one."""
        return (places + 0.5) * self.reduction - 0.5

    @cached_property
    def ranks(self) -> Pictures:
        """For each of `DIRECTIONS` the fraction (k, h, w) of the photo that has no stronger derivative across it."""
        return np.stack([_ranks(picture) for picture in self._derivatives])

    def log_ratios(self, spread_px: float) -> Pictures:
        """Logarithms (k, h, w) of how much likelier the photo is with the image of an edge in a pixel than with none,
        its place being known up to a Gaussian of this standard deviation (docs/math.md, eq. 18.2).
        """
        if spread_px not in self._log_ratios:
            means = self._means(max(LEAST_WINDOW_PX, 2 * int(0.5 * WINDOW_SPREADS * spread_px) + 1))
            made = [_log_ratio(*pair, spread_px) for pair in zip(self._densities, means, strict=True)]
            self._log_ratios[spread_px] = np.stack(made)
        return self._log_ratios[spread_px]

    def _means(self, width: int) -> list[Pictures]:
        """For each direction the mean densities (h, w) in windows of a width; most spreads share one."""
        if width not in self._made_means:
            means = [uniform_filter(density, width) for density in self._densities]
            self._made_means[width] = [np.maximum(mean, np.float32(1e-3)) for mean in means]
        return self._made_means[width]

    @cached_property
    def _made_means(self) -> dict[int, list[Pictures]]:
        """By width, filled on demand."""
        return {}

    @cached_property
    def _log_ratios(self) -> dict[float, Pictures]:
        """By spread, filled on demand."""
        return {}

    @cached_property
    def _densities(self) -> list[Pictures]:
        """For each direction the density (h, w) of the ranks of edges."""
        return [np.float32(POWER) * ranks ** np.float32(POWER - 1.0) for ranks in self.ranks]

    @cached_property
    def _derivatives(self) -> list[Pictures]:
        """Sizes (h, w) of the derivatives across each direction."""
        angles = np.pi * np.arange(DIRECTIONS, dtype=np.float32) / DIRECTIONS
        x, y = self._gradients()
        return [np.abs(np.cos(angle) * x + np.sin(angle) * y) for angle in angles]

    def _gradients(self) -> tuple[Pictures, Pictures]:
        """Derivatives (h, w) by x and y, over their root mean square about each place."""
        x, y = (
            gaussian_filter1d(gaussian_filter1d(self.luminance, GRADIENT_PX, axis=1 - axis), GRADIENT_PX, axis, order=1)
            for axis in (1, 0)
        )
        contrast = np.sqrt(blurred(x * x + y * y, CONTRAST_PX, 2.0)) + np.float32(NOISE_LEVELS)
        return x / contrast, y / contrast


def blurred(picture: Pictures, spread_px: float, reach: float) -> Pictures:
    """A picture (h, w) spread by a Gaussian of a standard deviation in pixels, cut off at so many of it.

    As `scipy.ndimage.gaussian_filter` has it, to the last bit, in a third of the time.
    """
    last = int(reach * spread_px + 0.5)
    weights = np.exp(-0.5 / spread_px**2 * np.arange(-last, last + 1) ** 2)
    return _core.blurred(np.ascontiguousarray(picture), weights[last:] / weights.sum())


def _log_ratio(density: Pictures, mean: Pictures, spread_px: float) -> Pictures:
    ratio: Pictures = blurred(density, spread_px, 3.0) / mean
    ratio -= np.float32(1.0)
    ratio *= np.float32(SHOWN)
    return np.log1p(ratio, out=ratio)


def _luminance(colors: NDArray[np.uint8]) -> Pictures:
    """The mean (h, w) of three channels (h, w, 3), one after the other: numpy's own along a short axis is slower."""
    red, green, blue = (colors[..., channel] for channel in range(3))
    levels = red.astype(np.float32)
    levels += green
    levels += blue
    levels /= np.float32(3.0)
    return levels


def _ranks(values: Pictures) -> Pictures:
    """The fraction of the values that are no greater, by bins that grow with the values' square root."""
    most = np.float32(values.max() or 1.0)
    bins = (np.sqrt(values / most) * np.float32(LEVELS - 1)).astype(np.int32)
    fractions = np.cumsum(np.bincount(bins.ravel(), minlength=LEVELS)) / values.size
    return np.asarray(fractions.astype(np.float32)[bins])
