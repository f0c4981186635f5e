"""Errors on real scenes with ground truth: outlines against samples, and what is known of the camera.

The scenes are folders with calib.json, regions.json, image.png and points.npy or points.bin; where there are none this
says so and ends. Of each a scene file is written and read, as `regionpose estimate` does. Its regions in the image are
polygons, with the hidden edges that regions.json marks. In the world they are

    known    the known rectangles, where there are such
    outline  the polygon around the labeled points (`WorldRegion.from_points`)
    samples  what the scan knows of them (`WorldRegion.from_scan`)
    clicks   the same of points grown from a click on the region: the labeled point nearest to their median. The
             lorry's tailgate has posts in its plane that the polygon leaves out; so does `min_width_m: 0.3`

and of the camera nothing is known, that it is within 1 m of the scanner ("near"), or also that it is upright to 2 deg
("near, up"; where the scanner is level and the camera is). Frames of one rig, the boards of acfr_fisheye and the
natural scenes, are solved together as well: two, four and all at once.

A line each: errors of rotation and of the camera's center, and in brackets over their standard deviation in that
direction; of the answer that comes first, and of the nearest where that is another; whether it is trusted (no warning).
Then a table of medians and worst cases over the scenes of a kind, and one of the confidences of all poses of single
frames, with how many are within 5 degrees, as they state. A pose is wrong beyond 5 deg.

    python -m benchmarks.real_scenes [--data ../shared/data] [--only natural kitti] [--out FOLDER] [--rigs 10]
"""

from __future__ import annotations

import argparse
import json
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import accumulate, combinations, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.cameras import Camera
from regionpose.io.yaml_text import to_yaml
from regionpose.regions.outline import SparseSamplingWarning
from regionpose.scene.bundle import bundle
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.exposure import SceneData, scene_sides
from regionpose.scene.loading import load_scene
from regionpose.scene.stages import Stages

Array = NDArray[np.float64]
Plain = dict[str, Any]
Priors = Mapping[str, rp.Prior | None]
DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
WAYS = ("known", "outline", "samples", "clicks")
RIG, NATURAL = "acfr_fisheye", "natural"
LIDARS = ("kitti", NATURAL, RIG)
"""Kinds of scenes whose clouds are one turn of a lidar, about its own origin unless calib.json names another."""

LEVEL = ("kitti", NATURAL)
"""Those whose scanner and camera are upright: on a car; the boards' camera looks down by 8 deg."""

MOST_SIGMAS = 3.0
"""Error over its standard deviation beyond which that is too small."""

WRONG_DEG = 5.0
"""Error beyond which a pose is another one, as in `PoseEstimate.confidence`."""

BOUNDS = (0.0, 0.3, 0.6, 0.9, 0.97, 1.0)
"""Of the confidences that are counted together: fewer than in the studies, for fewer poses."""


@dataclass(frozen=True, eq=False)
class RealScene:
    """A scene's camera, image regions, world regions by way, true pose, and what may be known of the camera.

    `counts`: how many of the regions each of several frames has; none of a single one.
    """

    name: str
    camera: Camera
    images: list[rp.ImageRegion]
    worlds: dict[str, list[rp.WorldRegion]]
    truth: rp.Pose
    priors: Priors
    counts: tuple[int, ...] = ()

    @property
    def kind(self) -> str:
        """The folder of scenes that it is in."""
        return self.name.split("/")[0]

    def estimate(self, way: str, prior: str) -> rp.PoseEstimate:
        """The pose of the frame, or of the frames as a rig."""
        return self.estimate_and_scatter(way, prior)[0]

    def estimate_and_scatter(self, way: str, prior: str) -> tuple[rp.PoseEstimate, rp.solve.BetweenFrameSigma | None]:
        """The same, and how far frames are off as wholes; None of a single one."""
        images, worlds, known = self.images, self.worlds[way], self.priors[prior]
        if not self.counts:
            return rp.estimate_pose(self.camera, images, worlds, prior=known), None
        ends = list(accumulate(self.counts, initial=0))
        frames = [rp.Frame(images[first:end], worlds[first:end]) for first, end in pairwise(ends)]
        rig = rp.estimate_rig(self.camera, frames, prior=known)
        assert rig.diagnostics.rig is not None
        return rig, rig.diagnostics.rig.between_frame_sigma


class Errors(NamedTuple):
    """Of an answer: degrees, meters of the camera's center, each also over its standard deviation in that direction."""

    rotation: float
    center: float
    rotation_sigmas: float
    center_sigmas: float


class Row(NamedTuple):
    """One estimate: its kind of scenes, way and prior, errors of the first and the nearest answer, and its warnings."""

    kind: str
    way: str
    prior: str
    first: Errors
    nearest: Errors
    place: int
    answers: int
    confidence: float
    codes: tuple[str, ...]
    between_frame_sigma: rp.solve.BetweenFrameSigma | None


def camera_item(calibration: Plain) -> Plain:
    """The camera of a calib.json as a scene file writes it."""
    size = {"width": calibration["width"], "height": calibration["height"]}
    if calibration["model"] == "ocam_taylor":
        polynomial, center = calibration["taylor_coefficient"], calibration["distortion_center_xy"]
        stretch = calibration["stretch_matrix"]
        return {"model": "ocam", "polynomial": polynomial, "center": center, "stretch": stretch, **size}
    matrix, distortion = calibration["K"], np.ravel(calibration["D"]).tolist()
    lens = {"fx": matrix[0][0], "fy": matrix[1][1], "cx": matrix[0][2], "cy": matrix[1][2], **size}
    model = "pinhole" if calibration["model"] == "pinhole" else "fisheye"
    return {"model": model, **lens, "distortion": distortion}


def camera_of(calibration: Plain) -> Camera:
    """The camera of a calib.json."""
    item = camera_item(calibration)
    classes: dict[str, Callable[..., Camera]] = {
        "pinhole": rp.PinholeCamera,
        "fisheye": rp.FisheyeCamera,
        "ocam": rp.cameras.OcamCamera,
    }
    return classes[item.pop("model")](**item)


BOARD_COLUMNS = ("x", "y", "z", "intensity", "ring")
"""Those of the boards' scans, which are arrays without names."""


def cloud_file(folder: Path) -> Path:
    """The cloud of a scene."""
    return next(path for path in (folder / "points.npy", folder / "points.bin") if path.exists())


def scan_of(folder: Path) -> rp.Cloud:
    """The cloud of a scene."""
    boards = folder.parent.name == "acfr_fisheye"
    return rp.read_cloud(cloud_file(folder), columns=BOARD_COLUMNS if boards else None)


def cloud_of(folder: Path) -> Array:
    """Points (n, 3) of a scene."""
    return scan_of(folder).points


def scanner_of(folder: Path, calibration: Plain) -> list[float] | None:
    """Where the scanner stood; None where the cloud isn't a lidar's."""
    return calibration.get("sensor_origin", [0.0, 0.0, 0.0]) if folder.parent.name in LIDARS else None


def priors_of(kind: str, scanner: list[float] | None, calibration: Plain) -> Priors:
    """What may be known of the camera, by name."""
    if scanner is None:
        return {"none": None}
    near = rp.Prior(camera_near=scanner, camera_near_sigma_m=1.0)
    up = calibration.get("scanner_up", [0.0, 0.0, 1.0])
    level = {"near, up": replace(near, up=up, up_sigma_deg=2.0)} if kind in LEVEL else {}
    return {"none": None, "near": near, **level}


def world_item(region: Plain, folder: Path, way: str, cloud: Array) -> Plain | None:
    """The world side of a region, None where the scene doesn't have it that way."""
    if way == "known":
        return {"polygon": region["rectangle3d"]} if region.get("rectangle3d") else None
    if not region.get("point_indices"):
        return None
    file = folder / region["point_indices"]
    if way != "clicks":
        return {"points": str(file)}
    labeled = cloud[np.load(file)]
    chosen = labeled[np.argmin(np.linalg.norm(labeled - np.median(labeled, axis=0), axis=1))]
    return {"seed": [float(value) for value in chosen], **region_options(region["name"])}


def region_options(name: str) -> Plain:
    """What a user would add to a click after one look at the overlay."""
    return {"min_width_m": 0.3} if name == "truck_tailgate" else {}


def scene_file(folder: Path, out: Path, way: str) -> Path | None:
    """Write the scene file of a folder; None where a region can't be named that way."""
    regions, cloud = [], cloud_of(folder)
    for region in json.loads((folder / "regions.json").read_text()):
        world = world_item(region, folder, way, cloud)
        if world is None:
            return None
        image = {"polygon": region["image_polygon"], "hidden_edges": region.get("hidden_edges", [])}
        regions.append({"name": region["name"], "image": image, "world": world})
    calibration = json.loads((folder / "calib.json").read_text())
    scene: Plain = {"camera": camera_item(calibration), "image": str(folder / "image.png")}
    scene |= {"cloud": str(cloud_file(folder)), "sensor_origin": scanner_of(folder, calibration)}
    scene |= {"regions": regions, "prior": {"camera_near": None}}
    path = out / f"{folder.parent.name}-{folder.name}-{way}.yaml"
    path.write_text(to_yaml(scene), encoding="utf-8")
    return path


def scene_of(folder: Path, out: Path) -> RealScene:
    """A folder's scene, its regions named in every way that it has."""
    worlds: dict[str, list[rp.WorldRegion]] = {}
    calibration = json.loads((folder / "calib.json").read_text())
    for way in ("known", "samples", "clicks"):
        path = scene_file(folder, out, way)
        if path is None:
            continue
        sides = scene_sides(load_scene(path))
        worlds[way] = [side.region for side in sides.world_sides]
        if way == "samples":
            worlds["outline"] = outlines_of(sides)
    return RealScene(
        name=f"{folder.parent.name}/{folder.name}",
        camera=sides.camera,
        images=list(sides.image_regions),
        worlds={way: worlds[way] for way in WAYS if way in worlds},
        truth=rp.Pose.from_parts(calibration["R"], calibration["t"]),
        priors=priors_of(folder.parent.name, scanner_of(folder, calibration), calibration),
    )


def lidar_scenes(data: Path) -> list[RealScene]:
    """The scenes of a folder whose clouds a lidar took."""
    folders = sorted(path.parent.resolve() for path in data.glob("*/*/regions.json"))
    with tempfile.TemporaryDirectory() as temporary:
        return [scene_of(folder, Path(temporary)) for folder in folders if folder.parent.name in LIDARS]


def outlines_of(sides: SceneData) -> list[rp.WorldRegion]:
    """The polygons around the labeled points of a scene."""
    assert sides.cloud is not None
    scanner = None if sides.sensor_origin is None else sides.sensor_origin.place - sides.origin
    points = [sides.cloud.points[side.indices] for side in sides.world_sides]
    return [rp.WorldRegion.from_points(part, sensor_origin=scanner) for part in points]


def joined(scenes: Sequence[RealScene], name: str) -> RealScene:
    """Frames of one rig as one scene, in the ways that all of them have."""
    ways = [way for way in WAYS if all(way in scene.worlds for scene in scenes)]
    images = [region for scene in scenes for region in scene.images]
    worlds = {way: [region for scene in scenes for region in scene.worlds[way]] for way in ways}
    counts = tuple(len(scene.images) for scene in scenes)
    return replace(scenes[0], name=name, images=images, worlds=worlds, counts=counts)


def errors_of(pose: rp.Pose, covariance: Array, truth: rp.Pose) -> Errors:
    """How far an answer is from the truth, its covariance that of the left increment, (6, 6)."""
    turn = (pose.rotation * truth.rotation.inv()).as_rotvec()
    # The center's error along the camera's axes, in which the covariance's last rows are.
    shift = pose.rotation.apply(truth.camera_center - pose.camera_center)
    sigmas = (_sigmas(turn, covariance[:3, :3]), _sigmas(shift, covariance[3:, 3:]))
    return Errors(float(np.degrees(np.linalg.norm(turn))), float(np.linalg.norm(shift)), *sigmas)


def _sigmas(error: Array, covariance: Array) -> float:
    """An error (3,) over its standard deviation in its direction."""
    squared = float(error @ error)
    variance = float(error @ covariance @ error)
    return squared / np.sqrt(variance) if variance > 0.0 else float("inf")


def row_of(scene: RealScene, way: str, prior: str) -> Row:
    """A scene's estimate and its errors."""
    estimate, scatter = scene.estimate_and_scatter(way, prior)
    answers: list[rp.PoseEstimate | rp.solve.Alternative] = [estimate, *estimate.diagnostics.alternatives]
    errors = [errors_of(answer.pose, answer.covariance, scene.truth) for answer in answers]
    place = int(np.argmin([each.rotation for each in errors]))
    codes = tuple(dict.fromkeys(warning.code for warning in estimate.warnings))
    of_answers = errors[0], errors[place], place + 1, len(errors)
    return Row(scene.kind, way, prior, *of_answers, estimate.confidence, codes, scatter)


def line(name: str, row: Row) -> str:
    """A row as text."""
    nearest = "" if row.place == 1 else f"  answer {row.place} of {row.answers}: {written(row.nearest)}"
    trust = "trusted" if not row.codes else " ".join(row.codes)
    apart = (
        ""
        if row.between_frame_sigma is None
        else "  frames {rotation_sigma_deg:.2f} deg {center_sigma_m:.3f} m".format(**asdict(row.between_frame_sigma))
    )
    return f"{name:28} {row.way:8} {row.prior:9} {written(row.first)}  {row.confidence:5.2f} {trust}{apart}{nearest}"


def written(errors: Errors) -> str:
    """Errors as text."""
    return (
        f"{errors.rotation:7.3f} deg ({errors.rotation_sigmas:4.1f}) {errors.center:7.3f} m"
        f" ({errors.center_sigmas:4.1f})"
    )


def rows_of(scene: RealScene) -> Iterator[Row]:
    """The rows of a scene, each printed; one that has no pose is printed alone."""
    for way in scene.worlds:
        for prior in scene.priors:
            try:
                row = row_of(scene, way, prior)
            except rp.PoseError as error:
                print(f"{scene.name:28} {way:8} {prior:9} {error}", flush=True)
                continue
            print(line(scene.name, row), flush=True)
            yield row


def rigs_of(scenes: Sequence[RealScene], most: int) -> Iterator[RealScene]:
    """Two, four and all frames of a rig at once; of two and four at most so many, at random."""
    for count in (2, 4):
        choices = list(combinations(scenes, count)) if count < len(scenes) else []
        order = np.random.default_rng(0).permutation(len(choices))[:most]
        for number in sorted(order):
            frames = "+".join(scene.name[-4:] for scene in choices[number])
            yield joined(choices[number], f"{scenes[0].kind} by {count}/{frames}")
    yield joined(scenes, f"{scenes[0].kind} by {len(scenes)}/all")


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Lines of a Markdown table, by kind of scene, way and prior: medians and worst cases of the first answers."""
    heads = ["scenes", "number", "regions", "known", "deg", "worst", "m", "worst", "nearest answer, deg"]
    heads += ["beyond 3 sigma", "and trusted", "beyond 5 deg", "and trusted"]
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for group in dict.fromkeys((row.kind, row.way, row.prior) for row in rows):
        yield f"| {' | '.join(cells_of(group, [row for row in rows if (row.kind, row.way, row.prior) == group]))} |"


def confidences(poses: Sequence[tuple[float, float]]) -> Iterator[str]:
    """Lines of a Markdown table: what confidences state of poses, and how many are turned by so few degrees."""
    stated, turned = np.array(poses).reshape(-1, 2).T
    yield "| confidence | poses | stated | within 5 deg |"
    yield "|" + "---|" * 4
    for least, most in pairwise(BOUNDS):
        inside = (least <= stated) & ((stated < most) | (most == BOUNDS[-1]))
        if inside.any():
            shares = [
                f"{100.0 * share:.1f} %" for share in (stated[inside].mean(), (turned[inside] < WRONG_DEG).mean())
            ]
            yield f"| {100.0 * least:g} to {100.0 * most:g} % | {inside.sum()} | {' | '.join(shares)} |"


def cells_of(group: tuple[str, str, str], rows: Sequence[Row]) -> list[str]:
    """The cells of a group of rows."""
    turns, centers = (np.array([getattr(row.first, name) for row in rows]) for name in ("rotation", "center"))
    beyond = [row for row in rows if max(row.first.rotation_sigmas, row.first.center_sigmas) > MOST_SIGMAS]
    wrong = [row for row in rows if row.first.rotation > WRONG_DEG]
    errors = [f"{value:.2f}" for held in (turns, centers) for value in (np.median(held), held.max())]
    nearest = f"{np.median([row.nearest.rotation for row in rows]):.2f}"
    counts = [str(count) for held in (beyond, wrong) for count in (len(held), sum(not row.codes for row in held))]
    return [group[0], str(len(rows)), *group[1:], *errors, nearest, *counts]


def write_bundle(folder: Path, out: Path) -> None:
    """Write result, report and pictures of a scene beside its scene file, as the command does."""
    path = scene_file(folder, out, "samples") or scene_file(folder, out, "known")
    if path is None:
        return
    kept = out / path.stem
    kept.mkdir(exist_ok=True)
    for name, write in bundle(estimate_scene(load_scene(path)), Stages()).writers.items():
        write(kept / name)


def main() -> None:
    """Print the lines of each scene and each rig, then the table."""
    warnings.simplefilter("ignore", SparseSamplingWarning)
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--only", nargs="+", help="folders of scenes, all when left out")
    parser.add_argument("--out", type=Path, help="keep scene files here, with result, report and pictures of each")
    parser.add_argument("--rigs", type=int, default=10, help="rigs of two and of four frames")
    arguments = parser.parse_args()
    folders = sorted(path.parent.resolve() for path in arguments.data.glob("*/*/regions.json"))
    folders = [path for path in folders if arguments.only is None or path.parent.name in arguments.only]
    if not folders:
        print(f"no scenes below {arguments.data}: nothing to measure")
        return
    with tempfile.TemporaryDirectory() as temporary:
        out = arguments.out or Path(temporary)
        out.mkdir(parents=True, exist_ok=True)
        scenes = [scene_of(folder, out) for folder in folders]
        for folder in folders if arguments.out is not None else ():
            write_bundle(folder, out)
    rows = [row for scene in scenes for row in rows_of(scene)]
    single = [(row.confidence, row.first.rotation) for row in rows]
    for kind in (RIG, NATURAL):
        frames = [scene for scene in scenes if scene.kind == kind]
        rows += [row for rig in (rigs_of(frames, arguments.rigs) if frames else ()) for row in rows_of(rig)]
    print("", *table(rows), "", *confidences(single), sep="\n")


if __name__ == "__main__":
    main()
