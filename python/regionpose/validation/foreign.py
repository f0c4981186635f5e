"""Arrays and shapes of other libraries, read by their attributes; none of them is imported."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


def as_array(values: object, item: str, needed: str) -> NDArray[Any]:
    """The values as an array, in place where they are one; ValueError with the reason where they can't be.

    Lists, arrays and tensors. Of a tensor on a GPU, or one that records gradients, the reason is torch's own advice.
    """
    try:
        return np.asarray(values)
    except (TypeError, ValueError, RuntimeError) as error:
        if isinstance(values, list | tuple) and isinstance(error, ValueError):
            raise ValueError(f"{item} has rows of unequal length; needed {needed}") from error
        raise ValueError(f"{item} is not an array of numbers ({error}); needed {needed}") from error


def polygon_parts(shape: object) -> list[list[Any]] | None:
    """Rings of each polygon of a shapely geometry, the outer one first, without their closing vertices; else None.

    ValueError for geometries without an area, such as lines.
    """
    kind = getattr(shape, "geom_type", None)
    if kind is None:
        return None
    parts = list(getattr(shape, "geoms", [shape]))
    if not parts or any(part.geom_type != "Polygon" or part.is_empty for part in parts):
        raise ValueError(f"found an empty or flat {kind}; needed a Polygon or MultiPolygon with an area")
    return [[np.asarray(ring.coords)[:-1] for ring in (part.exterior, *part.interiors)] for part in parts]


class HasPoints(Protocol):
    """A cloud of Open3D, for one."""

    @property
    def points(self) -> Any:
        """Rows (n, 3)."""


class HasVertices(Protocol):
    """A mesh of trimesh or Open3D, for one."""

    @property
    def vertices(self) -> Any:
        """Rows (n, 3)."""


class Surface(NamedTuple):
    """What a cloud or a mesh of another library holds: points (n, 3), colors (n, 3) and triangles (k, 3)."""

    points: NDArray[Any]
    colors: NDArray[Any] | None
    triangles: NDArray[Any] | None


def surface_of(foreign: object) -> Surface | None:
    """The points, colors and triangles of a cloud or mesh of Open3D or trimesh; None for other objects."""
    name = next((name for name in ("vertices", "points") if hasattr(foreign, name)), None)
    if name is None:
        return None
    points = np.asarray(getattr(foreign, name)).reshape(-1, 3)
    triangles = _rows(foreign, "triangles", "faces")
    return Surface(points, _vertex_colors(foreign, len(points)), triangles)


def _vertex_colors(foreign: object, count: int) -> NDArray[Any] | None:
    """Red, green and blue of each point, where the object has them."""
    visual = getattr(foreign, "visual", None)
    if visual is not None:
        # trimesh makes some up where there are none.
        colors = _rows(visual, "vertex_colors") if getattr(visual, "defined", False) else None
    else:
        colors = _rows(foreign, "vertex_colors", "colors")
    return None if colors is None or len(colors) != count else colors[:, :3]


def _rows(foreign: object, *names: str) -> NDArray[Any] | None:
    """The first of the attributes that holds rows of numbers."""
    arrays = (np.asarray(getattr(foreign, name, None)) for name in names)
    return next((array for array in arrays if array.ndim == 2 and len(array)), None)
