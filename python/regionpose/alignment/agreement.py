"""How well the steps of a cloud lie on the edges of a photo at a pose, against poses that are turned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionpose import _core
from regionpose.alignment.odds import HIDDEN, log_odds
from regionpose.alignment.photo import Photo
from regionpose.alignment.steps import (
    TURNED_COUNT,
    Known,
    SeenSteps,
    Steps,
    far_turns,
    seen_steps,
)
from regionpose.alignment.visibility import Occlusion
from regionpose.arrays import KeptArrays
from regionpose.cameras import Camera

Array = NDArray[np.float64]

LEAST_STEPS = 20
"""Steps in view below which nothing is said: the mean of so few differs by 0.06, about as much as right poses stand
out."""

TOLERANCE_DEG, TOLERANCE_STEP_DEG, ROLLS_DEG = 1.0, 0.25, (0.0, -0.7, 0.7)
"""How far about a pose the best agreement is looked for, and how finely: what regions, calibrations and times leave
open."""


@dataclass(frozen=True, eq=False)
class Alignment(KeptArrays):
    """How well photo and cloud agree at a pose (docs/math.md, section 18).

    Parameters
    ----------
    places : (n, 2) array
        Pixels of the photo where the cloud's steps of depth and intensity are seen.
    agrees : (n,) array of bool
        Whether an edge stands out there.
    score : float
        The mean strength of edges under them, of the best turn of the camera within a degree; NaN where too few steps
        are in view to say anything, or the photo has no edges.
    turn : (3,) array
        That turn, a rotation vector about the camera's axes, rad.
    turned : (t,) array
        The same scores at poses turned by 3 to 8 degrees; empty where the score is NaN.
    occlusions : tuple of Occlusion
        How much of each region the cloud hides; empty where no regions of the world were given.
    """

    places: Array
    agrees: NDArray[np.bool_]
    score: float
    turn: Array
    turned: Array
    occlusions: tuple[Occlusion, ...] = ()

    @property
    def z(self) -> float:
        """How far the score lies above those of the turned poses, in their standard deviations; NaN where nothing is
        said.
        """
        return self.lead / self.deviation

    @property
    def share_worse(self) -> float:
        """Share of the turned poses whose score is lower; NaN without evidence."""
        return float(np.mean(self.turned < self.score)) if len(self.turned) else float("nan")

    @property
    def log_odds(self) -> float:
        """Logarithm of the odds for the pose that the agreement makes, and what it hides; 0 without evidence."""
        return self.edge_log_odds + (HIDDEN if any(each.is_hidden for each in self.occlusions) else 0.0)

    @property
    def edge_log_odds(self) -> float:
        """The same of the agreement alone."""
        return log_odds(self.lead, self.deviation) if len(self.turned) else 0.0

    @property
    def lead(self) -> float:
        """How far the score lies above the mean of those of the turned poses; NaN without evidence."""
        return self.score - float(self.turned.mean()) if len(self.turned) else float("nan")

    @property
    def deviation(self) -> float:
        """Standard deviation of the scores of the turned poses; NaN without evidence."""
        return float(self.turned.std(ddof=1)) if len(self.turned) else float("nan")

    def __repr__(self) -> str:
        """What it says, in numbers."""
        hidden = f", hidden={sum(each.is_hidden for each in self.occlusions)}" if self.occlusions else ""
        return f"Alignment(steps={len(self.places)}, z={self.z:.2f}, log_odds={self.log_odds:.2f}{hidden})"


def aligned(
    photo: Photo, camera: Camera, steps: Steps, known: Known | None, hidden: tuple[Occlusion, ...] = ()
) -> Alignment:
    """How well a photo agrees with steps as its camera would see them, without known ones; `hidden`: what the cloud
    hides of the regions.
    """
    here = seen_steps(photo, camera, steps, known)
    turned = [seen_steps(photo, camera, steps.turned(turn)) for turn in Rotation.from_rotvec(far_turns())]
    turned = [seen for seen in turned if len(seen.places) >= LEAST_STEPS]
    says = len(here.places) >= LEAST_STEPS and len(turned) >= TURNED_COUNT // 2
    score, turn = _best_turn(photo, here) if says else (float("nan"), np.zeros(3))
    others = np.array([_best_turn(photo, seen)[0] for seen in turned] if says else [])
    if says and others.min() == others.max():
        # Such as a photo of one shade, which has no edge anywhere.
        score, others = float("nan"), others[:0]
    return Alignment(photo.pixels(here.places), _agrees(photo, here), score, turn, others, hidden)


def _best_turn(photo: Photo, seen: SeenSteps) -> tuple[float, Array]:
    turns = _tolerated_turns()
    means = _core.edge_agreement(photo.strength, seen.places, seen.moved, seen.directions, turns)
    best = int(means.argmax())
    return float(means[best]), turns[best]


def _agrees(photo: Photo, seen: SeenSteps) -> NDArray[np.bool_]:
    """Under which steps (n,) an edge stands out, as they are seen."""
    columns, rows = np.clip(np.round(seen.places).astype(np.int64), 0, np.array(photo.luminance.shape[::-1]) - 1).T
    return np.asarray(photo.strength[seen.directions, rows, columns] > 0.0)


@cache
def _tolerated_turns() -> Array:
    """Rotation vectors (t, 3), rad, within what a pose may be off."""
    across = np.arange(-TOLERANCE_DEG, TOLERANCE_DEG + 0.5 * TOLERANCE_STEP_DEG, TOLERANCE_STEP_DEG)
    grid = np.meshgrid(across, across, ROLLS_DEG, indexing="ij")
    return np.asarray(np.radians(np.stack(grid, axis=-1).reshape(-1, 3)))
