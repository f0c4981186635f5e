"""One rigid pose from the six boards of acfr_fisheye: each frame's influence, and the camera refined with the pose.

For each way of naming the regions in the world (those of `real_scenes.py`) the frames are solved as one rig with the
given camera, then with focal lengths, centre and distortion refined as well. Errors are against calib.json, whose own
accuracy is 0.5 deg and 30 mm; the leave-one-out table says how far the pose without each frame is from the joint one.

    python benchmarks/rig.py [--data ../shared/data] [--ways known points seeds]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
import regionpose as rp
from real_scenes import DEFAULT_DATA, RIG, WAYS, errors_of, run_scene
from regionpose.cameras import Camera

REFINEMENTS = ((), ("focal",), ("focal", "center"), ("focal", "center", "distortion"))


def rig_of(folders: list[Path], way: str) -> tuple[Camera, list[rp.Frame]] | None:
    """The camera and a frame for each folder; None where a region can't be named that way."""
    frames = []
    with tempfile.TemporaryDirectory() as temporary:
        for folder in folders:
            run = run_scene(folder, Path(temporary), way)
            if run is None:
                return None
            worlds = [side.region for side in run.sides.world_sides]
            frames.append(rp.Frame(list(run.sides.image_regions), worlds, folder.name))
    return run.sides.camera, frames


def print_frames(rig: rp.RigEstimate) -> None:
    """Print a line for each frame: its fit, and the pose without it."""
    for fit, one in zip(rig.frames, rig.influence, strict=True):
        print(
            f"  {fit.name:8} delta {100 * fit.overlap_error:5.2f} %  contour {fit.residual_px:5.2f} px; without it"
            f" {one.sigmas:5.2f} sigma {one.rotation_deg:6.3f} deg {1e3 * one.shift:6.2f} mm,"
            f" contour {one.residual_px:5.2f} px (expected {one.expected_px:5.2f})"
        )


def print_refinement(refinement: rp.CameraRefinement) -> None:
    """Print the parameters of the camera, given and found."""
    before, after = refinement.residual_px
    found = zip(refinement.parameters, refinement.given, refinement.found, refinement.sigma, strict=True)
    values = "  ".join(f"{name} {given:.5g} -> {value:.5g} +- {sigma:.2g}" for name, given, value, sigma in found)
    print(f"  {refinement.outcome}: contours {before:.2f} -> {after:.2f} px; {values}")


def report(folders: list[Path], way: str) -> None:
    """Print the rig's errors with each set of refined parameters, and the frames of the plain estimate."""
    named = rig_of(folders, way)
    if named is None:
        return
    camera, frames = named
    calibration = json.loads((folders[0] / "calib.json").read_text())
    worlds = [region for frame in frames for region in frame.world_regions]
    for parts in REFINEMENTS:
        rig = rp.estimate_rig(camera, frames, refine_camera=parts)
        errors = errors_of((rig.pose,), calibration, worlds)
        turn, shift = np.linalg.norm(rig.estimate.rotation_sigma_deg), np.linalg.norm(rig.estimate.translation_sigma)
        print(
            f"{way:7} {'+'.join(parts) or 'camera as given':24} {errors.rotation:6.3f} deg "
            f"{1e3 * errors.at_regions:6.2f} mm at the regions {1e3 * errors.translation:6.2f} mm  "
            f"said {turn:6.3f} deg {1e3 * shift:6.2f} mm  delta {100 * rig.estimate.overlap_error:5.2f} %  "
            f"{' '.join(warning.code for warning in rig.warnings)}"
        )
        if rig.refinement is None:
            print_frames(rig)
        else:
            print_refinement(rig.refinement)


def main() -> None:
    """Print the tables of each way of naming the regions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=WAYS)
    arguments = parser.parse_args()
    folders = sorted(path.parent.resolve() for path in arguments.data.glob(f"{RIG}/*/regions.json"))
    if not folders:
        print(f"no {RIG} below {arguments.data}: nothing to measure")
        return
    for way in arguments.ways:
        report(folders, way)


if __name__ == "__main__":
    main()
