"""Planes that photos confirm at poses, of real frames with known poses: how many, and what they tell of the pose.

Of each frame at its true pose, and at poses turned by 1, 2 and 5 degrees about random axes and moved by 0.3 m: how many
borders of planes are compared with the photo, how many regions are confirmed, the log odds of all borders together, and
of the pose by the regions alone, with what a user would know beforehand (`prior_of` of automatic.py): how far it is
from the true one, and from the pose that is checked, in standard deviations of six parameters. A frame's planes are
found once.

Then a table by kind of pose: how many have regions, how many stand out by odds of 9 to 1, how many have a pose by
regions, medians of its errors, and how many are more than 4.5 standard deviations from the true pose and from the one
that is checked; that has those of a pose by edges, 0.15 deg and 5 cm.

    python -m benchmarks.confirmed_regions [--data ../shared/data] [--only natural waymo] [--held 0.02] [--tries 1]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.scene import confirmed
from regionpose.scene.confirmed import LEAST_HELD, LEAST_LOG_ODDS, region_pose
from scipy.spatial.transform import Rotation

from benchmarks.automatic import photo_and_cloud, prior_of
from benchmarks.real_frames import RealFrame, load_frames
from benchmarks.real_scenes import DEFAULT_DATA

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

TURNS_DEG, MOVED_M = (1.0, 2.0, 5.0), 0.3
EDGES_DEG, EDGES_M = 0.15, 0.05
"""Standard deviations of a pose by edges."""

MOST_SIGMAS = 4.5
"""Mahalanobis distance of six parameters that chance exceeds as rarely as three standard deviations of one."""

BESIDE = 0.2
"""Points so far beside the photo, over its size, belong to planes, too."""


@dataclass(frozen=True)
class Row:
    """A frame at a pose; errors and sigmas None without a pose by regions."""

    kind: str
    name: str
    compared: int
    regions: int
    log_odds: float
    deg: float | None = None
    m: float | None = None
    truth_sigmas: float | None = None
    sigmas: float | None = None

    def __str__(self) -> str:
        """One line of a report."""
        head = f"{self.name:24} {self.kind:8} {self.compared:3} compared {self.regions:2} regions"
        head += f"  log odds {self.log_odds:5.1f}"
        if self.sigmas is None:
            return head
        return (
            f"{head}  {self.deg:6.2f} deg {self.m:5.2f} m {self.truth_sigmas:5.1f} s, from the pose {self.sigmas:.1f} s"
        )


def poses_of(truth: rp.Pose, rng: np.random.Generator, tries: int) -> Iterator[tuple[str, rp.Pose]]:
    """Kinds of poses, and poses."""
    yield "true", truth
    for deg in TURNS_DEG:
        for _ in range(tries):
            turn = Rotation.from_rotvec(np.radians(deg) * direction(rng)) * truth.rotation
            yield f"{deg:g} deg", rp.Pose(turn, -turn.apply(truth.camera_center))
    for _ in range(tries):
        center = truth.camera_center + MOVED_M * direction(rng)
        yield f"{MOVED_M:g} m", rp.Pose(truth.rotation, -truth.rotation.apply(center))


def direction(rng: np.random.Generator) -> Array:
    """A unit vector (3,)."""
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def sigmas_from(estimate: rp.PoseEstimate, pose: rp.Pose, deg: float, m: float) -> float:
    """How far an estimate is from a pose of such deviations, in standard deviations of both."""
    covariance = estimate.covariance + np.diag(np.square(np.repeat([np.radians(deg), m], 3)))
    way = estimate.pose.local_coordinates(pose)
    return float(np.sqrt(way @ np.linalg.solve(covariance, way)))


def planes_of(frame: RealFrame) -> list[Indices]:
    """Indices of the points of planes that the photo shows at the true pose, or those near it."""
    pixels = frame.camera.project(frame.truth.transform(frame.points))
    size = np.array([frame.camera.width or 0, frame.camera.height or 0])
    near = np.flatnonzero(((pixels > -BESIDE * size) & (pixels < (1.0 + BESIDE) * size)).all(axis=1))
    return [near[indices] for indices in rp.segment.find_planes(frame.points[near])]


def row_of(frame: RealFrame, photo: rp.Frame, planes: Sequence[Indices], kind: str, pose: rp.Pose) -> Row:
    """The row of a frame at a pose."""
    found = rp.scene.confirmed_regions(frame.camera, photo, pose, sensor_origin=frame.scanner, planes=planes)
    row = Row(kind, frame.name, found.compared, len(found.regions), found.log_odds)
    estimate = region_pose(frame.camera, [found], prior_of(frame))
    if estimate is None or not np.isfinite(estimate.covariance).all():
        return row
    turn = float(np.degrees((estimate.pose.rotation * frame.truth.rotation.inv()).magnitude()))
    moved = float(np.linalg.norm(estimate.pose.camera_center - frame.truth.camera_center))
    from_truth = sigmas_from(estimate, frame.truth, frame.truth_deg, frame.truth_m)
    own = sigmas_from(estimate, pose, EDGES_DEG, EDGES_M)
    return Row(kind, frame.name, found.compared, len(found.regions), found.log_odds, turn, moved, from_truth, own)


def table(rows: Sequence[Row]) -> Iterator[str]:
    """The table by kind of pose."""
    yield "pose        n  compared  regions  with some  odds 9:1  pose    deg      m  off truth    off it"
    for kind in dict.fromkeys(row.kind for row in rows):
        own = [row for row in rows if row.kind == kind]
        posed = [row for row in own if row.sigmas is not None]
        deg, m = (float(np.median([getattr(row, key) for row in posed])) if posed else np.nan for key in ("deg", "m"))
        yield (
            f"{kind:8} {len(own):4} {sum(row.compared for row in own):9} {sum(row.regions for row in own):8}"
            f" {sum(row.regions > 0 for row in own):10} {sum(row.log_odds >= LEAST_LOG_ODDS for row in own):9}"
            f" {len(posed):5} {deg:6.2f} {m:6.2f} {sum((row.truth_sigmas or 0.0) > MOST_SIGMAS for row in posed):10}"
            f" {sum((row.sigmas or 0.0) > MOST_SIGMAS for row in posed):9}"
        )


def main() -> None:
    """Print a line a pose, and the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--only", nargs="+", help="kinds of frames, such as natural waymo")
    parser.add_argument("--held", type=float, default=LEAST_HELD, help="least that shown sides determine")
    parser.add_argument("--tries", type=int, default=1, help="wrong poses of each kind")
    given = parser.parse_args()
    confirmed.LEAST_HELD = given.held
    rng, rows = np.random.default_rng(3), []
    for frame in load_frames(given.data, given.only):
        scene, planes = photo_and_cloud(frame), planes_of(frame)
        for kind, pose in poses_of(frame.truth, rng, given.tries):
            rows.append(row_of(frame, scene, planes, kind, pose))
            print(rows[-1], flush=True)
    for line in table(rows):
        print(line)


if __name__ == "__main__":
    main()
