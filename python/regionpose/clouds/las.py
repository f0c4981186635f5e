"""Reading LAS and LAZ through laspy (extra `las`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from regionpose.clouds.cloud import Cloud, Scalars
from regionpose.clouds.columns import COLOUR_NAMES, cloud_of_columns
from regionpose.clouds.errors import cloud_error, load_extra

POINT_FORMAT_BYTE = 104
"""Where the header holds the point format; its top bits are set when the points are compressed."""

COMPRESSED_BITS = 0b1100_0000

RAW_COORDINATES = ("X", "Y", "Z")


def read_las(path: Path) -> Cloud:
    """The cloud of a LAS or LAZ file: scaled coordinates, colours brought to 8 bits, other dimensions as fields."""
    laspy = load_extra("laspy", "las", f"{path}: LAS")
    with path.open("rb") as file:
        start = file.read(POINT_FORMAT_BYTE + 1)
    if len(start) > POINT_FORMAT_BYTE and start[POINT_FORMAT_BYTE] & COMPRESSED_BITS:
        load_extra("lazrs", "las", f"{path}: LAZ")
    try:
        stored = laspy.read(path)
        names = [*stored.point_format.dimension_names]
        named = {name: np.asarray(stored[name]) for name in names if name not in RAW_COORDINATES}
        coordinates = {name.lower(): np.asarray(stored[name.lower()]) for name in RAW_COORDINATES}
        stated = int(stored.header.point_count)
    # Damage shows as laspy's, lazrs', numpy's and struct's own errors.
    except Exception as error:
        raise cloud_error(path, "points", f"{type(error).__name__}: {error}", "a whole LAS or LAZ file") from error
    if len(coordinates["x"]) != stated:
        raise cloud_error(path, "points", len(coordinates["x"]), f"{stated}, as the header says")
    return cloud_of_columns(path, coordinates | _flat(named))


def _flat(named: dict[str, Scalars]) -> dict[str, Scalars]:
    """Columns (n,): dimensions with several values apart, colours left out where all are zero, as unset."""
    flat: dict[str, Scalars] = {}
    for name, values in named.items():
        if values.ndim == 2:
            flat.update({f"{name}_{index}": values[:, index] for index in range(values.shape[1])})
        else:
            flat[name] = values
    colours = COLOUR_NAMES[0]
    if all(name in flat and not flat[name].any() for name in colours):
        return {name: values for name, values in flat.items() if name not in colours}
    return flat
