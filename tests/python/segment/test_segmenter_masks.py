"""Masks as arrays of a segmenter: booleans, probabilities, logits, dictionaries."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose.io.masks.readers import masks_from_segmenter
from regionpose.regions.image import ImageRegion

Mask = NDArray[np.bool_]

HEIGHT, WIDTH = 40, 60

LOGITS = np.linspace(-4.0, 4.0, HEIGHT * WIDTH).reshape(1, HEIGHT, WIDTH) + np.array([0.0, 1.0])[:, None, None]


@pytest.mark.parametrize(
    "given_array",
    [
        LOGITS,
        LOGITS[:, None].astype(np.float16),
        1.0 / (1.0 + np.exp(-LOGITS)),
        LOGITS > 0,
        (LOGITS > 0).astype(np.uint8) * 255,
        (LOGITS > 0).astype(np.int64),
        [{"segmentation": logits > 0, "area": 3, "score": 0.9} for logits in LOGITS],
        list(LOGITS > 0),
    ],
)
def test_kinds_of_a_segmenters_array(given_array: object) -> None:
    masks = masks_from_segmenter(given_array)
    assert len(masks) == 2
    for mask, logits in zip(masks, LOGITS, strict=True):
        assert mask.dtype == np.bool_
        assert np.array_equal(mask, logits.astype(np.float16) > 0)


def test_single_mask_is_a_list_of_one() -> None:
    (mask,) = masks_from_segmenter(LOGITS[0])
    assert np.array_equal(mask, LOGITS[0] > 0)


def test_logits_place_the_outline_between_pixels() -> None:
    # A line at column 20.3: logits fall off linearly across it, so that their zero is where the line is.
    columns = np.tile(np.arange(WIDTH, dtype=np.float64), (HEIGHT, 1))
    (coverage,) = masks_from_segmenter(0.1 * (20.3 - columns), kind="logit", coverage=True)
    assert coverage.dtype == np.float32
    ring = np.concatenate(ImageRegion.from_mask(coverage).rings)
    assert ring[:, 0].max() == pytest.approx(20.3, abs=1e-3)


def test_kind_overrules_the_guess() -> None:
    given_array = np.full((1, 4, 4), 0.3)
    assert not masks_from_segmenter(given_array)[0].any()
    assert masks_from_segmenter(given_array, kind="logit")[0].all()
    assert masks_from_segmenter(given_array, kind="mask")[0].all()


@pytest.mark.parametrize(
    ("given_array", "message"),
    [
        (np.zeros((2, 2, 4, 4)), r"shape \(2, 2, 4, 4\)"),
        (np.zeros(5), "needed numbers"),
        (np.zeros((0, 4, 4)), r"shape \(0, 4, 4\)"),
        ([], r"shape \(0,\)"),
        (np.full((4, 4), np.nan), "NaN or infinite"),
        (np.array([["a", "b"], ["c", "d"]]), "needed numbers"),
        (np.array([[0, 1], [2, 3]]), "4 integer values; needed 0 and 1"),
        ([np.zeros((4, 4)), np.zeros((3, 4))], r"shapes \[\(3, 4\), \(4, 4\)\]; needed one shape"),
        ([{"bbox": 3}], "mask 0 has no 'segmentation'"),
        ([{"segmentation": {"size": 5, "counts": [25]}}], r"mask 0 has the size 5; needed \(h, w\)"),
        ([{"segmentation": {"size": [5, 5, 1], "counts": [25]}}], r"mask 0 has the size \[5, 5, 1\]"),
        ([[[1, 0], [1]]], "mask 0 has rows of unequal length"),
        ([{"segmentation": {"size": [4, 4], "counts": [5]}}], "mask 0 has run lengths for 5 pixels; needed 16"),
        ([{"segmentation": {"counts": [5]}}], "mask 0 has h None"),
    ],
)
def test_arrays_that_are_no_masks(given_array: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        masks_from_segmenter(given_array)


def test_values_that_are_not_of_the_kind_said() -> None:
    with pytest.raises(ValueError, match=r"from -4.0 to 5.0; needed probabilities"):
        masks_from_segmenter(LOGITS, kind="probability")
    with pytest.raises(ValueError, match=r"kind is 'sam'; needed 'mask', 'probability', 'logit' or None"):
        masks_from_segmenter(LOGITS, kind="sam")  # type: ignore[arg-type]
