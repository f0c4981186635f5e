"""What the published algorithm and `regionpose` reach on the same problems, as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import published
from benchmarks.published.compare import Outcome
from benchmarks.synthetic import is_solved

Rows = Sequence[dict[str, Outcome]]
"""What each method made of each problem."""

DETAILS = (
    f"{'system':7} {'planes':6} {'noise':>5} {'method':22} {'solved':>6}  {'rotation deg':>22}  {'translation mm':>20}"
    f"  {'solved ones: deg, mm':>20}  {'equations':>9}  {'ms':>8}  {'ratio':>6}"
)

TABLE = (
    "| system, planes | noise | published: solved, pixels / mesh | mm, mesh | ms, pixels / mesh"
    " | ours: solved, first / nearest | mm | ms | time, ours / mesh |\n|---|---|---|---|---|---|---|---|---|"
)


class Condition(NamedTuple):
    """What the problems of one row have in common; `noise` is a share of each mask."""

    system: published.System
    planes: int
    noise: float


class Column(NamedTuple):
    """One method's outcomes of all problems, each (n,)."""

    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]
    overlap: NDArray[np.float64]
    seconds: NDArray[np.float64]
    evaluations: NDArray[np.float64]

    @classmethod
    def of(cls, rows: Rows, name: str) -> Column:
        """The method of that name."""
        return cls(*np.array([row[name] for row in rows]).T)

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Which problems count as solved."""
        return np.asarray(is_solved(self.rotation, self.overlap))

    @property
    def time_ms(self) -> float:
        """Median time."""
        return float(1e3 * np.median(self.seconds))


def details(condition: Condition, rows: Rows) -> str:
    """A line for each method."""
    ours = Column.of(rows, "regionpose").time_ms
    head = f"{condition.system:7} {condition.planes:6} {100 * condition.noise:3g} % "
    return "\n".join(head + _detail(name, Column.of(rows, name), ours) for name in rows[0])


def _detail(name: str, found: Column, ours: float) -> str:
    """Medians (95 %), medians over what is solved, the time and the ratio of `ours` (ms) to it."""
    rotation, translation, solved = found.rotation, 1e3 * found.translation, found.solved
    among = f"{np.median(rotation[solved]):.4f}, {np.median(translation[solved]):.2f}" if solved.any() else "-"
    return (
        f"{name:22} {100 * solved.mean():5.0f}%"
        f"  {np.median(rotation):10.4f} ({np.percentile(rotation, 95):9.3f})"
        f"  {np.median(translation):9.2f} ({np.percentile(translation, 95):8.1f})  {among:>20}"
        f"  {np.median(found.evaluations):9.0f}  {found.time_ms:8.1f}  {ours / found.time_ms:6.3f}"
    )


def table_row(condition: Condition, rows: Rows) -> str:
    """The row of the table: medians, of the nearest of our answers; times are of the first."""
    names = ("published pixels", "published mesh", "regionpose", "regionpose any")
    pixels, mesh, first, nearest = (Column.of(rows, name) for name in names)
    shares = [f"{100 * found.solved.mean():.0f}" for found in (pixels, mesh, first, nearest)]
    shift = [f"{1e3 * np.median(found.translation):.2f}" for found in (mesh, nearest)]
    return (
        f"| {condition.system}, {condition.planes} | {100 * condition.noise:g} % | {shares[0]} / {shares[1]} %"
        f" | {shift[0]} | {pixels.time_ms:.0f} / {mesh.time_ms:.0f} | {shares[2]} / {shares[3]} %"
        f" | {shift[1]} | {first.time_ms:.0f} | {first.time_ms / mesh.time_ms:.2f} |"
    )
