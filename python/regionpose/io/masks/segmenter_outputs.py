"""The masks in what segmenters of other libraries return, by attributes and keys; none of them is imported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from regionpose.io.masks.mask_items import Drawn, polygon_mask
from regionpose.validation.foreign import as_array

MASK_AXES = 2
"""Axes of masks beyond those of their scores, which distinguish a predictor's tuple from a tuple of masks."""


def output_masks(output: Any) -> Any:
    """What of a segmenter's output holds its masks: an array (n, h, w), or a sequence of masks.

    Results of ultralytics, detections of supervision, mappings of transformers, triples of Segment Anything; anything
    else as it is.
    """
    if isinstance(output, Mapping):
        return _of_mapping(output)
    if _is_list_of(output, "masks") and len(output) == 1:
        # ultralytics returns a list of one result an image.
        return output_masks(output[0])
    if hasattr(output, "masks") and not isinstance(output, np.ndarray):
        return _of_ultralytics(output.masks)
    if hasattr(output, "mask") and hasattr(output, "xyxy"):
        return _found(output.mask, "detections")
    if isinstance(output, tuple) and len(output) >= 2 and np.ndim(output[0]) - np.ndim(output[1]) == MASK_AXES:
        return _by_score(*output[:2])
    if _is_list_of_keys(output, "mask"):
        return [entry["mask"] for entry in output]
    return output


def _of_mapping(output: Mapping[str, Any]) -> Any:
    """Of transformers: masks, or a map (h, w) of the ids of `segments_info`."""
    if "masks" in output:
        return _found(output["masks"], "output")
    if "segmentation" in output and "segments_info" in output:
        places = as_array(output["segmentation"], "segmentation", "ids (h, w)")
        ids = [segment["id"] for segment in output["segments_info"]]
        if not ids:
            raise ValueError("segments_info is empty; needed a segment")
        return np.stack([places == number for number in ids])
    if "segmentation" in output:
        return [output]
    raise ValueError(f"masks has the keys {sorted(map(str, output))}; needed 'masks' or 'segmentation'")


def _of_ultralytics(masks: Any) -> Any:
    """Its masks at the photo's size: masks of the network's own size are redrawn from their polygons."""
    if masks is None:
        raise ValueError("result has no masks; needed one at least, of a model that segments")
    data = as_array(_found(masks.data, "result"), "masks.data", "(n, h, w)")
    size = tuple(masks.orig_shape)
    if data.shape[1:] == size:
        return data
    # Its polygons have integers at the centers of pixels.
    return np.stack(
        [polygon_mask([Drawn(np.asarray(ring, dtype=np.float64).reshape(-1, 2))], size) for ring in masks.xy]
    )


def _by_score(masks: Any, scores: Any) -> Any:
    """Masks (n, h, w) by falling score (n,), or of several prompts (m, n, h, w) the best of each by (m, n)."""
    stack, ranks = as_array(masks, "masks", "(n, h, w)"), as_array(scores, "scores", "(n,)")
    if ranks.shape != stack.shape[:-2]:
        raise ValueError(f"scores have shape {ranks.shape}; needed {stack.shape[:-2]}, one a mask")
    if ranks.ndim == 0:
        return stack
    if ranks.ndim == 2:
        return np.take_along_axis(stack, ranks.argmax(axis=1)[:, None, None, None], axis=1)[:, 0]
    return stack[np.argsort(-ranks, kind="stable")]


def _found(masks: Any, item: str) -> Any:
    """The masks, where there are any."""
    if masks is None or len(masks) == 0:
        raise ValueError(f"{item} has no masks; needed one at least, of a model that segments")
    return masks


def _is_list_of(output: Any, attribute: str) -> bool:
    return isinstance(output, Sequence) and bool(output) and all(hasattr(entry, attribute) for entry in output)


def _is_list_of_keys(output: Any, key: str) -> bool:
    return (
        isinstance(output, Sequence)
        and bool(output)
        and all(isinstance(entry, Mapping) and key in entry for entry in output)
    )
