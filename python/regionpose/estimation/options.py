"""How poses are computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

System = Literal["plane", "sphere"]
Integration = Literal["boundary", "mesh", "pixels"]
Start = Literal["global", "paper"]
Refine = Literal["contour"]
Driver = Literal["scipy", "native"]


@dataclass(frozen=True, kw_only=True)
class Solver:
    """How poses are computed; the defaults are the most exact and robust ones.

    Parameters
    ----------
    system : {"plane", "sphere"}
        Moments on each region's normalized plane (default), or on the sphere.
    integration : {"boundary", "mesh", "pixels"}
        Sums over the boundary (default), a mesh, or, with the sphere, the observed side's pixels. A search sums along
        the boundary of planar regions; the mesh decides its solutions.
    mesh_size : float or None
        Edge length of the mesh's triangles over the square root of the region's area. None is 1/8 on the sphere and, on
        the plane, where every mesh is exact, triangles between the boundary's vertices.
    start : {"global", "paper"}
        Search all poses (default), or start from the paper's own start alone (its sections 2.1.1, 2.2.1), or from the
        prior's initial pose alone if there is one.
    refine : {"contour", None}
        Lead the pose onto the observed contours where a part of them is disturbed (docs/math.md, section 11) or hidden
        (section 14), unless several regions all have samples, which decide then (section 17); None keeps the pose of
        the moments alone.
    driver : {"scipy", "native"} or None
        What runs the final least squares of the moments. None is scipy for single poses, and native for batches and
        rigs; both reach the same minimum. Batches are always native.

    Raises
    ------
    ValueError
        For another word, a mesh size that is no positive number, or one without a mesh.

    Examples
    --------
    >>> import regionpose as rp
    >>> rp.Solver(system="sphere", driver="native")
    Solver(system='sphere', integration='boundary', mesh_size=None, start='global', refine='contour', driver='native')

    """

    system: System = "plane"
    integration: Integration = "boundary"
    mesh_size: float | None = None
    start: Start = "global"
    refine: Refine | None = "contour"
    driver: Driver | None = None

    def __post_init__(self) -> None:
        """Check the words and the mesh size."""
        for name, words in WORDS.items():
            value = getattr(self, name)
            if not (isinstance(value, str | None) and value in words):
                needed = " or ".join("None" if word is None else f'"{word}"' for word in words)
                raise ValueError(f"{name} is {value!r}; needed {needed}")
        if self.mesh_size is not None:
            self._check_mesh()

    def _check_mesh(self) -> None:
        size = self.mesh_size
        if isinstance(size, bool) or not isinstance(size, int | float | np.integer | np.floating):
            raise ValueError(f"mesh_size is {size!r}; needed a number, or None")
        if not 0.0 < size < np.inf:
            raise ValueError(f"mesh_size is {size}; needed a positive and finite number")
        if self.integration != "mesh":
            raise ValueError(f'mesh_size is {size} with integration "{self.integration}"; needed "mesh"')
        object.__setattr__(self, "mesh_size", float(size))


WORDS: dict[str, tuple[str | None, ...]] = {
    "system": get_args(System),
    "integration": get_args(Integration),
    "start": get_args(Start),
    "refine": (*get_args(Refine), None),
    "driver": (*get_args(Driver), None),
}
"""The words that each option may be."""


def checked_solver(solver: Solver | None) -> Solver:
    """The options, those of `Solver()` for None; ValueError for what are none."""
    if solver is None:
        return Solver()
    if not isinstance(solver, Solver):
        raise ValueError(f"solver is a {type(solver).__name__}; needed a Solver or None")
    return solver
