"""Errors on real scenes with ground truth, by scene files: a line for each scene and way of naming its regions.

The scenes are folders with calib.json, regions.json and points.npy or points.bin; where there are none this says so
and ends. Of each a scene file is written and run, as `regionpose estimate` does, without a prior:

    known    the region in the image is its polygon; in the world the known rectangle, else the labelled points
    points   the same with the labelled points, where there are such
    seeds    the same with points grown from a click on the region: the labelled point nearest to their median. The
             lorry's tailgate has posts in its plane that the polygon leaves out; so does `min_width: 0.3`

`--clicks N` grows from N labelled points at random besides and prints the median and the worst error of each scene.
Boards of the folder acfr_fisheye are one rigid problem and are solved together as well. A single rectangle fits from
several poses, so the nearest answer to the truth counts, and the line says which one it was.

    python benchmarks/real_scenes.py [--data ../shared/data] [--out FOLDER] [--clicks N]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import regionpose as rp
import yaml
from numpy.typing import NDArray
from regionpose.cameras import Camera
from regionpose.scene import SceneSides, Stages, estimate_scene, load_scene
from regionpose.scene.bundle import bundle
from regionpose.scene.estimate import SceneEstimate
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Plain = dict[str, Any]
DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
WAYS = ("known", "points", "seeds")
RIG = "acfr_fisheye"


class Errors(NamedTuple):
    """Of the answer nearest to the truth: degrees, metres at the regions and of `t`, its place and their number."""

    rotation: float
    at_regions: float
    translation: float
    place: int
    answers: int


def camera_item(calibration: Plain) -> Plain:
    """The camera of a calib.json as a scene file writes it."""
    size = {"width": calibration["width"], "height": calibration["height"]}
    if calibration["model"] == "ocam_taylor":
        polynomial, center = calibration["taylor_coefficient"], calibration["distortion_center_xy"]
        stretch = calibration["stretch_matrix"]
        return {"model": "ocam", "polynomial": polynomial, "center": center, "stretch": stretch, **size}
    matrix, distortion = calibration["K"], np.ravel(calibration["D"]).tolist()
    lens = {"fx": matrix[0][0], "fy": matrix[1][1], "cx": matrix[0][2], "cy": matrix[1][2], **size}
    if calibration["model"] == "pinhole":
        return {"model": "pinhole", **lens, "distortion": distortion}
    return {"model": "fisheye", **lens, "k": distortion}


def camera_of(calibration: Plain) -> Camera:
    """The camera of a calib.json."""
    item = camera_item(calibration)
    classes = {"pinhole": rp.PinholeCamera, "fisheye": rp.FisheyeCamera, "ocam": rp.OcamCamera}
    return classes[item.pop("model")](**item)


def cloud_file(folder: Path) -> Path:
    """The cloud of a scene."""
    return next(path for path in (folder / "points.npy", folder / "points.bin") if path.exists())


def cloud_of(folder: Path) -> Array:
    """Points (n, 3) of a scene."""
    return rp.clouds.read_cloud(cloud_file(folder)).points


def world_item(region: Plain, folder: Path, way: str, click: int | None) -> Plain | None:
    """The world side of a region, None where the scene doesn't have it that way; `click` chooses another seed."""
    if way == "known" and region.get("rectangle3d"):
        return {"polygon": region["rectangle3d"]}
    if not region.get("point_indices"):
        return None
    file = folder / region["point_indices"]
    if way != "seeds":
        return {"points": str(file)}
    labelled = cloud_of(folder)[np.load(file)]
    if click is None:
        chosen = labelled[np.argmin(np.linalg.norm(labelled - np.median(labelled, axis=0), axis=1))]
    else:
        chosen = labelled[np.random.default_rng(click).integers(len(labelled))]
    return {"seed": [float(value) for value in chosen], **region_options(region["name"])}


def region_options(name: str) -> Plain:
    """What a user would add to a click after one look at the overlay."""
    return {"min_width": 0.3} if name == "truck_tailgate" else {}


def scene_file(folder: Path, out: Path, way: str, click: int | None = None) -> Path | None:
    """Write the scene file of a folder; None where a region can't be named that way."""
    regions = []
    for region in json.loads((folder / "regions.json").read_text()):
        world = world_item(region, folder, way, click)
        if world is None:
            return None
        regions.append({"name": region["name"], "image": {"polygon": region["image_polygon"]}, "world": world})
    calibration = json.loads((folder / "calib.json").read_text())
    scene = {"camera": camera_item(calibration), "image": str(folder / "image.png")}
    scene |= {"cloud": str(cloud_file(folder)), "regions": regions, "prior": {"camera_near": None}}
    path = out / f"{folder.parent.name}-{folder.name}-{way}{'' if click is None else click}.yaml"
    path.write_text(yaml.safe_dump(scene, sort_keys=False), encoding="utf-8")
    return path


def errors_of(poses: Sequence[rp.Pose], calibration: Plain, worlds: Sequence[rp.WorldRegion]) -> Errors:
    """How far the nearest of the answers is from the truth."""
    rotation, translation = np.array(calibration["R"]), np.array(calibration["t"])
    middle = np.mean([ring.mean(axis=0) for world in worlds for ring in world.rings], axis=0)
    found = []
    for place, pose in enumerate(poses):
        turn = np.degrees(Rotation.from_matrix(pose.rotation.as_matrix() @ rotation.T).magnitude())
        at_regions = np.linalg.norm(pose.transform(middle) - (rotation @ middle + translation))
        shift = np.linalg.norm(pose.translation - translation)
        found.append((float(turn), float(at_regions), float(shift), place + 1, len(poses)))
    return Errors(*min(found))


def line(name: str, way: str, errors: Errors, estimate: rp.PoseEstimate) -> str:
    """A scene's errors, what the estimate says of itself, and its warnings."""
    turn, shift = np.linalg.norm(estimate.rotation_sigma_deg), 1e3 * np.linalg.norm(estimate.translation_sigma)
    codes = " ".join(dict.fromkeys(warning.code for warning in estimate.warnings))
    return (
        f"{name:30} {way:7} {errors.rotation:7.3f} deg {1e3 * errors.at_regions:8.2f} mm at the regions "
        f"{1e3 * errors.translation:8.2f} mm  said {turn:6.3f} deg {shift:7.2f} mm  answer {errors.place} of "
        f"{errors.answers}  delta {100 * estimate.overlap_error:5.1f} %  {codes}"
    )


def run_scene(folder: Path, out: Path, way: str, click: int | None = None) -> SceneEstimate | None:
    """The estimate of a folder's scene."""
    path = scene_file(folder, out, way, click)
    return None if path is None else estimate_scene(load_scene(path))


def write_bundle(run: SceneEstimate, out: Path) -> None:
    """Write result, report and pictures of a run beside its scene file."""
    folder = out / run.sides.scene.path.stem
    folder.mkdir(exist_ok=True)
    for name, write in bundle(run, Stages()).writers.items():
        write(folder / name)


def report_scene(folder: Path, name: str, out: Path, *, pictures: bool, clicks: int) -> dict[str, SceneSides]:
    """Print the lines of a scene; its sides by the way in which the regions were named."""
    calibration = json.loads((folder / "calib.json").read_text())
    sides = {}
    for way in WAYS:
        run = run_scene(folder, out, way)
        if run is None or (way == "points" and same_regions(sides["known"], run.sides)):
            continue
        sides[way] = run.sides
        answers = (run.estimate.pose, *run.estimate.alternatives)
        worlds = [side.region for side in run.sides.world_sides]
        print(line(name, way, errors_of(answers, calibration, worlds), run.estimate), flush=True)
        if pictures:
            write_bundle(run, out)
    if clicks and "seeds" in sides:
        print_clicks(folder, name, out, calibration, clicks)
    return sides


def same_regions(first: SceneSides, second: SceneSides) -> bool:
    """Whether two scenes have the same world regions: the known side is the labelled points."""
    return all(
        (one.indices is None) == (other.indices is None)
        for one, other in zip(first.world_sides, second.world_sides, strict=True)
    )


def print_clicks(folder: Path, name: str, out: Path, calibration: Plain, clicks: int) -> None:
    """Print the errors over clicks at random."""
    found, refused = [], 0
    for click in range(clicks):
        try:
            run = run_scene(folder, out, "seeds", click)
        except ValueError:
            refused += 1
            continue
        assert run is not None
        worlds = [side.region for side in run.sides.world_sides]
        found.append(errors_of((run.estimate.pose, *run.estimate.alternatives), calibration, worlds)[:2])
    turn, shift = np.array(found).T if found else np.full((2, 1), np.nan)
    print(
        f"{name:30} clicks  {np.median(turn):7.3f} deg {1e3 * np.median(shift):8.2f} mm at the regions; the worst of "
        f"{clicks}: {turn.max():.3f} deg, {1e3 * shift.max():.2f} mm; {refused} refused",
        flush=True,
    )


def report_rig(boards: list[dict[str, SceneSides]], calibration: Plain) -> None:
    """Print the lines of several boards solved as one rigid problem."""
    for way in WAYS:
        sides = [board[way] for board in boards if way in board]
        if len(sides) < len(boards):
            continue
        worlds = [world.region for side in sides for world in side.world_sides]
        estimate = rp.estimate_pose(sides[0].camera, [r for side in sides for r in side.image_regions], worlds)
        answers = (estimate.pose, *estimate.alternatives)
        print(line(f"{len(boards)} boards at once", way, errors_of(answers, calibration, worlds), estimate), flush=True)


def main() -> None:
    """Print the lines of each scene, then the boards as one problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--out", type=Path, help="keep scene files here, with result, report and pictures of each")
    parser.add_argument("--clicks", type=int, default=0, help="clicks at random on each region")
    arguments = parser.parse_args()
    folders = sorted(path.parent.resolve() for path in arguments.data.glob("*/*/regions.json"))
    if not folders:
        print(f"no scenes below {arguments.data}: nothing to measure")
        return
    boards: list[dict[str, SceneSides]] = []
    with tempfile.TemporaryDirectory() as temporary:
        out = arguments.out or Path(temporary)
        out.mkdir(parents=True, exist_ok=True)
        for folder in folders:
            name = f"{folder.parent.name}/{folder.name}"
            sides = report_scene(folder, name, out, pictures=arguments.out is not None, clicks=arguments.clicks)
            if folder.parent.name == RIG:
                boards.append(sides)
                calibration = json.loads((folder / "calib.json").read_text())
    if boards:
        report_rig(boards, calibration)


if __name__ == "__main__":
    main()
