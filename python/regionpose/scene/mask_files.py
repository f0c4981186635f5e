"""Masks of image regions read from pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

MOST_VALUES_SHOWN = 12
"""Labels that a message lists at most."""


def read_mask(path: Path, label: int | None = None) -> NDArray[np.bool_]:
    """The mask (h, w) in a picture: its pixels of the value `label`, or those that are not 0 where it holds one other
    value.

    ValueError for a picture with colours, for several values without a label, and for a label that no pixel has.
    """
    values = _values(path)
    present = np.unique(values)
    present = present[present != 0]
    if label is None:
        if len(present) != 1:
            raise ValueError(
                f"{path}: found {len(present)} values besides 0; needed one, or the key label ({_listed(present)})"
            )
        return np.asarray(values != 0)
    if label not in present:
        raise ValueError(f"{path}: found no pixel of the label {label!r}; needed one of {_listed(present)}")
    return np.asarray(values == label)


def _values(path: Path) -> NDArray[np.generic]:
    try:
        with Image.open(path) as picture:
            values = np.asarray(picture)
    except FileNotFoundError:
        raise
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"{path}: found no picture ({error}); needed a mask or labels as PNG") from error
    if values.ndim == 3 and (values[:, :, :3] == values[:, :, :1]).all():
        return np.asarray(values[:, :, 0])
    if values.ndim != 2:
        raise ValueError(f"{path}: found a picture in colour; needed one value for each pixel")
    return values


def _listed(values: NDArray[np.generic]) -> str:
    shown = ", ".join(str(value) for value in values[:MOST_VALUES_SHOWN])
    return (shown or "none") + (", ..." if len(values) > MOST_VALUES_SHOWN else "")
