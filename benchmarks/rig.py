"""One rigid pose from many frames: each frame left out in turn, and the camera refined with the pose.

The six boards of acfr_fisheye: for each way of naming the regions in the world (those of `real_scenes.py`) the frames
are solved as one rig with the given camera, then with focal lengths, center and distortion refined as well. Errors are
against calib.json, whose own accuracy is 0.5 deg and 30 mm; the leave-one-out table says how far the pose without each
frame is from the joint one.

`--synthetic N` instead draws N rigs of the evaluation's pinhole (four frames of one region) and fisheye camera (three
frames of two) with binary masks, and refines the true camera and one whose focal length is 1 % and whose center 5 px
off: verdicts, errors of the parameters in standard deviations, and errors of the pose at the regions; and the errors of
the rig's pose beside those of all regions solved as one problem, with the share of true poses in the ellipsoid of 90 %.
In another run of each, one frame's world is moved by 3 cm: how many times that frame alone is named.

    python -m benchmarks.rig [--data ../shared/data] [--ways known outline samples clicks]
    python -m benchmarks.rig --synthetic 20
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import regionpose as rp
from regionpose.cameras import Camera
from scipy.stats import chi2

from benchmarks.real_scenes import DEFAULT_DATA, RIG, WAYS, RealScene, errors_of, scene_of
from benchmarks.synthetic import SyntheticScene, fisheye_scene, perspective_scene

ROWS = ("right", "right, refined", "wrong", "wrong, refined")
ELLIPSOID = float(chi2.ppf(0.9, 6))
"""Squared distance within which 90 of 100 true poses are."""

Part = Literal["focal", "center", "distortion"]
REFINEMENTS: tuple[tuple[Part, ...], ...] = ((), ("focal",), ("focal", "center"), ("focal", "center", "distortion"))


def print_frames(rig: rp.solve.RigDiagnostics) -> None:
    """Print a line for each frame: its fit, and the pose without it."""
    for fit, one in zip(rig.frames, rig.leave_one_out, strict=True):
        print(
            f"  {fit.name:8} delta {100 * fit.overlap_error:5.2f} %  contour {fit.residual_px:5.2f} px; without it"
            f" {one.rotation_deg:6.3f} deg {1e3 * one.shift_m:6.2f} mm,"
            f" contour {one.residual_px:5.2f} px (expected {one.expected_px:5.2f})"
        )


def print_refinement(refinement: rp.solve.CameraRefinement) -> None:
    """Print the parameters of the camera, given and found."""
    before, after = refinement.residual_px
    found = zip(refinement.parameters, refinement.given, refinement.found, refinement.sigma, strict=True)
    values = "  ".join(f"{name} {given:.5g} -> {value:.5g} +- {sigma:.2g}" for name, given, value, sigma in found)
    print(f"  {refinement.outcome}: contours {before:.2f} -> {after:.2f} px; {values}")


def report(scenes: list[RealScene], way: str) -> None:
    """Print the rig's errors with each set of refined parameters, and the frames of the plain estimate."""
    if not all(way in scene.worlds for scene in scenes):
        return
    frames = [rp.Frame(scene.images, scene.worlds[way], scene.name.split("/")[1]) for scene in scenes]
    for parts in REFINEMENTS:
        rig = rp.estimate_rig(scenes[0].camera, frames, refine_camera=parts)
        errors = errors_of(rig.pose, rig.covariance, scenes[0].truth)
        print(
            f"{way:7} {'+'.join(parts) or 'camera as given':24} {errors.rotation:6.3f} deg"
            f" ({errors.rotation_sigmas:.1f} sigma) {1e3 * errors.center:6.2f} mm ({errors.center_sigmas:.1f} sigma)"
            f"  delta {100 * rig.diagnostics.overlap_error:5.2f} %  {' '.join(each.code for each in rig.warnings)}"
        )
        frame_fits = rig_of(rig)
        if frame_fits.refinement is None:
            print_frames(frame_fits)
        else:
            print_refinement(frame_fits.refinement)


def rig_of(estimate: rp.PoseEstimate) -> rp.solve.RigDiagnostics:
    """How the frames of a rig fit."""
    assert estimate.diagnostics.rig is not None
    return estimate.diagnostics.rig


def synthetic_frame(scene: SyntheticScene, offset: float = 0.0) -> rp.Frame:
    """The scene as the rig's camera sees it from the world frame, its world then moved along x by `offset` meters."""
    own = rp.Pose.from_parts(scene.rotation, scene.translation)
    rings = [[own.transform(ring) + np.array([offset, 0.0, 0.0]) for ring in region] for region in scene.regions]
    images = [rp.ImageRegion.from_mask(mask) for mask in scene.masks()]
    return rp.Frame(images, [rp.WorldRegion.from_polygon(region) for region in rings])


def shift_mm(rig: rp.PoseEstimate, frames: list[rp.Frame]) -> float:
    """Error of the pose at the regions; the true pose is the identity."""
    middle = np.mean([region.rings[0].mean(axis=0) for frame in frames for region in frame.world_regions], axis=0)
    return float(1e3 * np.linalg.norm(rig.pose.transform(middle) - middle))


def deviations(refinement: rp.solve.CameraRefinement, truth: Camera) -> list[float]:
    """Errors of the parameters in standard deviations; the true cameras have no distortion."""
    true = [getattr(truth, name, 0.0) for name in refinement.parameters]
    return list((refinement.found - true) / refinement.sigma)


def of_truth(estimate: rp.PoseEstimate) -> tuple[float, float, bool]:
    """Errors of rotation (deg) and of the camera's center (mm), and whether the true pose is in the ellipsoid."""
    truth = rp.Pose.from_matrix(np.eye(4))
    errors, away = errors_of(estimate.pose, estimate.covariance, truth), estimate.pose.local_coordinates(truth)
    squared = float(away @ np.linalg.solve(estimate.covariance, away))
    return errors.rotation, 1e3 * errors.center, squared < ELLIPSOID


class Trial(NamedTuple):
    """One synthetic rig: verdicts on the right and the wrong camera; errors of the pose (mm), in the order of `ROWS`.

    `is_named`: whether a moved frame was named, alone. `sigmas`: errors of the parameters in standard deviations.
    `poses`: of the rig, and of all regions as one problem, the errors of rotation (deg) and center (mm), and whether
    the true pose is in the ellipsoid.
    """

    outcomes: tuple[str, str]
    errors: tuple[float, float, float, float]
    is_named: bool
    sigmas: list[float]
    poses: list[tuple[float, float, bool]]


def trial_of(scenes: list[SyntheticScene], parts: Sequence[Part]) -> Trial:
    """The rig that sees the scenes, refined; then with its last frame moved."""
    camera, frames = scenes[0].camera, [synthetic_frame(scene) for scene in scenes]
    assert isinstance(camera, rp.PinholeCamera | rp.FisheyeCamera)
    wrong: Camera = replace(camera, fx=1.01 * camera.fx, fy=1.01 * camera.fy, cx=camera.cx + 5.0, cy=camera.cy - 5.0)
    runs = [rp.estimate_rig(given, frames, refine_camera=some) for given in (camera, wrong) for some in ((), parts)]
    spoiled = rp.estimate_rig(camera, [*frames[:-1], replace(synthetic_frame(scenes[-1], 0.03), name="moved")])
    outliers = [warning.text for warning in spoiled.warnings if warning.code == "outlier-frame"]
    sides = [
        [region for frame in frames for region in getattr(frame, side)] for side in ("image_regions", "world_regions")
    ]
    whole = rp.estimate_pose(camera, *sides, solver=rp.Solver(driver="native"))
    right_shift, right_refined, wrong_shift, wrong_refined = (shift_mm(run, frames) for run in runs)
    right, other = rig_of(runs[1]).refinement, rig_of(runs[3]).refinement
    assert right is not None and other is not None
    return Trial(
        outcomes=(right.outcome, other.outcome),
        errors=(right_shift, right_refined, wrong_shift, wrong_refined),
        is_named=len(outliers) == 1 and outliers[0].startswith("moved"),
        sigmas=[value for refinement in (right, other) for value in deviations(refinement, camera)],
        poses=[of_truth(runs[0]), of_truth(whole)],
    )


def report_synthetic(
    name: str, draw: Callable[..., SyntheticScene], shape: tuple[int, int], parts: Sequence[Part], count: int
) -> None:
    """Print what comes of `count` rigs of `shape` (frames, regions of a frame)."""
    trials = [
        trial_of([draw(100 * trial + index, shape[1], study="rig") for index in range(shape[0])], parts)
        for trial in range(count)
    ]
    right, wrong = (dict(Counter(outcomes)) for outcomes in zip(*(trial.outcomes for trial in trials), strict=True))
    sigmas = np.array([value for trial in trials for value in trial.sigmas])
    named = sum(trial.is_named for trial in trials)
    print(
        f"{name:12} right camera {right}, wrong camera {wrong}; parameters off by {np.sqrt(np.mean(sigmas**2)):.2f}"
        f" sigma rms, {np.abs(sigmas).max():.1f} at most; moved frame named alone {named} of {count}"
    )
    for row, values in zip(("rig", "one problem"), np.transpose([t.poses for t in trials], (1, 2, 0)), strict=True):
        turn, shift = np.sqrt(np.mean(values[:2] ** 2, axis=1))
        print(
            f"  {row:15} {turn:.4f} deg {shift:.3f} mm rms, {100.0 * values[2].mean():.0f} % in the ellipsoid of 90 %"
        )
    for row, values in zip(ROWS, np.transpose([trial.errors for trial in trials]), strict=True):
        print(f"  {row:15} {np.median(values):7.2f} mm median {np.max(values):7.2f} mm at most", flush=True)


def main() -> None:
    """Print the tables of each way of naming the regions, or those of synthetic rigs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS)
    parser.add_argument("--synthetic", type=int, metavar="N", help="rigs of each synthetic camera")
    arguments = parser.parse_args()
    if arguments.synthetic:
        report_synthetic("perspective", perspective_scene, (4, 1), REFINEMENTS[2], arguments.synthetic)
        report_synthetic("fisheye", fisheye_scene, (3, 2), REFINEMENTS[3], arguments.synthetic)
        return
    folders = sorted(path.parent.resolve() for path in arguments.data.glob(f"{RIG}/*/regions.json"))
    if not folders:
        print(f"no {RIG} below {arguments.data}: nothing to measure")
        return
    with tempfile.TemporaryDirectory() as temporary:
        scenes = [scene_of(folder, Path(temporary)) for folder in folders]
    for way in arguments.ways:
        report(scenes, way)


if __name__ == "__main__":
    main()
