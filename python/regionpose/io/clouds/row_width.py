"""The number of values in a row of bare numbers, inferred from the values.

Where the width is right, each column has a distribution of its own: heights differ from eastings, and both from
intensities. Where it is wrong, a column mixes several. So the mutual information of a value and its place in the row
is largest at the right width and its multiples, and smaller everywhere else: of a width w' it is that of the greatest
common divisor of w' and the right one. It needs no order of the rows, and no more than that the columns differ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Values = NDArray[np.float32]
Codes = NDArray[np.int64]

NARROWEST, WIDEST = 3, 16
"""Numbers in a row: three coordinates at least; the widest points of a common driver, 64 bytes, at most."""

LONGEST_PERIOD = 2 * WIDEST
"""Widths that are compared: twice the widest, of which it would be a half."""

WIDEST_FOUND = 7
"""The widest rows that values alone decide. Of 8 to 16 numbers the half may be right: nothing is decided."""

FEWEST_VALUES, FEWEST_FOR_WIDER = 1 << 9, 1 << 13
"""Numbers without which nothing is decided, and without which rows that take turns pass for wider ones: in small cuts
of a scan, lasers that look at near and at far ground differ as columns do. Measured, with cuts of six lidars' scans:
below half of either there are wrong widths."""

MOST_BINS = 16
"""Number of equally populated bins of values."""

VALUES_A_BIN = 64
"""Values for each bin at least, so that some are left for each place of a row: a convention."""

MOST_VALUES, BLOCK = 1 << 20, 1 << 14
"""Values that are looked at, in blocks spread over the file; these decide as all do, in a tenth of the time."""

SIGNIFICANT = 5.0
"""Standard deviations of chance by which the right width exceeds the others."""

LEAST_GAIN = 0.05
"""Nats a value by which it exceeds them. Scans of five kinds of lidars give 0.14 to 0.75 more than any other width, an
indoor depth camera's points 0.28; what the order of a scan's rows makes of wrong widths stays below 0.03."""

SAME_KIND, OTHER_KIND = 0.03, 0.1
"""How far x and y of every k-th row differ, as a fraction of the ln k nats of rows that have nothing in common: below
the first they are one column, of rows that take turns as those of several lasers do; above the second they are columns
of a row k times as wide. Measured on scans of six lidars and a depth camera: up to 0.016 and, but for one of 250 files,
from 0.13 on; in between nothing is decided."""

CERTAIN = 3.0
"""Standard deviations of chance within `OTHER_KIND`, without which nothing is decided: of about a hundred rows."""


class RowWidth(NamedTuple):
    """The width that the values show, None where they show none; and all that fit their number, ascending."""

    width: int | None
    fitting: tuple[int, ...]


class Information(NamedTuple):
    """Mutual information in nats, less what chance gives, and the standard deviation of that."""

    nats: float
    spread: float


class Binned(NamedTuple):
    """Values by their bins, and the place of each in the file."""

    places: Codes
    codes: Codes
    bins: int

    def by(self, rows: Codes, count: int) -> Information:
        """Mutual information of the bins and of `rows`, numbers below `count`, one for each value."""
        table = np.bincount(rows * self.bins + self.codes, minlength=count * self.bins)
        return _information(table.reshape(count, self.bins))


def row_width(values: Values) -> RowWidth:
    """The width of the rows of bare numbers (n,), at which their columns differ most."""
    fitting = tuple(width for width in range(NARROWEST, WIDEST + 1) if len(values) % width == 0)
    if len(values) < FEWEST_VALUES:
        return RowWidth(None, fitting)
    binned = _binned(values)
    found = {period: binned.by(binned.places % period, period) for period in range(1, LONGEST_PERIOD + 1)}
    for width in range(NARROWEST, WIDEST + 1):
        if not all(_exceeds(found[width], of_other) for other, of_other in found.items() if other % width):
            continue
        kinds = {_kind(binned, width, period) for period in found if period > width and period % width == 0}
        if "other" not in kinds:
            return RowWidth(None if "unknown" in kinds or width > WIDEST_FOUND else width, fitting)
    return RowWidth(None, fitting)


def _exceeds(of_width: Information, of_other: Information) -> bool:
    """Whether a width explains the values better than another."""
    spread = max(of_width.spread, of_other.spread)
    return of_width.nats - of_other.nats > max(LEAST_GAIN, SIGNIFICANT * spread)


def _kind(binned: Binned, width: int, period: int) -> str:
    """What x and y of rows of a width are in rows of a multiple of it: the `same` column, an `other`, or `unknown`."""
    columns = [_of_column(binned, width, period, column) for column in (0, 1)]
    most = np.log(period // width)
    fractions = [found.nats / most for found in columns]
    chance = CERTAIN * max(found.spread for found in columns) / most
    if chance <= OTHER_KIND and max(fractions) < max(SAME_KIND, chance):
        return "same"
    is_other = len(binned.places) >= FEWEST_FOR_WIDER and min(fractions) > OTHER_KIND + chance
    return "other" if is_other else "unknown"


def _of_column(binned: Binned, width: int, period: int, column: int) -> Information:
    """Mutual information of the bins of one column of rows of a width, and of which of them stand in wider rows."""
    own = np.flatnonzero(binned.places % width == column)
    chosen = Binned(binned.places[own], binned.codes[own], binned.bins)
    return chosen.by(chosen.places % period // width, period // width)


def _information(counts: NDArray[np.int64]) -> Information:
    """Mutual information of the row and the column of a table of counts."""
    table = counts.astype(np.float64)
    total = max(1.0, table.sum())
    by_chance = table.sum(axis=1, keepdims=True) * table.sum(axis=0, keepdims=True) / total
    there = table > 0.0
    found = float(np.sum(table[there] * np.log(table[there] / by_chance[there])) / total)
    # Of independent rows and columns 2 total times this is chi-squared (Wilks), of so many degrees of freedom.
    freedom = (len(table) - 1) * max(0, int(np.count_nonzero(table.any(axis=0))) - 1)
    return Information(found - freedom / (2.0 * total), float(np.sqrt(2.0 * freedom) / (2.0 * total)))


def _binned(values: Values) -> Binned:
    """Values by quantiles; zeros, and what is not finite, have bins of their own."""
    places = _places(len(values))
    taken = values[places]
    count = min(len(taken) // VALUES_A_BIN, MOST_BINS)
    plain = np.isfinite(taken) & (taken != 0.0)
    edges = np.unique(np.quantile(taken[plain], np.arange(1, count) / count)) if plain.any() else np.empty(0)
    codes = np.zeros(len(taken), dtype=np.int64)
    codes[plain] = np.searchsorted(edges, taken[plain], side="right") + 2
    codes[~np.isfinite(taken)] = 1
    return Binned(places, codes, len(edges) + 3)


def _places(count: int) -> Codes:
    """Places of the values that are looked at: all, or blocks of them, evenly spread."""
    if count <= MOST_VALUES:
        return np.arange(count)
    starts = np.linspace(0, count - BLOCK, MOST_VALUES // BLOCK).astype(np.int64)
    return (starts[:, None] + np.arange(BLOCK)).reshape(-1)
