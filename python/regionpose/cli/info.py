"""`regionpose info`: what is in a file."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from regionpose.cli.console import Progress, print_json, print_rows
from regionpose.cli.options import AsJson, CameraModel, CameraName, Columns, Quiet, Rectified, names_of

if TYPE_CHECKING:
    from regionpose.io.bags.place import BagPlace
    from regionpose.io.clouds import Cloud
    from regionpose.scene.loading import NamedRegion

DOCUMENT_SUFFIXES = {".yaml", ".yml", ".json"}
"""Files that may be scenes and results."""

READ = (
    "a cloud or mesh (PLY, PCD, LAS, LAZ, E57, .npy, .npz, .bin, .xyz, .txt, .csv, .asc, .pts, OBJ, STL, GLB), a bag"
    " (.bag, .mcap, .db3, or the folder of a ROS 2 bag), a photo (PNG, JPEG, TIFF, BMP, WebP), masks"
    " (label images; COCO, CVAT, labelme, Label Studio, Segment Anything), a calibration, a pose, a scene file or a"
    " result"
)
"""What is read, in words."""

LARGE = 1e6
"""Numbers from here on, times and coordinates of maps, are shown to a thousandth."""

ARRAY_SUFFIXES = {".npy", ".npz"}

LABELS_AT_MOST = 64
"""Different values of a gray or indexed picture up to which it is taken for one of labels: photos have more. A
convention."""

SHOWN_OF_RESULT = (
    "scene",
    "status",
    "headline",
    "confidence",
    "sigma",
    "camera_center_in_world_m",
)

Facts = dict[str, Any]


class CameraChoice(NamedTuple):
    """Which camera of a calibration is described: its name, its model, and whether of rectified photos."""

    name: str | None = None
    model: str | None = None
    rectified: bool = False


def info(
    file: Annotated[
        Path, typer.Argument(help="Cloud, bag, calibration, pose, image, masks, scene file or result.json.")
    ],
    camera_name: CameraName = None,
    camera_model: CameraModel = None,
    columns: Columns = None,
    rectified: Rectified = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Print the kind of a file and its contents: cloud, bag, calibration, pose, image, masks, scene file, result.

    \b
    Examples:
      regionpose info cloud.ply
      regionpose info calib.yaml --camera-name cam1
      regionpose info drive.mcap
      regionpose info scene.yaml --json
    """
    with Progress(quiet) as progress:
        choice = CameraChoice(camera_name, camera_model, rectified)
        facts = file_facts(file, progress, choice, columns=names_of(columns))
    if as_json:
        print_json(facts)
    else:
        typer.echo(f"{file}: {facts.pop('kind')}")
        topics = facts.pop("topics", [])
        print_rows([(key.replace("_", " "), _as_text(value)) for key, value in facts.items()])
        print_rows([(each["topic"], _topic_line(each)) for each in topics])


def file_facts(
    path: Path,
    progress: Progress | None = None,
    choice: CameraChoice | None = None,
    *,
    columns: list[str] | None = None,
) -> Facts:
    """The facts about a file, `kind` first; FileNotFoundError, or ValueError when it is of no known kind."""
    from regionpose.io.bags.camera_info import KINDS as CALIBRATIONS
    from regionpose.io.bags.messages import kind_of
    from regionpose.io.bags.place import bag_place, is_bag
    from regionpose.io.clouds.kinds import is_cloud
    from regionpose.io.clouds.ros import KINDS as CLOUDS
    from regionpose.io.reading import IMAGE_SUFFIXES, check_regular, is_picture

    suffix, shown_progress = path.suffix.lower(), progress or Progress(quiet=True)
    place = bag_place(path)
    if place is not None:
        kind = kind_of(place)
        if kind in CALIBRATIONS:
            return _camera_facts(path, choice or CameraChoice())
        return _cloud_facts(path, shown_progress, columns) if kind in CLOUDS else _picture_facts(place)
    if is_bag(path) and path.exists():
        return _bag_facts(path)
    if path.is_dir():
        raise ValueError(f"{path}: found a directory; needed {READ}")
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    check_regular(path)
    if suffix in IMAGE_SUFFIXES or is_picture(path):
        return _image_facts(path)
    if suffix in ARRAY_SUFFIXES and (facts := _array_facts(path)) is not None:
        return facts
    if is_cloud(path):
        return _cloud_facts(path, shown_progress, columns)
    return _text_facts(path, choice or CameraChoice(), shown_progress, columns)


def _text_facts(path: Path, choice: CameraChoice, progress: Progress, columns: list[str] | None) -> Facts:
    """The facts about a scene, a result or a calibration; about a cloud for a text of numbers."""
    from regionpose.scene.document import SceneError, read_document

    content: object = None
    if path.suffix.lower() in DOCUMENT_SUFFIXES:
        try:
            content = read_document(path).value
        except SceneError:
            content = None  # Calibrations of OpenCV are not quite YAML.
    if isinstance(content, dict) and str(content.get("format", "")).startswith("regionpose result"):
        return _result_facts(path)
    if isinstance(content, dict) and _is_scene(content):
        return _scene_facts(path)
    readers: dict[str, Callable[[], Facts]] = {
        "a calibration": lambda: _camera_facts(path, choice),
        "a pose": lambda: pose_facts(path, choice.name),
    }
    if path.suffix.lower() in {".json", ".xml"}:
        readers["masks"] = lambda: _mask_facts(path)
    if path.suffix.lower() == ".txt":
        readers["a cloud"] = lambda: _cloud_facts(path, progress, columns)
    return _first_that_reads(path, readers)


def _is_scene(content: dict[Any, Any]) -> bool:
    """Whether a mapping holds more than one key of a scene file: calibrations share one with it at the most."""
    from regionpose.scene.models import SceneModel

    return len(content.keys() & SceneModel.model_fields.keys()) > 1


def _first_that_reads(path: Path, readers: dict[str, Callable[[], Facts]]) -> Facts:
    """The facts of the first reader that knows the file; ValueError with what is read, and the error of each."""
    errors = []
    for kind, read in readers.items():
        try:
            return read()
        except ValueError as error:
            errors.append(f"As {kind}: {str(error).removeprefix(f'{path}: ').removeprefix(str(path)).lstrip(', ')}")
    raise ValueError(f"{path}: found no kind of file that is known; needed {READ}. {'. '.join(errors)}")


def _bag_facts(path: Path) -> Facts:
    """The facts about a bag: its topics, and what each can be read as."""
    from regionpose.io.bags.camera_info import KINDS as CALIBRATIONS
    from regionpose.io.bags.messages import summary
    from regionpose.io.bags.pictures import KINDS as PICTURES
    from regionpose.io.clouds.ros import KINDS as CLOUDS

    bag, uses = summary(path), {**dict.fromkeys(CLOUDS, "cloud"), **dict.fromkeys(PICTURES, "image")}
    uses |= dict.fromkeys(CALIBRATIONS, "calibration")
    topics = [
        {"topic": name, "type": kind, "messages": count, "read_as": uses.get(kind.rpartition("/")[2])}
        for name, kind, count in bag.topics
    ]
    return {"kind": "bag", "duration_s": bag.duration_s, "begins_s": bag.begins_s, "topics": topics}


def _topic_line(topic: Facts) -> str:
    """A topic as `sensor_msgs/msg/PointCloud2, 20 messages, read as cloud`."""
    use = "not read" if topic["read_as"] is None else f"read as {topic['read_as']}"
    return f"{topic['type']}, {topic['messages']} messages, {use}"


def _array_facts(path: Path) -> Facts | None:
    """The facts about an array of one value a point: indices, labels or a mask; None of other arrays."""
    from regionpose.io.reading import FileError, read_array

    try:
        values = read_array(path)
    except FileError:
        return None
    if values.ndim != 1 or values.dtype.kind not in "biu" or not len(values):
        return None
    meaning = "mask" if values.dtype.kind == "b" else "indices or labels"
    low, high = int(values.min()), int(values.max())
    return {"kind": f"{meaning} of points", "values": len(values), "lowest": low, "highest": high}


def _mask_facts(path: Path) -> Facts:
    """The facts about a file of masks: its regions, and those that can't be read with what is wrong."""
    from regionpose.io.masks.mask_files import file_items

    regions, damaged = [], []
    for item in file_items(path, None):
        try:
            item.check()
            regions.append(item.name)
        except ValueError as error:
            damaged.append(f"{item.name}: {str(error).removeprefix(str(path)).lstrip(', ')}")
    return {"kind": "masks", "regions": regions, "damaged": damaged}


def _image_facts(path: Path) -> Facts:
    import numpy as np

    from regionpose.io.reading import read_pixels

    values, mode, form = read_pixels(path)
    height, width = values.shape[:2]
    facts = {"kind": "image", "width_px": width, "height_px": height, "mode": mode, "format": form}
    labels = np.unique(values) if values.ndim == 2 and values.dtype.kind in "biu" else np.arange(LABELS_AT_MOST + 1)
    if len(labels) > LABELS_AT_MOST:
        return facts
    return facts | {"kind": "image of labels", "labels": labels.astype(int).tolist()}


def _picture_facts(place: BagPlace) -> Facts:
    """The facts about a picture in a bag."""
    from regionpose.io.bags.pictures import read_bag_picture

    height, width = read_bag_picture(place).shape[:2]
    return {"kind": "image of a bag", "width_px": width, "height_px": height}


def _cloud_facts(path: Path, progress: Progress, columns: list[str] | None = None) -> Facts:
    cloud = progress.read_cloud(path, columns)
    progress.begin(f"spacing of {len(cloud)} points")
    spacing = _spacing(cloud.local_points, progress.fraction)
    low, high = cloud.local_points.min(axis=0), cloud.local_points.max(axis=0)
    return {
        "kind": "cloud" if cloud.triangles is None else "mesh",
        "points": len(cloud),
        "triangles": None if cloud.triangles is None else len(cloud.triangles),
        "lowest_corner_m": (low + cloud.origin).tolist(),
        "highest_corner_m": (high + cloud.origin).tolist(),
        "extent_m": (high - low).tolist(),
        "local_origin_m": cloud.origin.tolist(),
        "sensor_origin_m": None if cloud.sensor_origin is None else cloud.sensor_origin.tolist(),
        "spacing_m": spacing,
        "unit": _unit(cloud, spacing),
        "colors": cloud.colors is not None,
        "intensity": cloud.intensity is not None,
        "empty_columns": list(cloud.empty),
        "fields": sorted(cloud.fields),
        "grid": None if cloud.grid_shape is None else f"{cloud.grid_shape[0]} x {cloud.grid_shape[1]}",
        "dropped_points": cloud.dropped,
    }


def _unit(cloud: Cloud, spacing: float | None) -> str:
    """The unit of a cloud by its file or its size; the vertices of a mesh are no samples."""
    from regionpose.scene.input_checks import check_unit, unit_remark

    remarks = [f"{warning.text}. {warning.advice}" for warning in check_unit(cloud)]
    if not remarks and cloud.triangles is None and spacing is not None:
        extent = math.hypot(*(cloud.local_points.max(axis=0) - cloud.local_points.min(axis=0)))
        remarks = [remark for remark in [unit_remark(spacing, extent)] if remark is not None]
    return f"taken as meters, but {remarks[0]}" if remarks else "taken as meters"


SPACING_SAMPLE = 2000
"""Points whose nearest neighbor is looked up for the median spacing."""

PIECE_POINTS = 1 << 18
"""Points among which neighbors are looked for at once: a tenth of a second."""


def _spacing(points: Any, progress: Callable[[float], object]) -> float | None:
    """Median distance of a point to its nearest neighbor, in the cloud's unit; trees of pieces build faster."""
    import numpy as np
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return None
    sample = points[:: max(1, len(points) // SPACING_SAMPLE)]
    nearest = np.full((len(sample), 2), np.inf)
    for start in range(0, len(points), PIECE_POINTS):
        piece = points[start : start + PIECE_POINTS]
        found = np.asarray(cKDTree(piece).query(sample, k=2)[0])
        # A sample's own piece has it at distance zero.
        nearest = np.sort(np.hstack([nearest, found]), axis=1)[:, :2]
        progress(min(1.0, (start + PIECE_POINTS) / len(points)))
    return float(np.median(nearest[:, 1]))


def _camera_facts(path: Path, choice: CameraChoice) -> Facts:
    from dataclasses import asdict

    import numpy as np

    from regionpose.io.calibrations import load_camera
    from regionpose.io.calibrations.kinds import calibration_kind
    from regionpose.scene.input_checks import check_camera

    camera = load_camera(path, choice.name, model=choice.model, rectified=choice.rectified)
    parameters = {key: value for key, value in asdict(camera).items() if not key.startswith("_")}  # type: ignore[call-overload]
    facts: Facts = {"kind": "calibration", "written_as": calibration_kind(path), "model": type(camera).__name__}
    facts |= json.loads(json.dumps(parameters))
    facts["largest_angle_off_axis_deg"] = float(np.degrees(camera.max_angle))
    if camera.width is not None and camera.height is not None:
        middle = np.array([[-0.5, camera.height / 2], [camera.width - 0.5, camera.height / 2]])
        left, right = camera.bearings(middle)
        angle = float(np.degrees(np.arctan2(np.linalg.norm(np.cross(left, right)), left @ right)))
        facts["angle_between_left_and_right_edge_deg"] = angle if np.isfinite(angle) else None
        facts["lens_warnings"] = [str(warning) for warning in check_camera(camera, (camera.height, camera.width))]
    with suppress(ValueError, FileNotFoundError):
        facts |= {f"pose_{key}": value for key, value in pose_facts(path, choice.name).items() if key != "kind"}
    return facts


def pose_facts(path: Path, camera_name: str | None) -> Facts:
    """The facts about a file that holds a pose; ValueError where it holds none of a known kind."""
    from regionpose.io.calibrations.poses import PoseSource, read_pose_file

    pose_file = read_pose_file(path, PoseSource(camera_name))
    return {
        "kind": "pose",
        "written_as": pose_file.kind,
        "meaning": pose_file.convention,
        "camera_from_world": pose_file.pose.matrix.tolist(),
        "camera_center_m": pose_file.pose.camera_center.tolist(),
    }


def _scene_facts(path: Path) -> Facts:
    from regionpose.io.bags.place import is_there
    from regionpose.scene.inputs import named_files
    from regionpose.scene.loading import load_scene, named_regions

    scene = load_scene(path)
    files = {role: str(scene.file(name)) for role, name in named_files(scene).items()}
    return {
        "kind": "scene file",
        "regions": [_region_line(frame.name, region) for frame in scene.frames for region in named_regions(frame)],
        "files": files,
        "missing_files": [name for name in files.values() if not is_there(name)],
        "solver": scene.model.solver.model_dump(),
    }


def _region_line(frame: str, region: NamedRegion) -> str:
    """A region as `door (image seed, world points)`, after the name of its frame where the scene has frames."""
    sides = [(name, side) for name, side in (("image", region.image), ("world", region.world)) if side is not None]
    kinds = ", ".join(f"{name} {_kind(side)}" for name, side in sides)
    return f"{f'{frame}: ' if frame else ''}{region.name} ({kinds})"


def _kind(side: Any) -> str:
    """The key that gives a side's kind."""
    return next(key for key in ("seed", "mask", "points", "mesh", "polygon") if key in type(side).model_fields)


def _result_facts(path: Path) -> Facts:
    from regionpose.io.reading import read_json

    result = read_json(path)
    facts: Facts = {"kind": "result", **{key: result.get(key) for key in SHOWN_OF_RESULT}}
    diagnostics = result.get("diagnostics", {})
    if not isinstance(diagnostics, dict):
        raise ValueError(f"{path}: diagnostics: found something else; needed a mapping")
    facts["regions"] = _column(path, diagnostics, "regions", "name")
    facts["warnings"] = _column(path, result, "warnings", "code")
    return facts


def _column(path: Path, result: Facts, key: str, name: str) -> list[str]:
    """The value at `name` of each item of a list in a result."""
    items = result.get(key, [])
    if not (isinstance(items, list) and all(isinstance(item, dict) and name in item for item in items)):
        raise ValueError(f"{path}: {key}: found something else; needed a list of items, each with a {name}")
    return [item[name] for item in items]


def _as_text(value: object) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}" if abs(value) < LARGE else f"{value:.3f}"
    if isinstance(value, list):
        return ", ".join(_as_text(item) for item in value) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_as_text(item)}" for key, item in value.items()) or "none"
    return str(value)
