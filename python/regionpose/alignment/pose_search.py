"""The poses at which the edges of clouds lie on those of photos, searched for in all that a density allows
(docs/math.md, section 19).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionpose import _core
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.geometry.pose import Pose
from regionpose.progress import Progress, check_wanted, part, with_progress
from regionpose.solve.edge_diagnostics import EdgeMode
from regionpose.solve.prior import Prior

Array = NDArray[np.float64]

DRAWS, KEPT = 60_000, (2_000, 400, 64)
"""Poses that are drawn from the prior, and how many of the best by each spread are maximized at the next one. Measured:
of eight frames of four scanners, heading unknown, 200,000 and (6,000, 800, 64) find no other one, in 2.5 times the
time.
"""

LOCAL_DRAWS, LOCAL_KEPT = 2_000, (100, 25, 8)
"""The same about a pose that is known roughly, where the edges of few draws are farther than a spread from right
ones."""

FRAMES_MADE, MAXIMA_FOUND, EDGES_MADE = 0.07, 0.82, 0.3
"""Fractions of a search's time at which its frames are made and its maxima found, and of the rest at which the edges
are updated. Measured: of one to five street frames on two cores."""

EDGE_UPDATE_M = 0.02
"""Largest distance of the likeliest camera center from the viewpoint of the edges: what moves edges of things 10 m away
by a tenth of a degree against those behind them."""


def search_prior(
    frames: Sequence[EdgeFrame], prior: Prior, starts: Sequence[Pose] = (), *, progress: Progress | None = None
) -> list[EdgeMode]:
    """The maxima of the posterior of the pose that frames share, that of the largest mass first.

    `starts`: poses to search about beside those that are drawn from the prior. ValueError for a prior without a
    position of the camera.
    """
    density = Density.of_prior(prior, frames[0].origin)
    cores = [frame.core for frame, _ in with_progress(frames, part(progress, 0.0, FRAMES_MADE))]
    local, drawn = [start.rebase(density.origin) for start in starts], part(progress, FRAMES_MADE, MAXIMA_FOUND)
    modes = density.modes(cores, local, DRAWS, KEPT, drawn)

    def visible_from(center: Array) -> list[_core.AlignmentFrame]:
        return [frame.visible_from(center) for frame in frames]

    modes = _with_updated_edges(modes, density, visible_from, np.zeros(3), part(progress, MAXIMA_FOUND, 1.0))
    return _in_world(modes, density.origin)


def search_about(
    frames: Sequence[EdgeFrame], pose: Pose, density: Density, *, progress: Progress | None = None
) -> list[EdgeMode]:
    """The maxima of the posterior about a pose, by the edges beside the frames' regions; that of the largest mass
    first.
    """
    local = pose.rebase(density.origin)

    def visible_from(center: Array) -> list[_core.AlignmentFrame]:
        return [frame.visible_from(center, with_regions=False) for frame in frames]

    about = part(progress, 0.0, MAXIMA_FOUND)
    modes = density.modes(visible_from(local.camera_center), [local], LOCAL_DRAWS, LOCAL_KEPT, about)
    modes = _with_updated_edges(modes, density, visible_from, local.camera_center, part(progress, MAXIMA_FOUND, 1.0))
    return _in_world(modes, density.origin)


class Density(NamedTuple):
    """A density of poses; `origin` (3,): the place of the world about which the core has it."""

    core: _core.Density
    origin: Array

    @classmethod
    def of_prior(cls, prior: Prior, origin: Array) -> Density:
        """That of a prior; ValueError for one without a position of the camera."""
        return cls(_core.Density.of_prior(prior.rebase(origin).core), origin)

    @classmethod
    def student(cls, pose: Pose, covariance: Array, origin: Array) -> Density:
        """Student's about a pose whose covariance (6, 6) is known but roughly."""
        local = pose.rebase(origin)
        return cls(_core.Density.student(local.rotation.as_matrix(), local.translation, covariance), origin)

    def maxima(self, frames: Sequence[_core.AlignmentFrame], starts: Sequence[Pose]) -> list[EdgeMode]:
        """The maxima of the posterior of the pose that frames share to which the descent converges from starts, that
        of the largest mass first; poses of the world.
        """
        return _in_world(self.modes(frames, [start.rebase(self.origin) for start in starts]), self.origin)

    def modes(
        self,
        frames: Sequence[_core.AlignmentFrame],
        starts: Sequence[Pose],
        draws: int = 0,
        kept: Sequence[int] | None = None,
        progress: Progress | None = None,
    ) -> list[EdgeMode]:
        """The same about the origin, and about so many drawn poses, too, of which so many are kept by spread: as many
        as there are starts where that is left out.
        """

        def report(fraction: float) -> None:
            check_wanted()
            if progress is not None:
                progress(fraction)

        report(0.0)
        given = [(start.rotation.as_matrix(), start.translation) for start in starts]
        most = list(kept or (len(starts),) * len(KEPT))
        found = _core.search_poses(list(frames), self.core, given, draws, most, progress=report)
        report(1.0)
        # Where photos show no edge, the prior is all that is known.
        return [
            EdgeMode(Pose(Rotation.from_matrix(rotation), translation), covariance, mass, ratio, edges)
            for rotation, translation, covariance, mass, ratio, edges in found
            if edges
        ]


def log_mass(modes: Sequence[EdgeMode]) -> float:
    """Logarithm of the mass of all modes together."""
    return float(np.logaddexp.reduce([mode.log_mass for mode in modes])) if modes else -np.inf


def _in_world(modes: Sequence[EdgeMode], origin: Array) -> list[EdgeMode]:
    """Maxima whose poses are about an origin (3,) as those of the world."""
    return [replace(mode, pose=mode.pose.rebase(-origin)) for mode in modes]


def _with_updated_edges(
    modes: list[EdgeMode],
    density: Density,
    visible_from: Callable[[Array], Sequence[_core.AlignmentFrame]],
    center: Array,
    progress: Progress | None = None,
) -> list[EdgeMode]:
    """The maxima, or those refined from them with the edges that are visible from the likeliest one, if these are
    likelier: from elsewhere than a center (3,) a camera sees other edges. All about the density's origin.
    """
    if not modes or np.linalg.norm(modes[0].pose.camera_center - center) < EDGE_UPDATE_M:
        return modes
    frames = visible_from(modes[0].pose.camera_center)
    updated = density.modes(frames, [mode.pose for mode in modes], progress=part(progress, EDGES_MADE, 1.0))
    return max(modes, updated, key=log_mass)
