"""Predictors of other libraries (Segment Anything and its kin) as segmenters of clicked pixels."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from regionpose.io.masks.readers import masks_from_segmenter

Shares = NDArray[np.float32]
Segmenter = Callable[[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int64]], Any]
"""Called with an image (h, w, 3) sRGB, pixels (n, 2) and labels (n,): 1 for a pixel inside, 0 for one outside.

Returns a mask (h, w) or a stack of masks (k, h, w), the best one first, as `masks_from_segmenter` reads them."""


class Predictor(Protocol):
    """An object as SAM and its kin have it."""

    def set_image(self, image: Any) -> Any:
        """Encode an image (h, w, 3)."""

    def predict(self, *, point_coords: Any, point_labels: Any, multimask_output: bool) -> Any:
        """Masks (k, h, w), their scores (k,), and more that isn't used."""


class PredictorSegmenter:
    """A segmenter of an object with `set_image` and `predict`; an image is set once as long as clicks are in it.

    Parameters
    ----------
    predictor : Predictor
        As SAM2ImagePredictor or SamPredictor.
    """

    def __init__(self, predictor: Predictor) -> None:
        """Wrap this object."""
        self._predictor = predictor
        self._image: NDArray[np.uint8] | None = None

    def __call__(self, image: NDArray[np.uint8], pixels: NDArray[np.float32], labels: NDArray[np.int64]) -> Any:
        """What the object returns: masks (k, h, w) around the pixels, their scores, and more."""
        if self._image is not image:
            self._predictor.set_image(image)
            self._image = image
        return self._predictor.predict(point_coords=pixels, point_labels=labels, multimask_output=True)


def load_segmenter(name: str) -> Segmenter:
    """The segmenter that `module:callable` names: a segmenter, a predictor, or a function or class that makes one.

    Modules of the working folder are found, too. ValueError for a name that leads to none.
    """
    module_name, colon, attribute = name.partition(":")
    if not (module_name and colon and attribute) or module_name.startswith("."):
        raise ValueError(f"segmenter: found {name!r}; needed module:callable")
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        target = getattr(importlib.import_module(module_name), attribute)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"segmenter: found no {name} ({error}); needed module:callable") from error
    instance = target() if isinstance(target, type) else target
    if hasattr(instance, "set_image") and hasattr(instance, "predict"):
        return PredictorSegmenter(instance)
    if not callable(instance):
        raise ValueError(f"segmenter: found {name} to be a {type(instance).__name__}; needed something to call")
    return cast(Segmenter, instance)


def segmented(
    segmenter: Segmenter, image: NDArray[np.uint8], pixels: Sequence[Sequence[float]], labels: Sequence[int]
) -> list[Shares]:
    """Masks as fractions (h, w) in [0, 1] that a segmenter finds around pixels (n, 2), the best one first.

    ValueError for what is no mask of the image, or none that holds any pixel.
    """
    found = segmenter(image, np.asarray(pixels, dtype=np.float32), np.asarray(labels, dtype=np.int64))
    fractions = [np.asarray(mask, dtype=np.float32) for mask in masks_from_segmenter(found, coverage=True)]
    size = image.shape[:2]
    if any(mask.shape != size for mask in fractions):
        raise ValueError(f"the segmenter found masks of shape {fractions[0].shape}; needed {size}, as the image")
    kept = [mask for mask in fractions if (mask > 0.5).any()]
    if not kept:
        raise ValueError("the segmenter found nothing there; needed a pixel of something")
    return kept
