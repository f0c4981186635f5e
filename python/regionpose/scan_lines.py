"""From samples on scan lines to the outline of the patch that they sample, without the bias of sparse sampling.

A spinning lidar samples a plane finely along its scan lines and coarsely across them. The patch ends between the last
return and the one that is missing, so an outline through the returns is too small. Here each run of returns is
prolonged by half a step along its line; the ends of neighbouring lines are joined; and beyond the first and the last
line the sides go on in their own direction, to the point where they meet, or for half a gap.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from shapely.geometry.base import BaseGeometry

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

NEIGHBOURS = 8
"""Nearest neighbours searched for the next return on the same line; with jitter the first few may lie beside it."""

LEAST_CONCENTRATION = 0.5
"""Length of the mean doubled direction to nearest neighbours: 1 on straight lines, 0 without a direction."""

LINK_SLOPE = 0.6
"""Largest ascent of a link along a line: lines of a patch fan out and bend, a step to the next line is steeper."""

LINK_STEPS = 3.0
"""Longest link in median steps: bridges two missing returns, and no gap between lines."""

LEAST_JUMP = 2.0
"""Ratio of the narrowest gap between lines to the widest within one that tells lines apart from a cloud without
lines."""

RECTIFICATIONS = 4
"""Rounds of straightening lines and finding them anew; the grouping settles in two or three."""

LEAST_LINES = 3
"""Lines below which the slope of the sides across lines isn't known."""

LEAST_ON_LINE = 3
"""Mean number of returns on a line below which lines are not told apart from chance."""

LEAST_TELLING = 5
"""Returns on a line from which its own step is taken; fewer may straddle a hole."""

MOST_FANNING = 5.0
"""Widest over narrowest spacing of the same lines across the patch: true ones reach 1.5, mistaken ones exceed 10."""

STRAY_GAPS = 0.6
"""A single return nearer to a line than this many gaps is jitter, farther away it is a line's only return in a tip."""

DROPOUT_STEPS = 4.0
"""Widest gap within a run, in steps along the line: returns are lost on dark or glossy spots of a solid surface."""

DROPOUT_GAPS = 0.75
"""Widest gap within a run, in gaps across lines: a hole that is narrower is not seen by the neighbouring lines."""

MOST_DROPOUTS = 0.5
"""Gaps per line that neighbouring lines contradict, up to which the ends of runs are taken for the patch's edge."""

END_STEPS = 24
"""Steps next to the end of a run from which the expected distance to the edge is taken; steps vary along a slanted
line."""

SIDE_LINES = 4
"""Lines whose ends give the direction of a side of the outline; more would cut off bends."""

SIDE_STEPS = 2.0
"""Largest distance of an end from a straight side, in steps along the line: the end falls anywhere within one step."""

SIDE_GAPS = 0.1
"""The same in gaps across lines, for range noise that shifts whole lines."""


LONGEST_EDGE = 0.1
"""Longest edge over the patch's half extent before it is bent onto the plane: leaves 1e-3 of a gap for usual bends."""


class Run(NamedTuple):
    """A stretch of one line that the patch covers: its ends along the line, half a step beyond the outer returns."""

    left: float
    right: float
    step: float


@dataclass(frozen=True)
class ScanLines:
    """Lines of constant `level`, from the lowest, with the runs of each from left to right.

    Along and across coordinates of a point are `(s, v) = turn @ point`; its level is `v + slopes . (s, s v, s^2, s^2
    v)`, in coordinates about `centre` and in units of `scale`.
    """

    centre: Array
    scale: float
    turn: Array
    slopes: Array
    levels: Array
    runs: list[list[Run]]

    @property
    def gap(self) -> float:
        """Median distance between neighbouring lines, metres."""
        return float(np.median(np.diff(self.levels))) * self.scale

    def rings(self) -> list[Array]:
        """Rings (n, 2) of the patch's largest part: the outer one first, counter-clockwise, then its holes."""
        patch = shapely.union_all(list(Strips(self).polygons()))
        largest = max(shapely.get_parts(patch), key=lambda part: part.area)
        # Lines are curved in the plane: an edge along one needs vertices on the way.
        turned = shapely.geometry.polygon.orient(shapely.segmentize(largest, LONGEST_EDGE))
        return [self.flat(np.array(ring.coords)[:-1]) for ring in (turned.exterior, *turned.interiors)]

    def flat(self, points: Array) -> Array:
        """Points (n, 2) of the patch's plane from (along, level)."""
        along, level = points.T
        across = (level - self.slopes[0] * along - self.slopes[2] * along**2) / _rise(along, self.slopes)
        flat: Array = np.column_stack([along, across]) @ self.turn * self.scale + self.centre
        return flat


def scan_lines(points: Array, radius: float | None = None) -> ScanLines | None:
    """The scan lines that points (n, 2) lie on, or None where they show none.

    A `radius` breaks lines at gaps that a disc of this radius passes.
    """
    centre = points.mean(axis=0)
    scale = float(np.linalg.norm(points - centre, axis=1).max())
    turned = _direction((points - centre) / scale)
    if turned is None:
        return None
    turn, local = turned
    grouped = _grouped(local, _fragments(local))
    if grouped is None:
        return None
    slopes, line = grouped
    rise = _rise(local[:, 0], slopes)
    if rise.min() <= 0.0 or rise.max() > MOST_FANNING * rise.min():
        return None
    levels, members = _ordered_lines(_levels(local, slopes), line)
    if len(levels) < LEAST_LINES or sum(map(len, members)) < LEAST_ON_LINE * len(levels):
        return None
    gap = float(np.median(np.diff(levels)))
    limit = None if radius is None else 2.0 * radius / scale
    sorted_along = [np.sort(local[found, 0]) for found in members]
    usual = float(np.median(np.concatenate([np.diff(along) for along in sorted_along])))
    runs = []
    for along in sorted_along:
        step = _typical_step(along, usual)
        runs.append(_runs(along, step, max(DROPOUT_STEPS * step, DROPOUT_GAPS * gap) if limit is None else limit))
    if limit is None:
        dropouts = _dropouts(runs)
        if len(dropouts) > MOST_DROPOUTS * len(runs):
            return None
        for row, index in reversed(dropouts):
            runs[row][index : index + 2] = [_joined(*runs[row][index : index + 2])]
    return ScanLines(centre, scale, turn, slopes, levels, runs)


def _direction(points: Array) -> tuple[Array, Array] | None:
    """The rotation (2, 2) that lays the lines along the first axis, and the rotated points; None without a
    direction.
    """
    if len(points) <= NEIGHBOURS:
        return None
    neighbours = np.asarray(cKDTree(points).query(points, NEIGHBOURS + 1)[1])[:, 1:]
    steps = points[neighbours] - points[:, None, :]
    doubled = ((steps[..., 0] + 1j * steps[..., 1]) ** 2).sum(axis=0)
    lengths = (steps**2).sum(axis=(0, 2))
    # The nearest serve lines close together, all of them lines on which jitter exceeds the step.
    means = np.cumsum(doubled) / np.maximum(np.cumsum(lengths), np.finfo(float).tiny)
    mean = means[np.argmax(np.abs(means))]
    if abs(mean) < LEAST_CONCENTRATION:
        return None
    angle = 0.5 * np.angle(mean)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return turn, points @ turn.T


def _fragments(local: Array) -> Indices:
    """The label of the chain of returns each point belongs to: links to the next return along the line."""
    neighbours = np.asarray(cKDTree(local).query(local, NEIGHBOURS + 1)[1])[:, 1:]
    offsets = local[neighbours] - local[:, None, :]
    ahead = (offsets[..., 0] > 0.0) & (np.abs(offsets[..., 1]) <= LINK_SLOPE * offsets[..., 0])
    distance = np.where(ahead, np.linalg.norm(offsets, axis=2), np.inf)
    best = np.argmin(distance, axis=1)
    length = distance[np.arange(len(local)), best]
    finite = np.isfinite(length)
    linked = np.flatnonzero(finite & (length <= LINK_STEPS * np.median(length[finite]) if finite.any() else finite))
    graph = coo_array((np.ones(len(linked)), (linked, neighbours[linked, best[linked]])), shape=(len(local),) * 2)
    labels: Indices = connected_components(graph, directed=False)[1].astype(np.intp)
    return labels


def _levels(local: Array, slopes: Array) -> Array:
    return local[:, 1] + _bends(local) @ slopes


def _rise(along: Array, slopes: Array) -> Array:
    """Level per distance across the lines: what the spacing of levels is over that of the lines in the patch."""
    rise: Array = 1.0 + slopes[1] * along + slopes[3] * along**2
    return rise


def _bends(local: Array) -> Array:
    along, across = local.T
    return np.column_stack([along, along * across, along**2, along**2 * across])


def _grouped(local: Array, labels: Indices) -> tuple[Array, Indices] | None:
    """The slopes that make lines level, and the line of each point; None where levels don't fall into lines."""
    for _ in range(RECTIFICATIONS):
        slopes = _level_slopes(local, labels)
        found = _lines_of_levels(_levels(local, slopes))
        if found is None:
            return None
        if np.array_equal(found, labels):
            break
        labels = found
    return slopes, labels


def _level_slopes(local: Array, labels: Indices) -> Array:
    """Least squares slopes that make the points of each line equally high."""
    columns = np.column_stack([_bends(local), local[:, 1]])
    counts = np.bincount(labels)
    means = np.column_stack([np.bincount(labels, weights=column) / np.maximum(counts, 1) for column in columns.T])
    centred = columns - means[labels]
    # Few parameters as long as lines are short: a small weight on all of them keeps the solution finite.
    ridge = 1e-6 * np.sqrt(len(local)) * np.eye(4)
    solution: Array = np.linalg.lstsq(
        np.vstack([centred[:, :4], ridge]), np.append(-centred[:, 4], np.zeros(4)), rcond=None
    )[0]
    return solution


def _lines_of_levels(levels: Array) -> Indices | None:
    """The line of each point, split at the gaps above the largest jump in the sizes of gaps; None without a jump."""
    order = np.argsort(levels)
    gaps = np.diff(levels[order])
    sizes = np.sort(gaps)[::-1]
    most = max(len(levels) // LEAST_ON_LINE, LEAST_LINES)
    candidates = sizes[: most + 1]
    floored = np.maximum(candidates, 1e-3 * candidates[0])
    ratios = floored[LEAST_LINES - 2 : -1] / np.maximum(floored[LEAST_LINES - 1 :], np.finfo(float).tiny)
    if len(ratios) == 0 or ratios.max() < LEAST_JUMP:
        return None
    threshold = sizes[LEAST_LINES - 2 + int(np.argmax(ratios))]
    line = np.empty(len(levels), dtype=np.intp)
    line[order] = np.concatenate([[0], np.cumsum(gaps >= threshold)])
    return line


def _ordered_lines(levels: Array, line: Indices) -> tuple[Array, list[Indices]]:
    """Mean levels and members of the lines, without single returns that lie between lines."""
    members = [np.flatnonzero(line == index) for index in range(line.max() + 1)]
    means = np.array([levels[found].mean() for found in members])
    gaps = np.diff(means)
    around = np.minimum(np.append(gaps, np.inf), np.insert(gaps, 0, np.inf))
    stray = np.array([len(found) == 1 for found in members]) & (around < STRAY_GAPS * np.median(gaps))
    return means[~stray], [found for found, out in zip(members, stray, strict=True) if not out]


def _typical_step(along: Array, usual: float) -> float:
    """The step along one line; the one usual on all lines where a line has too few returns to tell."""
    return float(np.median(np.diff(along))) if len(along) >= LEAST_TELLING else usual


def _runs(along: Array, typical: float, widest: float) -> list[Run]:
    """The runs of one line's sorted returns, broken at the gaps that are wider."""
    breaks = np.flatnonzero(np.diff(along) > widest)
    starts, ends = np.append(0, breaks + 1), np.append(breaks, len(along) - 1)
    return [_run(along[first : last + 1], typical) for first, last in zip(starts, ends, strict=True)]


def _dropouts(runs: list[list[Run]]) -> list[tuple[int, int]]:
    """(line, index of the run before) of the gaps whose middle both neighbouring lines cover: no hole, lost returns."""
    found = []
    for line in range(1, len(runs) - 1):
        for index, (before, after) in enumerate(pairwise(runs[line])):
            middle = 0.5 * (before.right + after.left)
            if all(any(run.left < middle < run.right for run in runs[beside]) for beside in (line - 1, line + 1)):
                found.append((line, index))
    return found


def _joined(before: Run, after: Run) -> Run:
    return Run(before.left, after.right, min(before.step, after.step))


def _run(along: Array, typical: float) -> Run:
    steps = np.diff(along)
    if len(steps) == 0:
        return Run(along[0] - 0.5 * typical, along[0] + 0.5 * typical, typical)
    before, after = _expected_rest(steps[:END_STEPS]), _expected_rest(steps[-END_STEPS:])
    return Run(along[0] - before, along[-1] + after, float(np.median(steps)))


def _expected_rest(steps: Array) -> float:
    """Mean distance from the last return to an edge that falls anywhere: E[step^2] / (2 E[step]), half a regular
    step.
    """
    total = float(steps.sum())
    return 0.5 * float(steps @ steps) / total if total > 0.0 else 0.0


class Side(NamedTuple):
    """Where a side of the outline crosses a line, and how far it moves along per level, if that is known."""

    end: float
    slope: float | None


class Strips:
    """The patch between and beyond scan lines, as polygons in (along, level)."""

    def __init__(self, lines: ScanLines) -> None:
        """Take over the lines."""
        self.levels = lines.levels
        self.runs = lines.runs
        self.gap = float(np.median(np.diff(lines.levels)))

    def polygons(self) -> Iterator[BaseGeometry]:
        """Polygons whose union is the patch."""
        count = len(self.levels)
        for line in range(-1, count):
            lower = self.runs[line] if line >= 0 else []
            upper = self.runs[line + 1] if line + 1 < count else []
            for group_lower, group_upper in _overlapping(lower, upper):
                yield self._piece(line, group_lower, group_upper)

    def _piece(self, line: int, lower: list[Run], upper: list[Run]) -> BaseGeometry:
        """The strip between `line` and the next that joins these runs; a cap where only one line has any."""
        if not upper:
            return self._cap(line, 1, lower[0].left, lower[0].right)
        if not lower:
            return self._cap(line + 1, -1, upper[0].left, upper[0].right)
        left = self._side(line, lower[0].left, upper[0].left)
        right = self._side(line, lower[-1].right, upper[-1].right)
        strip: BaseGeometry = shapely.make_valid(shapely.Polygon(np.array(left + right[::-1])))
        notches = [self._cap(line, 1, a.right, b.left) for a, b in pairwise(lower)]
        notches += [self._cap(line + 1, -1, a.right, b.left) for a, b in pairwise(upper)]
        return strip.difference(shapely.union_all(notches)) if notches else strip

    def _side(self, line: int, lower: float, upper: float) -> list[tuple[float, float]]:
        """Vertices of the side between two lines, from below: with a corner where the sides before and after meet
        between.
        """
        bottom, top = self.levels[line], self.levels[line + 1]
        slope_below, slope_above = self._slope(line, -1, lower), self._slope(line + 1, 1, upper)
        side = [(lower, bottom), (upper, top)]
        if slope_below is None or slope_above is None or slope_below == slope_above:
            return side
        height = (upper - slope_above * (top - bottom) - lower) / (slope_below - slope_above)
        if 0.0 < height < top - bottom:
            side.insert(1, (lower + slope_below * height, bottom + height))
        return side

    def _cap(self, line: int, upward: int, left: float, right: float) -> BaseGeometry:
        """The end of a run beyond its line: to where its sides meet within the gap, else for half the gap."""
        gap, base = self._gap_beyond(line, upward), self.levels[line]
        slope_left, slope_right = (self._slope(line, -upward, end) for end in (left, right))
        if slope_left is not None and slope_right is not None:
            closing = upward * (slope_left - slope_right)
            if closing * gap > right - left:
                height = (right - left) / closing
                apex = (left + upward * slope_left * height, base + upward * height)
                return shapely.Polygon([(left, base), (right, base), apex])
        low, high = (upward * 0.5 * gap * (slope or 0.0) for slope in (slope_left, slope_right))
        if left + low >= right + high:
            low = high = 0.0
        far = base + upward * 0.5 * gap
        return shapely.Polygon([(left, base), (right, base), (right + high, far), (left + low, far)])

    def _gap_beyond(self, line: int, upward: int) -> float:
        following = line + upward
        if not 0 <= following < len(self.levels):
            following = line - upward
        return float(min(abs(self.levels[following] - self.levels[line]), 2.0 * self.gap))

    def _slope(self, line: int, direction: int, end: float) -> float | None:
        """The slope, along per level, of the side that ends at `end` and comes from lines in `direction`; None if
        unknown.

        The ends of the lines before must lie on a straight side, to the steps along the lines.
        """
        found = self._chain(line, direction, end)
        for count in range(len(found), 2, -1):
            level, along, step = np.array(found[:count]).T
            slope, offset = np.polyfit(level - level[0], along, 1)
            misfit = np.abs(along - offset - slope * (level - level[0]))
            if (misfit <= 0.5 * SIDE_STEPS * step + SIDE_GAPS * self.gap).all():
                return float(slope)
        return None

    def _chain(self, line: int, direction: int, end: float) -> list[tuple[float, float, float]]:
        """(level, end, step) of the same side on this and the lines in `direction`, as far as it goes on."""
        chain: list[tuple[float, float, float]] = []
        is_left = any(run.left == end for run in self.runs[line])
        slope = 0.0
        while 0 <= line < len(self.levels) and len(chain) < SIDE_LINES:
            ends = [(run.left if is_left else run.right, run.step) for run in self.runs[line]]
            expected = chain[-1][1] + slope * (self.levels[line] - chain[-1][0]) if chain else end
            along, step = min(ends, key=lambda item: abs(item[0] - expected))
            if chain:
                slope = (along - chain[-1][1]) / (self.levels[line] - chain[-1][0])
            chain.append((float(self.levels[line]), along, step))
            line += direction
        return chain


def _overlapping(lower: list[Run], upper: list[Run]) -> Iterator[tuple[list[Run], list[Run]]]:
    """Groups of runs of two lines that overlap along the lines, directly or through another."""
    tagged = sorted([(run, 0) for run in lower] + [(run, 1) for run in upper])
    group: tuple[list[Run], list[Run]] = ([], [])
    reach = -np.inf
    for run, which in tagged:
        if run.left >= reach and (group[0] or group[1]):
            yield group
            group = ([], [])
        group[which].append(run)
        reach = max(reach, run.right)
    if group[0] or group[1]:
        yield group
