"""A study as data: what it varies, the cameras it uses, and the charts that show it."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from time import perf_counter
from typing import Any, Literal

from regionpose import _core
from regionpose.regions.outline import SparseSamplingWarning, sparse_sampling_handler
from regionpose.solve.options import EXACT_EXPOSURE, Solver
from regionpose.solve.prior import Prior
from regionpose.solve.single import estimate_pose

from benchmarks.synthetic.setups import Setup, fisheye_setup, omnidirectional_setup, perspective_setup
from benchmarks.synthetic.studies.bounds import pose_bound
from benchmarks.synthetic.studies.conditions import (
    CONDITION_TYPES,
    Condition,
    Grid,
    changed_grid,
    grid_conditions,
    solver_options,
)
from benchmarks.synthetic.studies.problems import StudyProblem, draw_problem
from benchmarks.synthetic.studies.rows import Row, failed_row, solved_row

ChartKind = Literal["sorted", "solved", "coverage", "confidence", "cost"]
ProblemMaker = Callable[[Setup, Condition, int], StudyProblem]

LIBRARIES = ("numpy", "scipy", "shapely", "scikit-image")
"""Packages whose version may change a row."""


@dataclass(frozen=True)
class Chart:
    """A picture of the rows.

    `kind`: "sorted" draws errors and run times in rising order, "solved" the share of solved problems over the column
    `across`, "coverage" the share of true poses inside the covariance's ellipsoids over the share that should be,
    "confidence" the share of poses that are not wrong over the confidence that they were given, "cost" the median
    rotation error and time of each value, solver options joined that differ in the mesh's size alone. A line for each
    value of the column `lines`, a panel for each of `panels`; other columns that vary make a picture each.
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
    that other processes find it. `drawn`: fields of the condition that `problem` draws anew for each seed; the rows
    hold them, and no table or chart is divided by them. `bounds`: whether rows hold the bound of their errors, which
    takes about as long as the estimate. `exact_exposure`: whether estimates are told that calibration, time and scan
    are without error, as they are but where the condition says so; else they expect what real exposures have.
    """

    name: str
    description: str
    grids: Sequence[Grid]
    charts: Sequence[Chart] = ()
    setups: Mapping[str, Setup] = field(default_factory=benchmark_setups)
    problem: ProblemMaker = draw_problem
    drawn: Sequence[str] = ()
    bounds: bool = False
    exact_exposure: bool = True

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
        for name in axes:
            if name in self.drawn:
                raise ValueError(f"study {self.name} draws {name} by the seed; needed values of other fields")
        return replace(self, grids=[changed_grid(grid, axes, solver) for grid in self.grids])

    def only(self, texts: Mapping[str, str]) -> Study:
        """The study of those conditions alone whose fields, as text, have the values of their names."""
        for name in texts:
            if name not in CONDITION_TYPES:
                raise ValueError(f"{name!r} is no field of a condition; the fields are {', '.join(CONDITION_TYPES)}")
        kept = [c for c in self.conditions if all(str(getattr(c, name)) == text for name, text in texts.items())]
        if not kept:
            wanted = ", ".join(f"{name}={text}" for name, text in texts.items())
            raise ValueError(f"study {self.name} has no condition with {wanted}")
        return replace(self, grids=[{name: [value] for name, value in asdict(c).items()} for c in kept])

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
            **({"drawn": list(self.drawn)} if self.drawn else {}),
            **({"bounds": True} if self.bounds else {}),
        }

    def outcome(self, condition: Condition, seed: int) -> Row:
        """What comes of one problem; an error on the way is an outcome too."""
        problem = None
        try:
            started = perf_counter()
            said: list[str] = []
            with sparse_sampling_handler(said.append):
                problem = self.problem(self.setups[condition.camera], condition, seed)
            prepared = perf_counter()
            prior, solver = estimate_options(problem, condition.solver, exact_exposure=self.exact_exposure)
            estimate = estimate_pose(
                problem.camera, problem.image_regions, problem.world_regions, prior=prior, solver=solver
            )
            ended = perf_counter()
            bound = pose_bound(problem) if self.bounds else None
            row = solved_row(problem, estimate, prepared - started, ended - prepared, bound)
            return {**row, "input_warnings": SparseSamplingWarning.__name__ if said else ""}
        except Exception as error:
            return failed_row(error, problem)


def estimate_options(problem: StudyProblem, solver: str, *, exact_exposure: bool) -> tuple[Prior, Solver]:
    """Prior and solver for a problem: the condition's options, what these say of a prior added to what is known."""
    options = solver_options(solver)
    told = options.pop("prior", {})
    return replace(problem.prior or Prior(), **told), Solver(**(EXACT_EXPOSURE if exact_exposure else {}) | options)


def versions() -> dict[str, str]:
    """Versions of what makes the rows."""
    return {
        "regionpose": _core.__version__,
        "python": platform.python_version(),
        **{name: version(name) for name in LIBRARIES},
    }
