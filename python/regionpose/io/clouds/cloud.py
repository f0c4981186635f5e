"""The cloud: points, kept about a local origin, with colors, intensity, other scalars and triangles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from regionpose.io.clouds.errors import cloud_error
from regionpose.validation.arrays import Array, KeptArrays
from regionpose.validation.foreign import HasPoints, HasVertices, as_array, surface_of

Scalars = NDArray[Any]

ORIGIN_THRESHOLD = 10_000.0
"""An axis whose median coordinate is further than this from zero (meters) gets a local origin: a scanner's own frame
stays below it, the coordinates of maps lie above, and squares of coordinates below it are rounded by at most 1e-8
square meters."""

ORIGIN_STEP = 100.0
"""The origin is a multiple of this (meters), so that taking it off coordinates of its size rounds nothing."""

MEDIAN_SAMPLE = 10_000
"""Points, evenly spread over the file, whose median gives the origin."""

BYTE_LIMIT, WORD_LIMIT = 255, 65535
"""Largest color of 8 and of 16 bits."""


@dataclass(frozen=True, eq=False)
class Cloud(KeptArrays):
    """Points of the world, each with what was measured there.

    Parameters
    ----------
    local_points : (n, 3) array of float64
        About `origin`, in the file's unit (meters, as a rule); `points` are the same in the world.
    colors : (n, 3) array of uint8, optional
        sRGB.
    intensity : (n,) array of float64, optional
        In the file's own scale; NaN where it wasn't measured.
    fields : mapping of str to (n,) array
        Other scalars by name.
    triangles : (k, 3) array of int64, optional
        Indices of a mesh.
    origin : (3,) array of float64
        Of the local points in the world, zero unless the coordinates are large.
    source : Path, optional
        The file read.
    dropped : int
        Points of the file left out: a coordinate was NaN or infinite, or all three were zero, as scanners write of a
        beam without a return. A mesh keeps its vertices at zero.
    file_indices : (n,) array of int64, optional
        Ascending, of the points among all of the file's, the dropped ones counted; None where none was dropped.
    empty : tuple of str
        Columns of the file left out since they hold no finite number: `intensity` or nothing.
    grid_shape : tuple of 2 int, optional
        Rows and columns of an organized scan; None where the file has no grid.
    grid_indices : (n,) array of int64, optional
        Of each point in that grid, row by row: `divmod(grid_indices, columns)` gives row and column. Cells of the grid
        without a point are beams without a return. Given exactly where `grid_shape` is.
    sensor_origin : (3,) array of float64, optional
        Where the scanner stood in the world; None where the file doesn't state it, or holds scans from several places.
    unit_m : float, optional
        Of the coordinates' unit, meters; they are left as they are. None where the file doesn't state it.

    Raises
    ------
    CloudError
        A ValueError, for shapes that disagree, coordinates that are not finite, and triangles that name no point.
        The arrays are kept as read-only views.

    Examples
    --------
    >>> import regionpose as rp
    >>> cloud = rp.Cloud.from_points([[431999.0, 5400000.0, 119.0], [432000.0, 5400000.0, 119.5]])
    >>> cloud.points[0].tolist()
    [431999.0, 5400000.0, 119.0]
    """

    local_points: Array
    colors: NDArray[np.uint8] | None = None
    intensity: Array | None = None
    fields: Mapping[str, Scalars] = field(default_factory=dict)
    triangles: NDArray[np.int64] | None = None
    origin: Array = field(default_factory=lambda: np.zeros(3))
    source: Path | None = None
    dropped: int = 0
    sensor_origin: Array | None = None
    unit_m: float | None = None
    file_indices: NDArray[np.int64] | None = None
    empty: tuple[str, ...] = ()
    grid_shape: tuple[int, int] | None = None
    grid_indices: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        """Check the parts and keep read-only views of them."""
        count = len(self._keep("local_points", np.float64, (-1, 3)))
        if not count:
            raise cloud_error(self.source, "points", "none", "at least 1")
        self._keep("origin", np.float64, (3,))
        self._keep("sensor_origin", np.float64, (3,))
        for name in ("local_points", "origin", "sensor_origin"):
            if getattr(self, name) is not None and not np.isfinite(getattr(self, name)).all():
                raise cloud_error(self.source, name, "NaN or infinite coordinates", "finite numbers")
        self._keep("colors", np.uint8, (count, 3))
        self._keep("intensity", np.float64, (count,))
        object.__setattr__(self, "fields", MappingProxyType(self._checked_fields(count)))
        self._keep("file_indices", np.int64, (count,))
        self._check_grid(count)
        triangles = self._keep("triangles", np.int64, (-1, 3))
        if triangles.size and (triangles.min() < 0 or triangles.max() >= count):
            found = f"indices from {triangles.min()} to {triangles.max()}"
            raise cloud_error(self.source, "triangles", found, f"indices from 0 to {count - 1}")

    def __getstate__(self) -> dict[str, object]:
        """Its parts, without what is made of them; a view of a mapping can't be pickled."""
        return {part.name: getattr(self, part.name) for part in fields(self)} | {"fields": dict(self.fields)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        """Take the parts that were kept, read-only again."""
        super().__setstate__({**state, "fields": MappingProxyType(state["fields"])})

    def _keep(self, name: str, kind: type[np.generic], shape: tuple[int, ...]) -> Scalars:
        """The attribute `name` as a read-only array of `shape` (-1: any length), stored so unless it is None."""
        given = getattr(self, name)
        if given is None:
            return np.empty((0, 3), dtype=kind)
        view = _typed(np.asarray(given), kind)
        lengths_agree = view is not None and all(
            need in (-1, have) for need, have in zip(shape, view.shape, strict=False)
        )
        if view is None or view.ndim != len(shape) or not lengths_agree:
            found = f"{np.asarray(given).dtype} of shape {np.shape(given)}"
            wanted = str(shape).replace("-1", "n")
            raise cloud_error(self.source, name, found, f"{np.dtype(kind).name} of shape {wanted}")
        view = view.view()
        view.setflags(write=False)
        object.__setattr__(self, name, view)
        return view

    def _check_grid(self, count: int) -> None:
        """CloudError unless every point has a cell of its own in the grid, or there is no grid."""
        cells = self._keep("grid_indices", np.int64, (count,))
        if (self.grid_shape is None) != (self.grid_indices is None):
            raise cloud_error(self.source, "grid_shape", self.grid_shape, "it together with grid_indices")
        if self.grid_shape is None:
            return
        rows, columns = self.grid_shape
        differ = (np.diff(cells) > 0).all() or len(np.unique(cells)) == count
        if cells.min() < 0 or cells.max() >= rows * columns or not differ:
            found = f"{count} indices from {cells.min()} to {cells.max()}"
            raise cloud_error(self.source, "grid_indices", found, f"different ones of {rows} x {columns} cells")

    def _checked_fields(self, count: int) -> dict[str, Scalars]:
        """The fields as read-only arrays of numbers (count,)."""
        fields = {}
        for name, values in self.fields.items():
            scalars = np.asarray(values).view()
            if scalars.shape != (count,) or scalars.dtype.kind not in "biuf":
                found = f"{scalars.dtype} of shape {scalars.shape}"
                raise cloud_error(self.source, f"field {name}", found, f"numbers of shape ({count},)")
            scalars.setflags(write=False)
            fields[name] = scalars
        return fields

    @classmethod
    def from_points(
        cls,
        points: ArrayLike | HasPoints | HasVertices,
        *,
        colors: ArrayLike | None = None,
        intensity: ArrayLike | None = None,
        fields: Mapping[str, ArrayLike] | None = None,
        triangles: ArrayLike | None = None,
        source: Path | None = None,
        grid_shape: tuple[int, int] | None = None,
        grid_indices: ArrayLike | None = None,
    ) -> Cloud:
        """The cloud of world coordinates without the points that are none, the rest kept about a local origin.

        Points that are not finite are dropped, and points at (0, 0, 0), which scanners write of beams without a return,
        unless there are triangles: a mesh may have a vertex there. An axis whose median lies beyond 10 km gets the
        nearest multiple of 100 m as its origin, every other axis zero.

        Parameters
        ----------
        points : (n, 3) array, or a cloud or mesh of Open3D or trimesh
            World coordinates; of another library's object its colors and triangles, too.
        colors : (n, 3) array, optional
            Of 8 bits, which are kept; of 16 bits, or fractions up to 1, which are brought to 8.
        intensity : (n,) array, optional
            In any scale; left out, and named in `empty`, where none of it is finite.
        fields : mapping of str to (n,) array, optional
            Other scalars.
        triangles : (k, 3) array of int, optional
            Those that touch a dropped point are dropped.
        source : Path, optional
            The file read.
        grid_shape : tuple of 2 int, optional
            Rows and columns of an organized scan.
        grid_indices : (n,) array of int, optional
            Of the points in that grid, row by row; 0, 1, 2 and on when left out.

        Raises
        ------
        CloudError
            A ValueError, where no point is finite or shapes disagree.
        """
        surface = surface_of(points)
        if surface is not None:
            points = surface.points
            colors = surface.colors if colors is None else colors
            triangles = surface.triangles if triangles is None else triangles
        world = as_array(points, "points", "(n, 3)")
        if world.ndim != 2 or world.shape[1] != 3 or world.dtype.kind not in "iuf":
            raise cloud_error(source, "points", f"{world.dtype} of shape {world.shape}", "numbers of shape (n, 3)")
        world = np.asarray(world, dtype=np.float64)
        kept_rows = _are_points(world, of_scan=triangles is None)
        if not kept_rows.any():
            found = f"{len(world)} points, none with finite coordinates but zeros" if len(world) else "no points"
            raise cloud_error(source, "points", found, "at least 1 with finite coordinates, not all zero")

        def kept(name: str, values: ArrayLike) -> Scalars:
            return _kept_rows(name, values, kept_rows, source)

        points = kept("points", world)
        strengths = None if intensity is None else kept("intensity", intensity)
        is_empty = strengths is not None and strengths.dtype.kind == "f" and not np.isfinite(strengths).any()
        origin = _origin(points)
        cells = np.arange(len(world)) if grid_indices is None else grid_indices
        return cls(
            local_points=points - origin if origin.any() else points,
            colors=None if colors is None else _bytes_of_colors(kept("colors", colors), source),
            intensity=None if is_empty else strengths,
            empty=("intensity",) if is_empty else (),
            fields={name: kept(f"field {name}", values) for name, values in (fields or {}).items()},
            triangles=None if triangles is None else _kept_triangles(np.asarray(triangles), kept_rows, source),
            origin=origin,
            source=source,
            dropped=len(world) - len(points),
            file_indices=None if len(points) == len(world) else np.flatnonzero(kept_rows),
            grid_shape=grid_shape,
            grid_indices=None if grid_shape is None else kept("grid_indices", cells),
        )

    def scanned_from(self, place: ArrayLike) -> Cloud:
        """The same, scanned from a place (3,) of the world."""
        return replace(self, sensor_origin=np.asarray(place, dtype=np.float64))

    def rebase(self, origin: ArrayLike) -> Cloud:
        """The same world points, kept about another origin (3,)."""
        other = np.asarray(origin, dtype=np.float64)
        if np.array_equal(other, self.origin):
            return self
        return replace(self, local_points=self.local_points + (self.origin - other), origin=other)

    def to_file_indices(self, indices: ArrayLike) -> NDArray[np.int64]:
        """Indices of the file's points, the dropped ones counted, of indices (k,) of the cloud's."""
        chosen = np.asarray(indices, dtype=np.int64)
        return chosen if self.file_indices is None else self.file_indices[chosen]

    def from_file_indices(self, indices: ArrayLike) -> NDArray[np.int64]:
        """Indices of the cloud's points of indices (k,) of the file's; those of dropped points are left out.

        CloudError for indices that the file does not have.
        """
        chosen, count = np.asarray(indices, dtype=np.int64), len(self) + self.dropped
        if chosen.size and (chosen.min() < 0 or chosen.max() >= count):
            found = f"{len(chosen)} from {chosen.min()} to {chosen.max()}"
            raise cloud_error(self.source, "indices", found, f"indices from 0 to {count - 1}")
        if self.file_indices is None:
            return chosen
        places = np.minimum(np.searchsorted(self.file_indices, chosen), len(self) - 1)
        return np.asarray(places[self.file_indices[places] == chosen])

    @cached_property
    def points(self) -> Array:
        """The points (n, 3) in world coordinates, float64, read-only."""
        if not self.origin.any():
            return self.local_points
        world = self.local_points + self.origin
        world.setflags(write=False)
        return world

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """The points (n, 3) in world coordinates, so that a cloud is taken where points are."""
        points = self.points if dtype is None else self.points.astype(dtype, copy=False)
        return points.copy() if copy else points

    def __len__(self) -> int:
        """The number of points."""
        return len(self.local_points)

    def __repr__(self) -> str:
        """The counts and what the cloud carries."""
        parts = [f"{len(self)} points"]
        parts += [name for name in ("colors", "intensity") if getattr(self, name) is not None]
        parts += [f"fields {', '.join(self.fields)}"] if self.fields else []
        parts += [f"{len(self.triangles)} triangles"] if self.triangles is not None else []
        parts += [f"origin {self.origin.tolist()}"] if self.origin.any() else []
        parts += [] if self.sensor_origin is None else [f"scanned from {self.sensor_origin.tolist()}"]
        parts += [] if self.grid_shape is None else [f"grid {self.grid_shape[0]} x {self.grid_shape[1]}"]
        parts += [f"{self.dropped} dropped"] if self.dropped else []
        return f"Cloud({', '.join(parts)})"


def _typed(array: Scalars, kind: type[np.generic]) -> Scalars | None:
    """`array` as `kind`, None where that would change its values: numbers as floats, integers alone as integers."""
    if np.issubdtype(kind, np.floating):
        return np.asarray(array, dtype=kind) if array.dtype.kind in "biuf" else None
    if array.dtype == kind:
        return array
    fits = array.dtype.kind in "iu" and np.can_cast(array.dtype, kind, "same_kind") and kind is not np.uint8
    return np.asarray(array, dtype=kind) if fits else None


def _are_points(world: Array, *, of_scan: bool) -> NDArray[np.bool_]:
    """Which of the coordinates (n, 3) are points: finite, and of a scan not all zero."""
    x, y, z = world.T
    finite: NDArray[np.bool_] = np.isfinite(x) & np.isfinite(y) & np.isfinite(z)
    return finite & ((x != 0.0) | (y != 0.0) | (z != 0.0)) if of_scan else finite


def _kept_rows(name: str, values: ArrayLike, kept: NDArray[np.bool_], source: Path | None) -> Scalars:
    """The rows of `values` that are kept."""
    array = np.asarray(values)
    if array.shape[:1] != kept.shape:
        raise cloud_error(source, name, f"shape {array.shape}", f"{len(kept)} rows, one a point")
    return array if kept.all() else array[kept]


def _origin(world: Array) -> Array:
    """The local origin (3,) of finite world coordinates (n, 3)."""
    median = np.median(world[:: max(1, len(world) // MEDIAN_SAMPLE)], axis=0)
    origin = np.where(np.abs(median) > ORIGIN_THRESHOLD, np.round(median / ORIGIN_STEP) * ORIGIN_STEP, 0.0)
    return np.asarray(origin, dtype=np.float64)


def _bytes_of_colors(colors: Scalars, source: Path | None) -> NDArray[np.uint8]:
    """Colors (n, 3) of 8 bits: fractions times 255, and the upper byte of 16 bits where a value exceeds 255."""
    if colors.dtype == np.uint8:
        return colors
    needed = "numbers in [0, 1], [0, 255] or [0, 65535]"
    if colors.dtype.kind not in "iuf":
        raise cloud_error(source, "colors", colors.dtype, needed)
    least, most = colors.min(), colors.max()
    if not (least >= 0 and most <= WORD_LIMIT):
        raise cloud_error(source, "colors", f"values from {least} to {most}", needed)
    if colors.dtype.kind == "f" and most <= 1.0:
        return np.asarray(np.rint(colors * BYTE_LIMIT), dtype=np.uint8)
    if most > BYTE_LIMIT:
        return np.asarray(colors.astype(np.uint16) >> 8, dtype=np.uint8)
    return np.asarray(np.rint(colors), dtype=np.uint8)


def _kept_triangles(triangles: Scalars, finite: NDArray[np.bool_], source: Path | None) -> Scalars:
    """The triangles whose three points are finite, by the points' new indices."""
    whole = triangles.ndim == 2 and triangles.shape[1] == 3 and triangles.dtype.kind in "iu"
    if not whole or (triangles.size and (triangles.min() < 0 or triangles.max() >= len(finite))):
        found = f"{triangles.dtype} of shape {triangles.shape}"
        raise cloud_error(source, "triangles", found, f"indices from 0 to {len(finite) - 1} of shape (k, 3)")
    if finite.all():
        return triangles
    numbers = np.cumsum(finite) - 1
    return np.asarray(numbers[triangles[finite[triangles].all(axis=1)]])
