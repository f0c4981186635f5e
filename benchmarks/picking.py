"""Clicks from a photo and a cloud to a pose, on the labeled faces of real frames, as `regionpose pick` takes them.

The scenes are folders with calib.json, regions.json, image.png, and labeled points of a lidar's cloud below --data. A
user is played who sees where the faces are in both pictures, and nothing of the pose, works on them in order of their
size in the photo, and stops at the first trusted pose. Of each face

1. its outline in the photo: a click on each corner of its own edges, which are followed to a pixel, and a Shift-drag
   along each stretch of hidden ones that has corners, as around a car; an image border's straight one takes a
   Shift-click on the corner at its end, which is counted already.
2. a Shift-drag around its points in the range image, halfway to the next ones.

With `--edges` the user first looks at the pose by edges, as the page opens with it, then says by a click that the
camera is upright, and marks faces only where neither is trusted.

Each click and each drag counts, and so does that on the scanner's place; the keys that choose a tool don't. It is done
with the calls that the page makes for each. A line each: clicks and drags, faces, verdict, errors of rotation and of
the camera's center, and the warnings. Then the share of frames whose pose is trusted within 20.

    python -m benchmarks.picking [--edges] [--data ../shared/data] [--only natural kitti]
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
from numpy.typing import NDArray
from regionpose.app.prior_settings import PriorSettings
from regionpose.app.range_view import PIXELS_PER_SPACING, RangeView
from regionpose.app.session import Session
from regionpose.geometry.pose import Pose
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.estimate import SceneEstimate
from regionpose.solve.prior import UP_SIGMA_DEG
from regionpose.solve.status import PoseStatus

from benchmarks.real_scenes import DEFAULT_DATA, camera_item, cloud_file, errors_of

Plain = dict[str, Any]

MOST_CLICKS = 20
OWN_PX, HIDDEN_PX = 1.0, 2.0
"""Pixels to which a drawn outline follows a face's own edges, which a loupe shows, and a hand's drag the others."""

UPRIGHT = PriorSettings(up=(0.0, 0.0, 1.0), up_sigma_deg=UP_SIGMA_DEG)
"""What the user knows of a car's camera, in the frame of its scanner."""

HALFWAY_PX = 0.5 * PIXELS_PER_SPACING
"""Pixels of the range image between a face's points and the outline drawn around them: halfway to the next ones."""

BRIDGED_PX = 4.0 * PIXELS_PER_SPACING
"""Gaps between points up to twice this are inside that outline: those between scan lines, which are four times as far
apart as points along them (HDL-64), and windows of a few points."""


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
        drawn = drawing(face["image_polygon"], face.get("hidden_edges", []))
        self.clicks += drawn.clicks
        self.session.draw_polygon(drawn.ring, hidden=drawn.hidden)

    def _cloud(self, labels: NDArray[np.int64]) -> None:
        ring = around(self.view.pixels(self.session.cloud.local_points[labels]))
        self.clicks += 1
        self.session.cut_cloud(lambda points: self.view.inside(ring, points), self.view.visible_points)


class Drawing(NamedTuple):
    """A drawn polygon (n, 2), its hidden edges, and the clicks and drags that it took."""

    ring: list[list[float]]
    hidden: list[int]
    clicks: int


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
        return self.level == PoseStatus.TRUSTED and self.clicks <= MOST_CLICKS


def drawing(polygon: list[list[float]], hidden: list[int]) -> Drawing:
    """How a user draws a labeled polygon whose edges `hidden` are not the face's own."""
    count = len(polygon)
    if not hidden:
        own = [list(vertex) for vertex in shapely.LinearRing(polygon).simplify(OWN_PX).coords[:-1]]
        return Drawing(own, [], len(own))
    is_hidden = np.isin(np.arange(count), hidden)
    starts = np.flatnonzero(is_hidden != np.roll(is_hidden, 1)).tolist() or [0]
    ring: list[list[float]] = []
    marked: list[int] = []
    clicks = 0
    for start, end in zip(starts, [*starts[1:], starts[0] + count], strict=True):
        stretch = shapely.LineString([polygon[k % count] for k in range(start, end + 1)])
        kept = [list(vertex) for vertex in stretch.simplify(HIDDEN_PX if is_hidden[start] else OWN_PX).coords]
        if is_hidden[start]:
            marked += range(len(ring), len(ring) + len(kept) - 1)
            clicks += len(kept) > 2
        else:
            clicks += len(kept)
        # The corner at its end is that at which the next stretch begins.
        ring += kept[:-1]
    return Drawing(ring, marked, clicks)


def around(pixels: NDArray[np.float64]) -> list[list[float]]:
    """The outline (k, 2) that a user draws around pixels (n, 2) of the range image."""
    near = shapely.MultiPoint(pixels).buffer(BRIDGED_PX).buffer(HALFWAY_PX - BRIDGED_PX)
    outline = near if near.geom_type == "Polygon" else shapely.MultiPoint(pixels).convex_hull.buffer(HALFWAY_PX)
    return [list(corner) for corner in outline.exterior.coords[:-1]]


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


def by_edges(user: User, truth: Pose) -> Row:
    """What the page opens with, or, where that is not trusted, what it shows once the direction up is known."""
    session = user.session
    row = row_of(user, session.estimate_edges(session.edge_values()), truth)
    if row.level == PoseStatus.TRUSTED:
        return row
    session.set_prior_settings(UPRIGHT)
    user.clicks += 1
    return row_of(user, session.estimate_edges(session.edge_values()), truth)


def picked(folder: Path, out: Path, *, edges: bool = False) -> Row:
    """What clicks on a frame lead to; `edges`: whether the pose by edges is looked at first."""
    session = Session.create(
        out / "scene.yaml", image=folder / "image.png", camera=camera_info(folder, out), cloud=cloud_file(folder)
    )
    scanner = np.zeros(3) if session.scan.scanner is None else session.scan.scanner
    user = User(session, RangeView.of(session.cloud, scanner))
    calibration = json.loads((folder / "calib.json").read_text())
    truth = Pose.from_parts(calibration["R"], calibration["t"])
    if edges and (row := by_edges(user, truth)).level == PoseStatus.TRUSTED:
        return row
    if session.lacks_scanner:
        user.clicks += 1
        session.set_scanner([0.0, 0.0, 0.0])
    faces = json.loads((folder / "regions.json").read_text())
    rows = []
    for face in sorted(faces, key=lambda each: -shapely.Polygon(each["image_polygon"]).area):
        user.pick(face, np.load(folder / face["point_indices"]))
        rows.append(row_of(user, session.estimate(), truth))
        if rows[-1].level == PoseStatus.TRUSTED:
            break
    return rows[-1]


def row_of(user: User, run: SceneEstimate, truth: Pose) -> Row:
    """What the clicks so far lead to."""
    errors = errors_of(run.estimate.pose, run.estimate.covariance, truth)
    codes = tuple(dict.fromkeys(warning.code for warning in run.estimate.warnings))
    return Row(user.clicks, user.faces, run.estimate.status.value, errors.rotation, errors.center, codes)


def main() -> None:
    """Print a line for each frame, and the share of those that are reached."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--only", nargs="+", default=["kitti", "natural"], help="kinds of scenes")
    parser.add_argument("--edges", action="store_true", help="look at the pose by edges first")
    options = parser.parse_args()
    reached = []
    for folder in frames(options.data, options.only):
        with tempfile.TemporaryDirectory() as place:
            row = picked(folder, Path(place), edges=options.edges)
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
