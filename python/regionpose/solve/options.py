"""How poses are computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

System = Literal["plane", "sphere"]
Integration = Literal["boundary", "mesh", "pixels"]
Start = Literal["global", "paper"]
Refine = Literal["contour"]
Driver = Literal["native", "scipy"]


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
        Refine the pose on the observed contours where a part of them is disturbed (docs/math.md, section 11) or hidden
        (section 14), unless several regions all have samples, which decide then (section 17); None keeps the pose of
        the moments alone.
    driver : {"native", "scipy"}
        What runs the final least squares of the moments: the core's trust region, or scipy's Levenberg-Marquardt, which
        takes half a second to load. Both reach the same minimum. Batches are always native.
    frame_sigma_deg, frame_sigma_m, focal_sigma_percent, center_sigma_px : float
        Standard deviations of the error of a whole exposure, which calibration, time and scan add and no contour shows:
        of the rotation about each axis, degrees; of the camera's place along each, meters, where regions are those of a
        scan; of the focal lengths, percent; of the image's center along either axis, pixels, by default what OpenCV
        states of nine views of a chessboard. They count in the covariance (docs/math.md, eq. 10.8); 0, 0, 0 and 0 for
        simulated exposures. A rig estimates the first two itself.
    max_rotation_sigma_deg : float
        Largest standard deviation of the rotation, degrees, of a pose that is trusted: of a larger one
        `weak-geometry` warns.
    max_translation_sigma_percent : float
        The same of the translation, percent of the regions' median distance.

    Raises
    ------
    ValueError
        For another word, a mesh size that is no positive number, or one without a mesh; for a deviation or a limit that
        is no finite number of at least 0.

    Examples
    --------
    >>> import regionpose as rp
    >>> rp.Solver(system="sphere", driver="scipy")
    Solver(system='sphere', integration='boundary', mesh_size=None, start='global', refine='contour', driver='scipy', \
frame_sigma_deg=0.1, frame_sigma_m=0.03, focal_sigma_percent=0.5, center_sigma_px=1.5, \
max_rotation_sigma_deg=0.5, max_translation_sigma_percent=2.0)

    """

    system: System = "plane"
    integration: Integration = "boundary"
    mesh_size: float | None = None
    start: Start = "global"
    refine: Refine | None = "contour"
    driver: Driver = "native"
    frame_sigma_deg: float = 0.1
    frame_sigma_m: float = 0.03
    focal_sigma_percent: float = 0.5
    center_sigma_px: float = 1.5
    max_rotation_sigma_deg: float = 0.5
    max_translation_sigma_percent: float = 2.0

    @property
    def frame_sigma(self) -> tuple[float, float, float, float]:
        """The error of a whole exposure, as the core takes it."""
        return self.frame_sigma_deg, self.frame_sigma_m, 0.01 * self.focal_sigma_percent, self.center_sigma_px

    @property
    def limits(self) -> tuple[float, float]:
        """The limits of a trusted pose, as the core takes them."""
        return self.max_rotation_sigma_deg, 0.01 * self.max_translation_sigma_percent

    def calibration_covariance(self, focal_shift: NDArray[np.float64], pixel_angle_rad: float) -> NDArray[np.float64]:
        """What errors of the focal lengths and of the image's center add to the covariance (6, 6) of a pose of this
        `focal_shift` (6,) whose regions project where a pixel has this angle.
        """
        covariance = (0.01 * self.focal_sigma_percent) ** 2 * np.outer(focal_shift, focal_shift)
        covariance[:3, :3] += (self.center_sigma_px * pixel_angle_rad) ** 2 * np.eye(3)
        return covariance

    def __post_init__(self) -> None:
        """Check words and numbers."""
        for name, words in WORDS.items():
            value = getattr(self, name)
            if not (isinstance(value, str | None) and value in words):
                needed = " or ".join("None" if word is None else f'"{word}"' for word in words)
                raise ValueError(f"{name} is {value!r}; needed {needed}")
        if self.mesh_size is not None:
            self._check_mesh()
        for name in NUMBERS:
            object.__setattr__(self, name, _checked_number(name, getattr(self, name)))

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
    "driver": get_args(Driver),
}
"""The words that each option may be."""


NUMBERS = (
    "frame_sigma_deg",
    "frame_sigma_m",
    "focal_sigma_percent",
    "center_sigma_px",
    "max_rotation_sigma_deg",
    "max_translation_sigma_percent",
)
"""The options that are numbers of at least 0."""


EXACT_EXPOSURE: dict[str, Any] = {
    "frame_sigma_deg": 0.0,
    "frame_sigma_m": 0.0,
    "focal_sigma_percent": 0.0,
    "center_sigma_px": 0.0,
}
"""Options of an exposure whose calibration, time and scan are without error."""


def _checked_number(name: str, value: object) -> float:
    """The number as a float; ValueError for what is none, or less than 0."""
    if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool):
        number = float(value)
        if 0.0 <= number < np.inf:
            return number
    raise ValueError(f"{name} is {value!r}; needed a finite number of at least 0")


def checked_solver(solver: Solver | None) -> Solver:
    """The options, those of `Solver()` for None; ValueError for what are none."""
    if solver is None:
        return Solver()
    if not isinstance(solver, Solver):
        raise ValueError(f"solver is a {type(solver).__name__}; needed a Solver or None")
    return solver
