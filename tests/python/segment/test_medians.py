"""Medians of discs are those of a library that counts levels pixel by pixel, to the last one."""

from __future__ import annotations

import numpy as np
import pytest
from regionpose.segment.medians import disc_median
from skimage.filters import rank
from skimage.morphology import disk


@pytest.mark.parametrize("radius", [0, 1, 2, 3, 4, 6])
@pytest.mark.parametrize("size", [(1, 1), (5, 40), (9, 9), (70, 33), (131, 90)])
def test_medians_are_those_of_counted_levels(radius: int, size: tuple[int, int]) -> None:
    levels = np.random.default_rng(radius).integers(0, 256, (*size, 3)).astype(np.uint8)
    disc = disk(radius)  # type: ignore[no-untyped-call]
    counted = np.stack([rank.median(levels[..., k], disc) for k in range(3)], axis=2)  # type: ignore[no-untyped-call]
    assert np.array_equal(disc_median(levels, radius), counted if radius else levels)
