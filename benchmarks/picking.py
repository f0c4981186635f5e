"""Clicks from a photo and a cloud to a pose, on the labeled faces of real frames, as `regionpose pick` takes them.

The scenes are folders with calib.json, regions.json, image.png, and labeled points of a lidar's cloud below --data. A
user is played who knows nothing but where the faces are, works on them in order of their size in the photo, and stops
at the first trusted pose. Of each face

1. a click in the photo, on the pixel deepest inside the drawn face. The proposed mask that overlaps the face best is
   taken with the slider, a click, if it reaches an IoU of 0.9. Otherwise the step is undone, and the face drawn: a
   click on each vertex of the coarsest polygon with an IoU of 0.97 to the labeled one, with Shift where an edge is
   hidden.
2. a click in the range image, on the pixel deepest inside the labeled points. Of the proposals, the one that overlaps
   these best is taken. If it reaches less than an IoU of 0.8, the face's points are cut out of it: a click on each
   corner of the outline drawn around them, their convex hull to 2 px.

All of this counts, undoing too; the keys that choose a tool don't. It is done with the calls that the page makes for
each. A line each: clicks, faces, verdict, errors of rotation and of the camera's center, and the warnings. Then the
share of frames whose pose is trusted within 20 clicks.

    python benchmarks/picking.py [--data ../shared/data] [--only natural kitti]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from click_masks import filled, pixels_of
from image_segmentation import deepest
from numpy.typing import NDArray
from real_scenes import DEFAULT_DATA, camera_item, cloud_file, errors_of
from regionpose.pick.range_view import RangeView
from regionpose.pick.session import Session
from regionpose.pose import Pose
from regionpose.scene import SceneEstimate
from regionpose.scene.verdict import TRUSTED, verdict
from regionpose.yaml_text import to_yaml

Mask = NDArray[np.bool_]
Plain = dict[str, Any]

MOST_CLICKS = 20
GOOD_MASK, GOOD_DRAWING, GOOD_POINTS = 0.9, 0.97, 0.8
"""Overlaps (IoU) that the user settles for: of a proposed mask, of a drawn polygon, of proposed points."""

AROUND_PX = 2.0
"""Pixels of the range image between the points and the outline drawn around them, and to which that is straight."""

COARSEST_PX, FINER = 32.0, 2.0**0.5
"""Distance of the coarsest polygon that is tried from the labeled one, and the ratio to the next."""


@dataclass
class User:
    """Who clicks in a session on a cloud that is shown as `view`, and how often."""

    session: Session
    view: RangeView
    clicks: int = 0
    faces: int = field(default=0)

    def pick(self, face: Plain, labels: NDArray[np.int64]) -> None:
        """Give both sides of a face."""
        self.session.select(None)
        self._photo(face)
        self._cloud(labels)
        self.faces += 1

    def _photo(self, face: Plain) -> None:
        drawn = filled(face["image_polygon"], self.session.image.shape[:2])
        self.clicks += 1
        if self._grown(drawn):
            return
        ring = coarser(face["image_polygon"])
        self.clicks += len(ring)
        self.session.draw_polygon(ring, hidden=hidden_edges(ring, face))

    def _grown(self, drawn: Mask) -> bool:
        """Whether a click proposes the drawn face, which is taken then; nothing is left of it otherwise."""
        try:
            self.session.click_photo(deepest(drawn))
        except ValueError:
            return False
        choices = self.session.regions[-1].image
        assert choices is not None
        overlaps = [overlap(pixels_of(choices.at(k).chosen, drawn.shape), drawn) for k in range(len(choices))]
        best = int(np.argmax(overlaps))
        if overlaps[best] >= GOOD_MASK:
            self._choose("image", best, choices.index)
            return True
        self.clicks += 1
        self.session.undo()
        return False

    def _cloud(self, labels: NDArray[np.int64]) -> None:
        shown = np.isin(self.view.indices, labels)
        self.clicks += 1
        index = self.view.point_at(*deepest(shown))
        assert index is not None
        self.session.click_cloud(self.session.cloud.local_points[index] + self.session.cloud.origin)
        choices = self.session.sketch.region(self._key).world
        assert choices is not None
        sides = [choices.at(k).chosen.side for k in range(len(choices))]
        overlaps = [points_overlap(side.indices, labels) for side in sides]
        self._choose("world", int(np.argmax(overlaps)), choices.index)
        if max(overlaps) < GOOD_POINTS:
            self._cut(labels)

    def _cut(self, labels: NDArray[np.int64]) -> None:
        pixels = self.view.pixels(self.session.cloud.local_points[labels])
        hull = shapely.MultiPoint(pixels).convex_hull.buffer(AROUND_PX).simplify(AROUND_PX)
        ring = [list(corner) for corner in hull.exterior.coords[:-1]]
        self.clicks += len(ring)
        self.session.cut_cloud(self._key, lambda points: self.view.inside(ring, points))

    def _choose(self, side: str, index: int, taken: int) -> None:
        if index != taken:
            self.clicks += 1
            self.session.choose(self._key, side, index)

    @property
    def _key(self) -> int:
        assert self.session.sketch.selected is not None
        return self.session.sketch.selected


class Row(NamedTuple):
    """What the clicks on a frame led to."""

    clicks: int
    faces: int
    level: str
    rotation_deg: float
    center_m: float
    codes: tuple[str, ...]

    @property
    def is_reached(self) -> bool:
        """Whether the pose is trusted within the clicks that are allowed."""
        return self.level == TRUSTED and self.clicks <= MOST_CLICKS


def overlap(one: Mask, other: Mask) -> float:
    """IoU of two masks."""
    return float((one & other).sum() / max(1, (one | other).sum()))


def points_overlap(indices: NDArray[np.intp] | None, labels: NDArray[np.int64]) -> float:
    """IoU of two sets of points."""
    found = np.array([], dtype=np.intp) if indices is None else indices
    shared = len(np.intersect1d(found, labels))
    return shared / (len(found) + len(labels) - shared)


def coarser(polygon: list[list[float]]) -> list[list[float]]:
    """The polygon of the fewest vertices that a user would draw of a labeled one."""
    whole, tolerance = shapely.Polygon(polygon).buffer(0), COARSEST_PX
    while True:
        simple = shapely.Polygon(shapely.LinearRing(polygon).simplify(tolerance))
        valid = shapely.Polygon() if not simple.is_valid else simple
        if valid.intersection(whole).area >= GOOD_DRAWING * valid.union(whole).area:
            return [list(vertex) for vertex in valid.exterior.coords[:-1]]
        tolerance /= FINER


def hidden_edges(ring: list[list[float]], face: Plain) -> list[int]:
    """The edges of a ring that lie along hidden edges of a face for more than half of their length."""
    labeled, marked = face["image_polygon"], face.get("hidden_edges", [])
    edges = [shapely.LineString([labeled[k], labeled[(k + 1) % len(labeled)]]) for k in range(len(labeled))]
    places = np.linspace(0.05, 0.95, 19)
    found = []
    for k in range(len(ring)):
        edge = shapely.LineString([ring[k], ring[(k + 1) % len(ring)]])
        points = [edge.interpolate(place, normalized=True) for place in places]
        nearest = [int(np.argmin([other.distance(point) for other in edges])) for point in points]
        if np.mean(np.isin(nearest, marked)) > 0.5:
            found.append(k)
    return found


def camera_info(folder: Path, out: Path) -> Path:
    """The camera of a scene's calib.json as a file of ROS."""
    item = camera_item(json.loads((folder / "calib.json").read_text()))
    matrix = [item["fx"], 0.0, item["cx"], 0.0, item["fy"], item["cy"], 0.0, 0.0, 1.0]
    lens = {"fisheye": "equidistant", "pinhole": "plumb_bob"}[item["model"]]
    distortion = item["distortion"]
    values = {
        "image_width": item["width"],
        "image_height": item["height"],
        "camera_name": "camera",
        "camera_matrix": {"rows": 3, "cols": 3, "data": matrix},
        "distortion_model": lens,
        "distortion_coefficients": {"rows": 1, "cols": len(distortion), "data": distortion},
    }
    path = out / "camera.yaml"
    path.write_text(to_yaml(values), encoding="utf-8")
    return path


def frames(data: Path, kinds: list[str]) -> Iterator[Path]:
    """The folders of scenes with labeled points."""
    for kind in kinds:
        for path in sorted(data.glob(f"{kind}/*/regions.json")):
            if all("point_indices" in region for region in json.loads(path.read_text())):
                yield path.parent


def picked(folder: Path, out: Path) -> Row:
    """What clicks on a frame lead to."""
    session = Session.create(
        out / "scene.yaml", image=folder / "image.png", camera=camera_info(folder, out), cloud=cloud_file(folder)
    )
    scanner = np.zeros(3) if session.scan.scanner is None else session.scan.scanner
    user = User(session, RangeView.of(session.cloud, scanner))
    if session.asks_for_scanner:
        user.clicks += 1
        session.set_scanner([0.0, 0.0, 0.0])
    calibration = json.loads((folder / "calib.json").read_text())
    truth = Pose.from_parts(calibration["R"], calibration["t"])
    faces = json.loads((folder / "regions.json").read_text())
    rows = []
    for face in sorted(faces, key=lambda each: -shapely.Polygon(each["image_polygon"]).area):
        user.pick(face, np.load(folder / face["point_indices"]))
        rows.append(row_of(user, session.estimate(), truth))
        if rows[-1].level == TRUSTED:
            break
    return rows[-1]


def row_of(user: User, run: SceneEstimate, truth: Pose) -> Row:
    """What the clicks so far lead to."""
    errors = errors_of(run.estimate.pose, run.estimate.covariance, truth)
    codes = tuple(dict.fromkeys(warning.code for warning in run.estimate.warnings))
    return Row(user.clicks, user.faces, verdict(run).level, errors.rotation, errors.center, codes)


def main() -> None:
    """Print a line for each frame, and the share of those that are reached."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--only", nargs="+", default=["kitti", "natural"], help="kinds of scenes")
    options = parser.parse_args()
    reached = []
    for folder in frames(options.data, options.only):
        with tempfile.TemporaryDirectory() as place:
            row = picked(folder, Path(place))
        reached.append(row.is_reached)
        name = "/".join(folder.parts[-2:])
        errors = f"{row.rotation_deg:7.3f} deg {row.center_m:7.3f} m"
        counts = f"{row.clicks:3} clicks {row.faces} faces"
        print(f"{name:24} {counts} {row.level:9} {errors}  {' '.join(row.codes)}", flush=True)
    if not reached:
        print(f"no frames below {options.data}")
        return
    print(f"{sum(reached)} of {len(reached)} frames have a trusted pose within {MOST_CLICKS} clicks")


if __name__ == "__main__":
    main()
