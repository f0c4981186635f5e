"""Pictures as PNG files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from regionpose import _core
from regionpose.io.outputs.whole_file import whole_file
from regionpose.validation.arrays import checked_image


def save_png(path: str | os.PathLike[str], picture: ArrayLike, *, overwrite: bool = False) -> Path:
    """Write a picture (h, w, 3) or (h, w) as PNG, whole or not at all, and return its path.

    FileExistsError unless `overwrite`, which replaces the old file when the new one is complete.
    """
    data = _core.png_bytes(np.ascontiguousarray(checked_image(picture)))
    with whole_file(Path(path), overwrite=overwrite) as file:
        file.write(data)
    return Path(path)
