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
from regionpose.alignment.edge_frame import FIELD_MARGIN_DEG, EdgeFrame
from regionpose.geometry.pose import Pose
from regionpose.progress import Progress, check_wanted, part, with_progress
from regionpose.solve.edge_diagnostics import EdgeMode
from regionpose.solve.prior import Prior

Array = NDArray[np.float64]

DRAWS_PER_POSE = 40
"""Poses that are drawn for each that the widest spread distinguishes. Measured: of five street frames whose headings
are known to 20 degrees, the 6,000 to 17,000 that this makes find what 60,000 find, to 0.02 deg
(`python -m benchmarks.automatic --kinds mount --only natural`).
"""

MOST_DRAWS, MOST_KEPT = 60_000, (2_000, 400, 64)
"""Poses that are drawn from a wide prior, and how many of the best by each spread are maximized at the next one; fewer
of these in proportion where fewer are drawn. Measured: of eight frames of four scanners, heading unknown, 200,000 and
(6,000, 800, 64) find no other one, in 2.5 times the time.
"""

LEAST_DRAWS, LEAST_KEPT = 2_000, (100, 25, 8)
"""The same of a narrow prior and about a pose that is known roughly, where the edges of few draws are farther than a
spread from right ones.
"""

FIELD_SIGMAS = 3.0
"""Turns beyond which edges are not looked for, of poses about a given one: by deviations of that."""

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
    modes = density.modes(cores, local, *draws_of(density.core.distinct_poses(cores)), drawn)

    def visible_at(poses: Sequence[Pose]) -> list[_core.AlignmentFrame]:
        return [frame.visible_from(poses[0].camera_center, poses) for frame in frames]

    modes = _with_updated_edges(modes, density, visible_at, np.zeros(3), part(progress, MAXIMA_FOUND, 1.0))
    return _in_world(modes, density.origin)


def draws_of(distinct_poses: float) -> tuple[int, list[int]]:
    """How many poses are drawn from a prior of so many distinct ones, and how many of them are kept by spread."""
    draws = min(max(int(DRAWS_PER_POSE * distinct_poses), LEAST_DRAWS), MOST_DRAWS)
    fraction = draws / MOST_DRAWS
    return draws, [max(round(fraction * most), least) for most, least in zip(MOST_KEPT, LEAST_KEPT, strict=True)]


def search_about(
    frames: Sequence[EdgeFrame], pose: Pose, density: Density, *, progress: Progress | None = None
) -> list[EdgeMode]:
    """The maxima of the posterior about a pose, by the edges beside the frames' regions; that of the largest mass
    first.
    """
    local = pose.rebase(density.origin)

    def visible_at(poses: Sequence[Pose]) -> list[_core.AlignmentFrame]:
        center = poses[0].camera_center
        return [frame.visible_from(center, poses, margin_deg=margin_deg, with_regions=False) for frame in frames]

    about, margin_deg = part(progress, 0.0, MAXIMA_FOUND), FIELD_MARGIN_DEG + FIELD_SIGMAS * density.rotation_sigma_deg
    modes = density.modes(visible_at([local]), [local], LEAST_DRAWS, LEAST_KEPT, about)
    modes = _with_updated_edges(modes, density, visible_at, local.camera_center, part(progress, MAXIMA_FOUND, 1.0))
    return _in_world(modes, density.origin)


class Density(NamedTuple):
    """A density of poses; `origin` (3,): the place of the world about which the core has it; `rotation_sigma_deg`: of
    the least certain axis, 180 where any rotation may be.
    """

    core: _core.Density
    origin: Array
    rotation_sigma_deg: float

    @classmethod
    def of_prior(cls, prior: Prior, origin: Array) -> Density:
        """That of a prior; ValueError for one without a position of the camera."""
        known = prior.initial_rotation_sigma_deg
        return cls(_core.Density.of_prior(prior.rebase(origin).core), origin, 180.0 if known is None else known)

    @classmethod
    def student(cls, pose: Pose, covariance: Array, origin: Array) -> Density:
        """Student's about a pose whose covariance (6, 6) is known but roughly."""
        local, largest = pose.rebase(origin), float(np.linalg.eigvalsh(covariance[:3, :3])[-1])
        core = _core.Density.student(local.rotation.as_matrix(), local.translation, covariance)
        return cls(core, origin, float(np.degrees(np.sqrt(largest))))

    def maximum(
        self, frames: Sequence[_core.AlignmentFrame], start: Pose, weights: _core.LocalWeights
    ) -> EdgeMode | None:
        """The maximum of the posterior to which the ascent from a start converges by weights, a pose of the world; None
        where photos show no edge.
        """
        check_wanted()
        local = start.rebase(self.origin)
        found = weights.maximum(list(frames), self.core, local.rotation.as_matrix(), local.translation)
        return next(iter(_in_world(_modes_of([] if found is None else [found]), self.origin)), None)

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
        most = list(kept or (len(starts),) * len(LEAST_KEPT))
        found = _core.search_poses(list(frames), self.core, given, draws, most, progress=report)
        report(1.0)
        return _modes_of(found)


def log_mass(modes: Sequence[EdgeMode]) -> float:
    """Logarithm of the mass of all modes together."""
    return float(np.logaddexp.reduce([mode.log_mass for mode in modes])) if modes else -np.inf


def _modes_of(found: Sequence[tuple[Array, Array, Array, float, float, int]]) -> list[EdgeMode]:
    """Those of the core that a photo shows edges at: elsewhere the prior is all that is known."""
    return [
        EdgeMode(Pose(Rotation.from_matrix(rotation), translation), covariance, mass, ratio, edges)
        for rotation, translation, covariance, mass, ratio, edges in found
        if edges
    ]


def _in_world(modes: Sequence[EdgeMode], origin: Array) -> list[EdgeMode]:
    """Maxima whose poses are about an origin (3,) as those of the world."""
    return [replace(mode, pose=mode.pose.rebase(-origin)) for mode in modes]


def _with_updated_edges(
    modes: list[EdgeMode],
    density: Density,
    visible_at: Callable[[Sequence[Pose]], Sequence[_core.AlignmentFrame]],
    center: Array,
    progress: Progress | None = None,
) -> list[EdgeMode]:
    """The maxima, or those refined from them with the edges that are visible from the likeliest one, if these are
    likelier: from elsewhere than a center (3,) a camera sees other edges. All about the density's origin.
    """
    if not modes or np.linalg.norm(modes[0].pose.camera_center - center) < EDGE_UPDATE_M:
        return modes
    poses = [mode.pose for mode in modes]
    updated = density.modes(visible_at(poses), poses, progress=part(progress, EDGES_MADE, 1.0))
    return max(modes, updated, key=log_mass)
