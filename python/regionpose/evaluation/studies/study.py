"""A study as data: what it varies, the cameras it uses, and the charts that show it."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from time import perf_counter
from typing import Any, Literal

from regionpose import _core
from regionpose.evaluation.setups import Setup, fisheye_setup, omnidirectional_setup, perspective_setup
from regionpose.evaluation.studies.conditions import (
    Condition,
    Grid,
    changed_grid,
    grid_conditions,
    solver_options,
)
from regionpose.evaluation.studies.problems import Problem, draw_problem
from regionpose.evaluation.studies.rows import Row, failed_row, solved_row
from regionpose.solver import estimate_pose

ChartKind = Literal["sorted", "solved"]
ProblemMaker = Callable[[Setup, Condition, int], Problem]

LIBRARIES = ("numpy", "scipy", "shapely", "scikit-image")
"""Packages whose version may change a row."""


@dataclass(frozen=True)
class Chart:
    """A picture of the rows.

    `kind`: "sorted" draws errors and run times in rising order, "solved" the share of solved problems over the column
    `across`. A line for each value of the column `lines`, a panel for each of `panels`; other columns that vary make a
    picture each.
    """

    kind: ChartKind
    lines: str
    panels: str | None = None
    across: str | None = None


def benchmark_setups() -> dict[str, Setup]:
    """The setups that conditions name."""
    return {
        "perspective": perspective_setup(),
        "omnidirectional": omnidirectional_setup(),
        "fisheye": fisheye_setup(),
    }


@dataclass(frozen=True)
class Study:
    """A named grid of conditions and how to draw and show their problems.

    `grids`: values of the condition's fields, all combinations of each grid one after the other. `setups`: the cameras
    and poses that conditions name. `problem`: from setup, condition and seed to the problem; a function of a module, so
    that other processes find it.
    """

    name: str
    description: str
    grids: Sequence[Grid]
    charts: Sequence[Chart] = ()
    setups: Mapping[str, Setup] = field(default_factory=benchmark_setups)
    problem: ProblemMaker = draw_problem

    def __post_init__(self) -> None:
        """Check that every camera of the grids is there."""
        for condition in self.conditions:
            if condition.camera not in self.setups:
                known = ", ".join(self.setups)
                raise ValueError(f"study {self.name} has no setup {condition.camera!r}; its setups are {known}")

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        """The conditions of the grids, in order."""
        return grid_conditions(self.grids)

    def with_values(self, axes: Grid, solver: Sequence[str] = ()) -> Study:
        """The study with other values of the condition's fields, and each solver option added to its own."""
        return replace(self, grids=[changed_grid(grid, axes, solver) for grid in self.grids])

    def with_setup(self, name: str, setup: Setup) -> Study:
        """The study of one other camera alone, `name` in its rows."""
        changed = [changed_grid(grid, {"camera": (name,)}) for grid in self.grids]
        return replace(self, grids=changed, setups={**self.setups, name: setup})

    def settings(self, seeds: range) -> dict[str, Any]:
        """What decides the rows, as JSON holds it: conditions, cameras, seeds and versions."""
        used = dict.fromkeys(condition.camera for condition in self.conditions)
        return {
            "study": self.name,
            "grids": [{name: list(values) for name, values in grid.items()} for grid in self.grids],
            "setups": {name: repr(self.setups[name]) for name in used},
            "problem": f"{self.problem.__module__}.{self.problem.__qualname__}",
            "seeds": [seeds.start, seeds.stop],
            "versions": versions(),
        }

    def outcome(self, condition: Condition, seed: int) -> Row:
        """What comes of one problem; an error on the way is an outcome too."""
        problem = None
        try:
            started = perf_counter()
            problem = self.problem(self.setups[condition.camera], condition, seed)
            prepared = perf_counter()
            options = {**problem.options, **solver_options(condition.solver)}
            estimate = estimate_pose(problem.camera, problem.image_regions, problem.world_regions, **options)
            ended = perf_counter()
            return solved_row(problem, estimate, prepared - started, ended - prepared)
        except Exception as error:
            return failed_row(error, problem)


def versions() -> dict[str, str]:
    """Versions of what makes the rows."""
    return {
        "regionpose": _core.__version__,
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }
