"""Poses by edges alone, of real frames with known poses: how far off they are, and which are trusted.

Of each frame, with nothing known but that the camera is near the scanner and upright to 3 degrees: errors of rotation
and of the camera's center, how many standard deviations these are together, the log odds over chance and over the
likeliest other place, the verdict, and seconds. Kinds of problems:

    single      each frame by itself
    rigs        random pairs, threes and fives of the frames of one rig
    mismatched  the photo of one frame with the cloud of another: no pose is right
    thinned     every second, and every fourth ring of a scanner of 64
    degraded    photos blurred, darkened, cropped
    focal       focal lengths 10 and 3 % too short and too long
    mount       heading known to 20 degrees
    starts      started within 10 deg and 0.25 m of the true pose, and within 20 deg and 1.5 m, as papers do: mean and
                root mean square errors by axis

Then a table by kind: how many are right (within 1 deg and 0.3 m), the medians of these, right ones that are trusted,
wrong ones that are, and how many errors exceed 3 standard deviations.

    python -m benchmarks.automatic [--data ../shared/data] [--kinds single rigs ...] [--only natural waymo]
                                   [--count 20] [--out ROWS.jsonl]
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import regionpose as rp
from regionpose.cameras.matrix import MatrixCamera
from scipy.spatial.transform import Rotation

from benchmarks.real_frames import (
    DEGRADATIONS,
    PROTOCOLS,
    Capture,
    RealFrame,
    axis_errors,
    degraded,
    load_frames,
    mismatched,
    perturbed,
    random_rigs,
    thinned,
)
from benchmarks.real_scenes import DEFAULT_DATA

KINDS = ("single", "rigs", "mismatched", "thinned", "degraded", "focal", "mount", "starts")
FACTORS = (0.9, 0.97, 1.03, 1.1)
RIG_SIZES = (2, 3, 5)
UP_SIGMA_DEG = 3.0
MOUNT_SIGMA_DEG = 20.0
RIGHT_DEG, RIGHT_M = 1.0, 0.3
MOST_SIGMAS = 3.0
STARTS = 10
"""Starts of each frame and protocol."""


@dataclass(frozen=True)
class Row:
    """A problem and its answer; errors and sigmas None where no pose is right."""

    kind: str
    name: str
    deg: float | None
    m: float | None
    sigmas: float | None
    log_odds: float
    lead: float
    confidence: float
    trusted: bool
    seconds: float

    @property
    def is_right(self) -> bool:
        """Whether the pose is the true one."""
        return self.deg is not None and self.m is not None and self.deg < RIGHT_DEG and self.m < RIGHT_M

    def __str__(self) -> str:
        """One line of a report."""
        errors = "no pose is right" if self.deg is None else f"{self.deg:7.2f} deg {self.m:5.2f} m {self.sigmas:5.1f} s"
        trusted = "trusted" if self.trusted else "       "
        odds = f"odds {self.log_odds:6.1f} lead {self.lead:6.1f}"
        return (
            f"{self.kind:12} {self.name:44} {errors:26} {odds} {self.confidence:6.1%} {trusted} {self.seconds:5.1f} s"
        )


def photo_and_cloud(capture: Capture) -> rp.Frame:
    """Photo and cloud of a frame, without regions."""
    return rp.Frame(image=capture.image, points=capture.points, intensity=capture.intensity)


def prior_of(capture: Capture) -> rp.Prior:
    """What a user would say of a frame."""
    return rp.Prior(
        camera_near=capture.scanner, camera_near_sigma_m=capture.near_m, up=capture.up, up_sigma_deg=UP_SIGMA_DEG
    )


def mounted(capture: RealFrame) -> rp.Prior:
    """What a user would say of a frame whose heading is known roughly: here by one of its true heading's deviations."""
    turn = Rotation.from_rotvec(np.radians(MOUNT_SIGMA_DEG) * np.asarray(capture.up) / np.linalg.norm(capture.up))
    rotation = capture.truth.rotation * turn
    initial = rp.Pose(rotation, -rotation.apply(np.asarray(capture.scanner)))
    return rp.Prior(
        up=capture.up,
        up_sigma_deg=UP_SIGMA_DEG,
        initial=initial,
        initial_rotation_sigma_deg=MOUNT_SIGMA_DEG,
        initial_center_sigma_m=capture.near_m,
    )


def solved(
    kind: str, name: str, captures: Sequence[Capture], truth: rp.Pose | None, prior: rp.Prior | None = None
) -> tuple[Row, rp.Pose]:
    """The row of a problem, and its pose."""
    start = time.perf_counter()
    frames, first = [photo_and_cloud(capture) for capture in captures], captures[0]
    estimate = rp.calibrate(first.camera, frames, prior=prior or prior_of(first), sensor_origin=first.scanner)
    seconds, edges = time.perf_counter() - start, estimate.diagnostics.edges
    assert edges is not None
    deg = m = sigmas = None
    if truth is not None:
        way = estimate.pose.local_coordinates(truth)
        deg = float(np.degrees((estimate.pose.rotation * truth.rotation.inv()).magnitude()))
        m = float(np.linalg.norm(estimate.pose.camera_center - truth.camera_center))
        # The error's length in the directions of its own, as a standard deviation along it.
        sigmas = float(max(np.abs(way) / np.sqrt(np.diag(estimate.covariance))))
    trusted = not estimate.warnings
    row = Row(
        kind, name, deg, m, sigmas, edges.log_odds, edges.log_odds_over_next, estimate.confidence, trusted, seconds
    )
    return row, estimate.pose


def rows(frames: Sequence[RealFrame], kinds: Sequence[str], count: int) -> Iterator[Row]:
    """The rows of all problems of some kinds."""
    if "single" in kinds:
        yield from (solved("single", frame.name, [frame], frame.truth)[0] for frame in frames)
    if "rigs" in kinds:
        for size in RIG_SIZES:
            for rig in random_rigs(frames, size, count, seed=1):
                name = "+".join(frame.name.rpartition("/")[2] for frame in rig)
                yield solved(f"rig of {size}", name, rig, rig[0].truth)[0]
    if "mismatched" in kinds:
        yield from (solved("mismatched", pair.name, [pair], None)[0] for pair in mismatched(frames, count, seed=5))
    if "thinned" in kinds:
        for every in (2, 4):
            dense = [frame for frame in frames if frame.rings is not None and len(np.unique(frame.rings)) >= 60]
            for frame in dense:
                yield solved(f"1 of {every} rings", frame.name, [thinned(frame, every)], frame.truth)[0]
    if "degraded" in kinds:
        for how in DEGRADATIONS:
            for frame in frames:
                yield solved(how, frame.name, [degraded(frame, how)], frame.truth)[0]
    if "focal" in kinds:
        zoomable = [(frame, frame.camera) for frame in frames if isinstance(frame.camera, MatrixCamera)]
        for factor in FACTORS:
            for frame, camera in zoomable:
                other = replace(frame, camera=camera.zoomed(factor))
                yield solved(f"focal x {factor:g}", frame.name, [other], frame.truth)[0]
    if "mount" in kinds:
        yield from (solved("mount", frame.name, [frame], frame.truth, mounted(frame))[0] for frame in frames)
    if "starts" in kinds:
        yield from started(frames)


def started(frames: Sequence[RealFrame]) -> Iterator[Row]:
    """Poses from starts beside the true one; prints the errors by axis."""
    rng = np.random.default_rng(7)
    for protocol, (deg, meters) in PROTOCOLS.items():
        errors = []
        for frame in frames:
            for number in range(STARTS):
                start = perturbed(frame.truth, rng, deg, meters)
                # A uniform deviation's.
                sigmas = deg / np.sqrt(3.0), meters / np.sqrt(3.0)
                prior = rp.Prior(initial=start, initial_rotation_sigma_deg=sigmas[0], initial_center_sigma_m=sigmas[1])
                row, pose = solved(protocol, f"{frame.name} {number}", [frame], frame.truth, prior)
                errors.append(axis_errors(pose, frame.truth))
                yield row
        if errors:
            values = np.abs(np.array([tuple(error) for error in errors], dtype=np.float64))
            names = errors[0]._fields
            print(f"{protocol}: mean and root mean square of " + ", ".join(names))
            print("   mean " + " ".join(f"{value:8.3f}" for value in values.mean(axis=0)))
            print("   rms  " + " ".join(f"{value:8.3f}" for value in np.sqrt(np.square(values).mean(axis=0))))


def table(done: Sequence[Row]) -> Iterator[str]:
    """The table by kind."""
    yield "kind                n  right    deg      m  trusted  wrong, trusted  > 3 s      s"
    for kind in dict.fromkeys(row.kind for row in done):
        own = [row for row in done if row.kind == kind]
        right = [row for row in own if row.is_right]
        wrong = [row for row in own if not row.is_right and row.trusted]
        deg, m = (float(np.median([getattr(row, key) for row in right])) if right else np.nan for key in ("deg", "m"))
        beyond = sum(row.sigmas is not None and row.sigmas > MOST_SIGMAS and row.trusted for row in own)
        trusted, seconds = sum(row.trusted for row in right), float(np.median([row.seconds for row in own]))
        yield (
            f"{kind:16} {len(own):4} {len(right):6} {deg:6.2f} {m:6.3f} {trusted:8} {len(wrong):15} {beyond:6}"
            f" {seconds:6.1f}"
        )


def main() -> None:
    """Print a line a problem, and the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS[:3]))
    parser.add_argument("--only", nargs="+", help="kinds of frames, such as natural waymo")
    parser.add_argument("--count", type=int, default=20, help="rigs of each size, and mismatched pairs")
    parser.add_argument("--out", type=Path, help="file of rows, JSON")
    given = parser.parse_args()
    frames = load_frames(given.data, given.only)
    if not frames:
        print(f"{given.data}: no frames there, nothing to do")
        return
    done: list[Row] = []
    for row in rows(frames, given.kinds, given.count):
        done.append(row)
        print(row, flush=True)
        if given.out is not None:
            with given.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(row)) + "\n")
    print("\n".join(table(done)))


if __name__ == "__main__":
    main()
