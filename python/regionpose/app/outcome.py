"""The state of the pose that edges or regions give so far, for the page."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.fit import Fit, region_fits
from regionpose.scene.headline import headline
from regionpose.viz.overlays import projected_lines

Lines = list[list[list[float]]]


@dataclass(frozen=True, eq=False)
class Outcome:
    """The last estimate, or why there is none.

    `state`: "empty" without anything that a pose comes from; "busy", `run` being that of earlier regions, if any;
    "regions", `run` being by the regions alone and edges being looked at; "stopped", the user having canceled
    for that; "ready" or "failed". `searches_edges`: whether the pose comes, or is to come, from edges without regions.
    `message`: what went wrong. `run`: the estimate.
    `headline`: how it fits.
    `projected`: by the regions' keys, outlines in the photo as lines of pixels. `fits`: how each region fits, by key.
    """

    state: str = "empty"
    message: str = ""
    run: SceneEstimate | None = None
    headline: str = ""
    projected: dict[int, Lines] = field(default_factory=dict)
    fits: dict[int, Fit] = field(default_factory=dict)
    searches_edges: bool = False

    @property
    def is_current(self) -> bool:
        """Whether there is a pose of the session as it is: by its regions, alone or with edges, or by edges alone."""
        return self.run is not None and self.state in ("regions", "stopped", "ready")

    @classmethod
    def of(cls, run: SceneEstimate, keys: list[int], state: str = "ready") -> Outcome:
        """The outcome of an estimate of the pairs with these keys."""
        sides, pose = run.sides, run.local_pose
        lines = [projected_lines(sides.camera, side.region, pose) for side in sides.world_sides]
        projected = {key: [rounded(line) for line in parts] for key, parts in zip(keys, lines, strict=True)}
        fits = dict(zip(keys, region_fits(run), strict=True))
        return cls(state, "", run, headline(run), projected, fits, run.is_by_edges)


def rounded(line: NDArray[np.float64]) -> list[list[float]]:
    """A line (n, 2) or (n, 3) as lists, to a hundredth of a pixel or to a millimeter."""
    digits = 2 if line.shape[1] == 2 else 3
    return [[round(float(value), digits) for value in point] for point in line]
