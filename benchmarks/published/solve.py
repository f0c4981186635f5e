"""The published equations solved in the least squares sense (paper sections 2.1, 2.2: Levenberg-Marquardt)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from benchmarks.published.moments import Array
from benchmarks.published.start import Placement
from benchmarks.published.system import System, WorldSide

EULER_AXES: Final = "XYZ"
"""The three angles turn about the camera's axes one after the other, `R = R_x R_y R_z`."""


class Pair(NamedTuple):
    """One region: its observed moments and its 3D side."""

    observed: Array
    world: WorldSide


class Minimum(NamedTuple):
    """Where the least squares ended: the placement, evaluations of the equations and whether it converged."""

    placement: Placement
    evaluations: int
    converged: bool


def parameters_of(placement: Placement) -> Array:
    """(6,) angles (rad) and translation of a placement."""
    angles = Rotation.from_matrix(placement.rotation).as_euler(EULER_AXES)
    return np.concatenate([angles, placement.translation])


def placement_of(parameters: Array) -> Placement:
    """The placement of (6,) angles and translation."""
    return Placement(Rotation.from_euler(EULER_AXES, parameters[:3]).as_matrix(), parameters[3:])


def residual(parameters: Array, pairs: Sequence[Pair], facing: Placement, system: System) -> Array:
    """Predicted minus observed moments of all regions, one after the other; raw, as the paper has them."""
    pose = placement_of(parameters).after(facing)
    return np.concatenate([pair.world.moments(*pose, system) - pair.observed for pair in pairs])


def minimum_from(start: Placement, pairs: Sequence[Pair], facing: Placement, system: System) -> Minimum:
    """The minimum that MINPACK's Levenberg-Marquardt with finite differences reaches from a placement."""
    result = least_squares(residual, parameters_of(start), jac="2-point", method="lm", args=(pairs, facing, system))
    return Minimum(placement_of(result.x), int(result.nfev), bool(result.success))
