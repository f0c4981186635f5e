"""What a study varies: conditions, and the grid that lists them."""

from __future__ import annotations

import itertools
import json
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from benchmarks.synthetic.scenes import WorldFrame
from benchmarks.synthetic.templates import TemplateSet

Value: TypeAlias = "str | int | float | bool | None"
Disturbance = Literal["squares", "painted", "occlusion", "truncation"]
Side = Literal["2d", "3d"]
Masks = Literal["binary", "coverage", "polygon", "drawn"]
Wrong = Literal["none", "shape", "place"]
Scan = Literal["outline", "samples"]
Cut = Literal["none", "scanner", "box"]
Known = Literal["nothing", "up", "side", "near", "initial", "up and side"]
NoiseModel = Literal[
    "exact", "squares-2d", "squares-3d", "occlusion", "truncation", "lidar", "calibration", "wrong-region", "combined"
]

Mistake = Literal[
    "none",
    "frontal",
    "mirrored",
    "swapped-2",
    "swapped-3",
    "swapped-4",
    "replaced",
    "rounded",
    "focal",
    "rough",
]


@dataclass(frozen=True)
class Condition:
    """All that one problem of a study is drawn and solved by, beside its seed.

    `camera`: name of one of the study's setups. `planes`, `regions_per_plane`, `templates`, `world`: as of `Layout`.
    `disturbance` changes the share `noise` of each region's area, on the image's mask (`side` "2d") or on the world's
    region ("3d"); of a truncation, of the first region's; "painted" squares cover one another and leave nothing of the
    boundary. `squares`: their side, as a share of the square root of the
    region's area; None for that of `square_side`. `masks`: whether the image holds pixels' centers or areas, or
    the true outline without any pixels ("polygon"), or by corners that a hand marked carelessly ("drawn").
    `lidar_beams`: the world region is known from a lidar of so many beams near the camera, with the error
    `range_noise_m` along them: by the outline of its own points, or by all beams as samples (`scan`); beams are
    `divergence_mrad` across, and a share `mislabeled` of each region's returns is labeled wrong. `cut`: of the first
    region the scanner's field of view ends at the middle, or a box before it hides a half from scanner and camera, in
    the image marked as unknown. `focal_error` (a
    share) and `center_error_px`: standard deviations of the calibration that the estimate is given. `wrong`: one
    region, drawn by the seed, is another template's ("shape") or lies elsewhere ("place"), on `side`. `model`: what is
    disturbed where the seed draws how much (`mixes.py`). `mistake`: what a user got wrong (`mistakes.py`).
    `grazing_deg`: angle between the first plane and the line of sight; `turn_deg`: turn of the first plane in itself.
    `prior`: what the estimate is told of the pose beforehand, off by the deviations that it is told. `solver`: options
    of `estimate_pose`, as "integration=mesh system=sphere".
    """

    camera: str = "perspective"
    planes: int = 1
    regions_per_plane: int = 1
    templates: TemplateSet = "all"
    world: WorldFrame = "arbitrary"
    disturbance: Disturbance = "squares"
    side: Side = "2d"
    noise: float = 0.0
    squares: float | None = None
    masks: Masks = "binary"
    lidar_beams: int | None = None
    range_noise_m: float = 0.0
    divergence_mrad: float = 0.0
    mislabeled: float = 0.0
    cut: Cut = "none"
    scan: Scan = "outline"
    focal_error: float = 0.0
    center_error_px: float = 0.0
    wrong: Wrong = "none"
    model: NoiseModel = "exact"
    mistake: Mistake = "none"
    grazing_deg: float | None = None
    turn_deg: float | None = None
    prior: Known = "nothing"
    solver: str = ""

    def __post_init__(self) -> None:
        """Check names and ranges, and that poses are drawn one way."""
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise ValueError(f"condition {name} is {getattr(self, name)!r}; needed one of {', '.join(choices)}")
        for name in ("planes", "regions_per_plane"):
            if getattr(self, name) < 1:
                raise ValueError(f"condition {name} is {getattr(self, name)}; needed 1 or more")
        if not 0.0 <= self.noise < 1.0:
            raise ValueError(f"condition noise is {self.noise}; needed a share of 0 or more and less than 1")
        if self.squares is not None and not self.squares > 0.0:
            raise ValueError(f"condition squares is {self.squares}; needed a side above 0, in sizes of the region")
        if self.grazing_deg is not None and self.turn_deg is not None:
            raise ValueError("condition has both grazing_deg and turn_deg; needed one of them at the most")
        if self.disturbance in ("truncation", "painted") and self.side == "3d":
            raise ValueError(f'condition has {self.disturbance} on the world side; only masks are, needed side "2d"')
        if self.masks in ("polygon", "drawn") and self.side == "2d" and self.noise > 0.0:
            raise ValueError('condition disturbs the mask where there is none; needed masks "binary" or "coverage"')
        if self.masks == "drawn" and self.cut == "box":
            raise ValueError('condition hides a half of a drawn region; needed masks "binary", "coverage" or "polygon"')
        solver_options(self.solver)


CHOICES: dict[str, tuple[str, ...]] = {
    name: typing.get_args(kind)
    for name, kind in typing.get_type_hints(Condition).items()
    if typing.get_origin(kind) is Literal
}
"""What a condition's names may be."""


def _plain_type(kind: Any) -> type:
    """The type of a field's values, None apart."""
    if typing.get_origin(kind) is Literal:
        return str
    plain: type = next((option for option in typing.get_args(kind) if option is not types.NoneType), kind)
    return plain


CONDITION_TYPES: dict[str, type] = {name: _plain_type(kind) for name, kind in typing.get_type_hints(Condition).items()}
"""The condition's fields, in order, and the type of each when it is not None."""


def solver_options(text: str) -> dict[str, Any]:
    """Options of `estimate_pose` from "name=value name=value"; values are JSON where they can be, else text."""
    options = {}
    for token in text.split():
        name, equals, value = token.partition("=")
        if not (name.isidentifier() and equals and value):
            raise ValueError(f'solver option is {token!r}; needed name=value, as in "integration=mesh system=sphere"')
        options[name] = _json_or_text(value)
    return options


def _json_or_text(value: str) -> Any:
    try:
        return json.loads(value)
    except json.JSONDecodeError:
        return value


def solver_text(options: Mapping[str, Any]) -> str:
    """The options as `solver_options` reads them, in the order of their names."""
    return " ".join(f"{name}={_text(value)}" for name, value in sorted(options.items()))


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value, separators=(",", ":"))


Grid = Mapping[str, Sequence[Value]]
"""The values of some of the condition's fields; every combination is a condition, the last field varying fastest."""


def grid_conditions(grids: Iterable[Grid]) -> tuple[Condition, ...]:
    """The conditions of the grids, one after the other, without repetition."""
    conditions: dict[Condition, None] = {}
    for grid in grids:
        _check_grid(grid)
        for values in itertools.product(*grid.values()):
            conditions[Condition(**dict(zip(grid, values, strict=True)))] = None  # type: ignore[arg-type]
    return tuple(conditions)


def _check_grid(grid: Grid) -> None:
    for name, values in grid.items():
        if name not in CONDITION_TYPES:
            raise ValueError(f"{name!r} is no field of a condition; the fields are {', '.join(CONDITION_TYPES)}")
        if not values:
            raise ValueError(f"the grid holds no value of {name}; needed at least one")


def changed_grid(grid: Grid, axes: Grid, solver: Sequence[str] = ()) -> Grid:
    """The grid with the values of `axes` in place of its own, and each solver option added to each of its own."""
    changed = {**grid, **axes}
    if solver:
        own = [solver_options(str(text)) for text in changed.get("solver", ("",))]
        added = [solver_options(text) for text in solver]
        changed["solver"] = [solver_text({**options, **more}) for more in added for options in own]
    return changed
