"""Beams of a scan without a return, inferred from the order of its points: each passed all that it would have met.

A spinning scanner sends its beams in rings, cones about its axis, by even turns. What a ring lacks between its returns,
or an organized scan in its cells, are beams that came back from nowhere.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.regions.plane_samples import PlaneSamples, checked_sensor
from regionpose.validation.arrays import Array, check_coordinates, row_array

Indices = NDArray[np.int64]

BEAM = 0.5
"""Steps from one beam to the next by which one may lie off its place and still be that one: nearer to no other."""

MOSTLY = 0.95
"""Fraction of the returns that must lie so near to their places: the rest are those of a moving scanner, or second
returns. A convention."""

BACK = 0.2
"""Angle (rad) by which a return lies behind the last one, from which on it is one of the next turn: a moving scanner's
lie behind by less, and fields are wider. A convention."""

LEAST_RINGS = 4
"""Rings, and returns of each in the mean, with fewer of which an order is chance: a convention."""

UP = np.array([0.0, 0.0, 1.0])
"""What a scanner turns about where its cloud is in its own frame."""

REACH_PERCENTILE = 98.0
"""Percentile of the ranges that stands for how far a scan reaches: beyond it lie stray returns. A convention."""


class Turn(NamedTuple):
    """Angles (n,) of directions about a scanner's axis: around it, and above the plane across it, rad."""

    around: Array
    above: Array


class Axis(NamedTuple):
    """A scanner's axes: rows across, across and along its axis of rotation (3, 3)."""

    axes: Array

    @classmethod
    def along(cls, axis: Array) -> Axis:
        """Of an axis of rotation (3,)."""
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        return cls(np.array([across, np.cross(axis, across), axis]))

    def turns(self, directions: Array) -> Turn:
        """Of unit vectors (n, 3)."""
        x, y, z = self.axes @ directions.T
        return Turn(np.arctan2(y, x), np.arcsin(np.clip(z, -1.0, 1.0)))

    def directions(self, turn: Turn) -> Array:
        """Unit vectors (n, 3) of angles."""
        across = np.cos(turn.above)
        flat = np.stack([across * np.cos(turn.around), across * np.sin(turn.around), np.sin(turn.above)], axis=1)
        return np.asarray(flat @ self.axes)


def absent_beams(
    points: ArrayLike,
    sensor_origin: ArrayLike,
    *,
    grid_shape: tuple[int, int] | None = None,
    grid_indices: ArrayLike | None = None,
    rings: ArrayLike | None = None,
) -> Array:
    """The beams of one turn of a spinning scanner that gave no return, inferred from its points.

    They follow from the cells of an organized scan; or by the rings that beams belong to, one after the other in the
    order of the points unless their numbers are given. A beam is then absent where its ring has none, at an angle at
    which any ring has one. A depth camera's cells are no evidence: what it misses beside an edge, it could not see.

    Parameters
    ----------
    points : (n, 3) array
        Of one scan, meters, in the order of its file.
    sensor_origin : (3,) array
        The scanner's position, meters.
    grid_shape : tuple of 2 int, optional
        Rows and columns of an organized scan, as `Cloud.grid_shape`.
    grid_indices : (n,) array of int, optional
        Of each point in that grid, as `Cloud.grid_indices`.
    rings : (n,) array of int, optional
        The number of the ring that each point belongs to, where there is no grid.

    Returns
    -------
    (k, 3) array
        Unit vectors from the scanner; none where the points' order determines no beams.

    Raises
    ------
    ValueError
        For points that are not finite, for grid indices or rings of another number, and cells that the grid has not.

    Examples
    --------
    >>> import numpy as np
    >>> import regionpose as rp
    >>> angle, height = np.meshgrid(np.radians(np.arange(0.0, 360.0)), np.radians(np.arange(-8.0, 9.0, 2.0)))
    >>> ways = np.stack([np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), np.sin(height)], axis=-1)
    >>> scan = np.delete(5.0 * ways.reshape(-1, 3), np.arange(1000, 1020), axis=0)
    >>> len(rp.regions.absent_beams(scan, [0, 0, 0]))
    20
    """
    given = row_array(points, "points", 3)
    check_coordinates(given)
    sensor = checked_sensor(sensor_origin)
    assert sensor is not None
    offsets = given - sensor
    ranges = np.linalg.norm(offsets, axis=1)
    measured = ranges > 0.0
    directions = offsets[measured] / ranges[measured, None]
    if grid_shape is not None and grid_indices is not None:
        cells = _numbers(grid_indices, "grid_indices", given)
        most = grid_shape[0] * grid_shape[1] - 1
        if cells.size and not 0 <= cells.min() <= cells.max() <= most:
            raise ValueError(f"grid_indices holds {cells.min()} to {cells.max()}; needed cells from 0 to {most}")
        return _of_grid(directions, grid_shape, cells[measured])
    numbers = None if rings is None else _numbers(rings, "rings", given)[measured]
    return _of_rings(directions, numbers)


def absent_places(beams: Array, own: Array, reach: float, plane: PlaneSamples, sensor: Array) -> Array:
    """Places (m, 2) at which beams without a return, directions (k, 3), passed the plane of the returns `own` (n, 3).

    A beam without a return passed what would have sent one: the plane as near as the farthest of its own returns, or a
    plane as bright as what the scan's farthest returns, at `reach` (meters), came from. The power of a return goes with
    the cosine of the angle at which the beam meets the plane, and the inverse square of the range.
    """
    normal = plane.axes[2]
    depth, toward = float((plane.origin - sensor) @ normal), beams @ normal
    ahead = toward * np.sign(depth) > 0.0
    ranges = depth / toward[ahead]
    farthest = float(np.linalg.norm(own - sensor, axis=1).max())
    is_near = (ranges <= farthest) | (ranges**2 <= np.abs(toward[ahead]) * reach**2)
    places = sensor + ranges[is_near, None] * beams[ahead][is_near]
    return np.asarray((places - plane.origin) @ plane.axes[:2].T)


def scan_reach(points: Array, sensor: Array) -> float:
    """How far (meters) the returns (n, 3) of a scanner at (3,) reach, but for stray ones."""
    return float(np.percentile(np.linalg.norm(points - sensor, axis=1), REACH_PERCENTILE))


def _numbers(values: ArrayLike, name: str, points: Array) -> Indices:
    numbers = np.asarray(values)
    if numbers.shape != (len(points),) or numbers.dtype.kind not in "iuf":
        raise ValueError(f"{name} has shape {numbers.shape}; needed ({len(points)},), one number a point")
    return numbers.astype(np.int64)


def _of_grid(directions: Array, shape: tuple[int, int], cells: Indices) -> Array:
    """The beams of the cells of a grid without a return; none where neither rows nor columns are rings."""
    row, column = np.divmod(cells, shape[1])
    layouts = [(row, column, shape), (column, row, shape[::-1])]
    found = [
        (regular.off, regular, layout)
        for layout in layouts
        for axis in _axes(directions, layout[0])
        if (regular := _regular(axis, directions, *layout)) is not None
    ]
    if not found:
        return np.empty((0, 3))
    _, regular, (ring, step, count) = min(found, key=lambda one: one[0])
    missing = np.ones(count, dtype=np.bool_)
    missing[ring, step] = False
    rings, steps = np.nonzero(missing)
    turn = Turn(regular.start[rings] + regular.by * steps, regular.above[rings])
    beams = regular.axis.directions(turn)
    return beams[np.isfinite(beams).all(axis=1)]


class Regular(NamedTuple):
    """Rings that turn by even steps `by` from `start` (n,) at `above` (n,), rad, NaN where a ring isn't known.

    `off`: how far returns lie off their places, in steps, in the mean.
    """

    axis: Axis
    by: float
    start: Array
    above: Array
    off: float


def _regular(axis: Axis, directions: Array, ring: Indices, step: Indices, shape: tuple[int, int]) -> Regular | None:
    """The rings that directions (n, 3) are of, by their rings and steps (n,); None where these are no such rings."""
    turn = axis.turns(directions)
    by = _step(turn.around, ring, step)
    counts = np.bincount(ring, minlength=shape[0])
    far = step - np.bincount(ring, step, shape[0])[ring] / counts[ring]
    if by is None or not far.any():
        return None
    # What each ring leaves shows how far its step is off.
    rest = _wrapped(turn.around - by * step - _middles(turn.around - by * step, ring, shape[0])[ring])
    by += float(rest @ far / (far @ far))
    start = _middles(turn.around - by * step, ring, shape[0])
    above = _middles(turn.above, ring, shape[0])
    spacing = _spacing(above)
    if spacing == 0.0:
        return None
    around_off = np.abs(_wrapped(turn.around - by * step - start[ring])) / abs(by)
    off = np.maximum(around_off, np.abs(turn.above - above[ring]) / spacing)
    if np.mean(off <= BEAM) < MOSTLY:
        return None
    start, above = _of_all_rings(start, BEAM * abs(by)), _of_all_rings(above, BEAM * spacing)
    return Regular(axis, by, start, above, float(np.mean(off)))


def _of_all_rings(angles: Array, beam: float) -> Array:
    """The angles of rings that are evenly spaced to within a beam; else those of rings between others, NaN beyond."""
    rings, present = np.arange(len(angles)), np.flatnonzero(np.isfinite(angles))
    unwrapped = np.unwrap(angles[present])
    line = np.polyfit(present, unwrapped, 1) if len(present) > 1 else np.array([0.0, unwrapped[0]])
    even = np.polyval(line, rings)
    if np.abs(even[present] - unwrapped).max() <= beam:
        return np.asarray(even)
    return np.interp(rings, present, unwrapped, np.nan, np.nan)


def _axes(directions: Array, ring: Indices) -> list[Axis]:
    """What a scanner may turn about: the world's third axis, or the one that rings (n,) lie across."""
    counts = np.bincount(ring)
    means = (
        np.stack([np.bincount(ring, directions[:, axis]) for axis in range(3)], axis=1) / np.maximum(counts, 1)[:, None]
    )
    spread = directions - means[ring]
    return [Axis.along(UP), Axis.along(np.linalg.eigh(spread.T @ spread)[1][:, 0])]


def _step(around: Array, ring: Indices, step: Indices) -> float | None:
    """The turn from one step to the next, by returns of one ring next to each other; None where there are too few."""
    order = np.lexsort((step, ring))
    beside = (np.diff(ring[order]) == 0) & (np.diff(step[order]) == 1)
    if beside.sum() < LEAST_RINGS**2:
        return None
    by = float(np.median(_wrapped(np.diff(around[order])[beside])))
    return by if by != 0.0 else None


def _middles(angles: Array, ring: Indices, count: int) -> Array:
    """The middle of the angles (n,) of each ring, whatever turns lie between them; NaN of rings without any."""
    sums = [np.bincount(ring, function(angles), count) for function in (np.sin, np.cos)]
    first = np.arctan2(*sums)
    first[np.bincount(ring, minlength=count) == 0] = np.nan
    rest = _wrapped(angles - first[ring])
    order = np.lexsort((rest, ring))
    ends = np.cumsum(np.bincount(ring, minlength=count))
    counts = np.diff(np.concatenate([[0], ends]))
    middle = np.minimum(ends - counts + counts // 2, len(ring) - 1)
    return np.asarray(first + rest[order][middle])


def _spacing(above: Array) -> float:
    """The median angle between neighboring rings."""
    gaps = np.abs(np.diff(above[np.isfinite(above)]))
    return float(np.median(gaps)) if len(gaps) else 0.0


def _of_rings(directions: Array, rings: Indices | None) -> Array:
    """The beams between the returns of rings, by their numbers or by their order; none where there are none."""
    none = np.empty((0, 3))
    if len(directions) < LEAST_RINGS**2:
        return none
    numbers = _rings_in_order(directions) if rings is None else np.unique(rings, return_inverse=True)[1]
    if numbers is None:
        return none
    count = int(numbers.max()) + 1
    if count < LEAST_RINGS or len(numbers) < LEAST_RINGS * count:
        return none
    turn = Axis.along(UP).turns(directions)
    order = np.lexsort((turn.around, numbers))
    beside = np.abs(np.diff(turn.above[order]))[np.diff(numbers[order]) == 0]
    # Neighbors of one ring are nearer to one another than rings are.
    if np.median(beside) > BEAM * _spacing(np.sort(_middles(turn.above, numbers, count))):
        return none
    return Axis.along(UP).directions(_between(turn, numbers))


def _rings_in_order(directions: Array) -> NDArray[np.intp] | None:
    """The ring of each of the directions (n, 3) of rings one after the other; None where they are in another order."""
    turn = Axis.along(UP).turns(directions)
    steps = _wrapped(np.diff(turn.around))
    way = np.sign(np.median(steps))
    steps = steps * way
    if way == 0.0 or np.mean(steps > 0.0) < MOSTLY:
        return None
    # A return far behind the last one is a turn ahead.
    steps = np.where(steps < -BACK, steps + 2.0 * np.pi, steps)
    around = np.mod(way * turn.around, 2.0 * np.pi)
    total = around[0] + np.concatenate([[0.0], np.cumsum(steps)])
    best, least = None, np.inf
    for cut in (_middle_of_gap(around), _change_of_rings(around, turn.above, total)):
        turns = np.maximum.accumulate(np.floor((total - cut) / (2.0 * np.pi)))
        numbers = np.unique(turns, return_inverse=True)[1]
        above = _middles(turn.above, numbers, int(numbers[-1]) + 1)
        scatter = float(np.mean(np.abs(turn.above - above[numbers])))
        if scatter < least:
            best, least = numbers, scatter
    return best


def _change_of_rings(around: Array, above: Array, total: Array) -> float:
    """The angle at which rings change: the middle of those where the angles above do most, one a turn."""
    count = max(1, int((total[-1] - total[0]) / (2.0 * np.pi)))
    changes = np.argsort(-np.abs(np.diff(above)), kind="stable")[:count]
    between = around[changes] + 0.5 * np.mod(around[changes + 1] - around[changes], 2.0 * np.pi)
    return float(_middles(between, np.zeros(len(between), dtype=np.int64), 1)[0])


def _middle_of_gap(around: Array) -> float:
    """The middle of the widest gap between angles (n,) from 0 to a turn."""
    angles = np.sort(around)
    gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
    return float(angles[np.argmax(gaps)] + 0.5 * gaps.max())


def _between(turn: Turn, numbers: NDArray[np.intp]) -> Turn:
    """The places of beams that rings lack between their returns, at angles at which any ring has one."""
    order = np.lexsort((turn.around, numbers))
    around, above, ring = turn.around[order], turn.above[order], numbers[order]
    last = np.concatenate([ring[1:] != ring[:-1], [True]])
    begins = np.concatenate([[0], np.flatnonzero(last)[:-1] + 1])
    following = np.arange(1, len(ring) + 1)
    following[last] = begins
    gaps = np.mod(around[following] - around, 2.0 * np.pi)
    step = float(np.median(gaps[~last]))
    lacking = np.maximum(np.rint(gaps / step).astype(np.int64) - 1, 0)
    owner = np.repeat(np.arange(len(ring)), lacking)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(lacking) - lacking, lacking) + 1
    fraction = number / (lacking[owner] + 1)
    beside = above[owner] + fraction * (above[following[owner]] - above[owner])
    turned = around[owner] + fraction * gaps[owner]
    places = int(np.ceil(2.0 * np.pi / step))
    met = np.zeros(places, dtype=np.bool_)
    met[np.floor(np.mod(around, 2.0 * np.pi) / step).astype(np.int64) % places] = True
    kept = met[np.floor(np.mod(turned, 2.0 * np.pi) / step).astype(np.int64) % places]
    return Turn(turned[kept], beside[kept])


def _wrapped(angles: Array) -> Array:
    """The same angles between -pi and pi."""
    return np.asarray(np.mod(angles + np.pi, 2.0 * np.pi) - np.pi)
