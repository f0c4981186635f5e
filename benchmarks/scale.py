"""Time and peak memory of each stage on a cloud of 5 million points and an image of 24 megapixels.

The scene is made here: a room of 10 x 8 x 3 m with 3 mm noise, three panels before its walls, and a picture of them.
Each stage runs in a process of its own; `cpu` is its processor time, `beside` the most memory that it took beside what
it was given. The calibration is that of two of the panels and of the edges of photo and cloud.
The picking page's pictures are those that it shows first, with the reading of the files; its click in 3D is the first
one, which builds an index.

    python -m benchmarks.scale [--points 5000000] [--megapixels 24]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.bundle import bundle
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from regionpose.scene.stages import Stages

Array = NDArray[np.float64]

ROOM = np.array([10.0, 8.0, 3.0])
NOISE = 0.003
CENTER, FORWARD = np.array([3.5, 1.5, 1.6]), np.array([0.72, 0.69, 0.0])
WALLS = [
    ((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 8.0, 0.0)),
    ((0.0, 0.0, 3.0), (10.0, 0.0, 0.0), (0.0, 8.0, 0.0)),
    ((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (0.0, 0.0, 3.0)),
    ((0.0, 8.0, 0.0), (10.0, 0.0, 0.0), (0.0, 0.0, 3.0)),
    ((0.0, 0.0, 0.0), (0.0, 8.0, 0.0), (0.0, 0.0, 3.0)),
    ((10.0, 0.0, 0.0), (0.0, 8.0, 0.0), (0.0, 0.0, 3.0)),
]
PANELS = {  # corner and two edges, meters; 10 cm before a wall
    "notice": ((6.2, 7.9, 0.9), (1.4, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "poster": ((8.2, 7.9, 1.1), (1.2, 0.0, 0.0), (0.0, 0.0, 1.5)),
    "sign": ((9.9, 4.4, 1.0), (0.0, 1.4, 0.0), (0.0, 0.0, 1.2)),
}
COLORS = {"notice": (150, 60, 40), "poster": (40, 90, 150), "sign": (200, 170, 40)}


class Inputs(NamedTuple):
    """The files of the scene."""

    cloud: Path
    image: Path
    scene: Path
    camera: Path

    @classmethod
    def of(cls, folder: Path) -> Inputs:
        """Where they are in a folder."""
        return cls(*(folder / name for name in ("cloud.ply", "image.png", "scene.yaml", "camera.yaml")))


def camera_of(megapixels: float) -> rp.PinholeCamera:
    """A pinhole camera of 3 : 2."""
    height = round(float(np.sqrt(megapixels * 1e6 / 1.5)))
    width = round(1.5 * height)
    return rp.PinholeCamera(0.62 * width, 0.62 * width, width / 2, height / 2, width=width, height=height)


def true_pose() -> rp.Pose:
    """`camera_from_world`."""
    forward = FORWARD / np.linalg.norm(FORWARD)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    rotation = np.array([right, [0.0, 0.0, -1.0], forward])
    return rp.Pose.from_parts(rotation, -rotation @ CENTER)


def points_of(count: int) -> Array:
    """Points (n, 3) on the walls and panels."""
    generator = np.random.default_rng(1)
    faces = [tuple(np.array(part) for part in face) for face in (*WALLS, *PANELS.values())]
    areas = np.array([np.linalg.norm(np.cross(u, v)) for _, u, v in faces])
    parts = []
    for (corner, u, v), area in zip(faces, areas, strict=True):
        shares = generator.uniform(0.0, 1.0, (round(count * area / areas.sum()), 2))
        parts.append(corner + shares[:, :1] * u + shares[:, 1:] * v)
    points = np.concatenate(parts)
    return points + generator.normal(0.0, NOISE, points.shape)


def picture_of(camera: rp.PinholeCamera) -> Image.Image:
    """The panels on a shaded, noisy wall."""
    assert camera.width is not None and camera.height is not None
    shade = np.linspace(150, 200, camera.width)[None, :] + np.zeros((camera.height, 1))
    page = Image.fromarray(np.repeat(shade[..., None], 3, axis=2).astype(np.uint8))
    pen = ImageDraw.Draw(page)
    for name, (corner, u, v) in PANELS.items():
        first, along, up = np.array(corner), np.array(u), np.array(v)
        corners = np.array([first, first + along, first + along + up, first + up])
        pixels = camera.project(true_pose().transform(corners))
        pen.polygon([(float(x), float(y)) for x, y in pixels], fill=COLORS[name])
    noisy = np.asarray(page) + np.random.default_rng(2).normal(0.0, 3.0, (camera.height, camera.width, 1))
    return Image.fromarray(np.clip(noisy, 0.0, 255.0).astype(np.uint8))


def make_inputs(folder: Path, count: int, megapixels: float) -> Inputs:
    """Write the cloud, the image and the scene file."""
    camera = camera_of(megapixels)
    inputs = Inputs.of(folder)
    rp.io.write_ply(inputs.cloud, rp.Cloud(points_of(count)))
    picture_of(camera).save(inputs.image)
    regions = []
    for name, (corner, u, v) in PANELS.items():
        middle = np.array(corner) + 0.5 * np.array(u) + 0.5 * np.array(v)
        pixel = camera.project(true_pose().transform(middle[None]))[0]
        regions.append({"name": name, "image": {"seed": pixel.tolist()}, "world": {"seed": middle.tolist()}})
    size = {"width": camera.width, "height": camera.height}
    lens = {"model": "pinhole", "fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy}
    scene = {"camera": lens | size, "image": inputs.image.name, "cloud": inputs.cloud.name, "regions": regions}
    inputs.scene.write_text(to_yaml(scene), encoding="utf-8")
    matrix = [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0]
    sizes = {"image_width": camera.width, "image_height": camera.height}
    straight = {"distortion_model": "plumb_bob", "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5}}
    ros = sizes | {"camera_name": "camera", "camera_matrix": {"rows": 3, "cols": 3, "data": matrix}} | straight
    inputs.camera.write_text(to_yaml(ros), encoding="utf-8")
    return inputs


class Loaded:
    """The scene's cloud and image, each read when it is asked for, outside of the measurement."""

    def __init__(self, inputs: Inputs, megapixels: float) -> None:
        """Of the files and the size of the image."""
        self.inputs, self.camera, self.pose = inputs, camera_of(megapixels), true_pose()
        corner, u, v = (np.array(part) for part in PANELS["poster"])
        self.seed = corner + 0.5 * u + 0.5 * v
        self.pixel = self.camera.project(self.pose.transform(self.seed[None]))[0]

    def cloud(self) -> rp.Cloud:
        """The cloud."""
        return rp.read_cloud(self.inputs.cloud)

    def image(self) -> NDArray[np.uint8]:
        """The image (h, w, 3)."""
        return np.asarray(Image.open(self.inputs.image).convert("RGB"))

    def calibration(self, count: int = 1) -> Callable[[], object]:
        """What brings regions and edges of so many equal frames together: two panels are regions, the notice is not."""
        corners = [np.array(corner) for corner in (PANELS["poster"], PANELS["sign"])]
        shapes = [corner + np.array([0.0 * u, u, u + v, v]) for corner, u, v in corners]
        images = [rp.ImageRegion.from_polygon(self.camera.project(self.pose.transform(shape))) for shape in shapes]
        worlds = [rp.WorldRegion.from_polygon(shape) for shape in shapes]
        picture, points = self.image(), self.cloud().points
        corner, along, up = (np.array(part) for part in PANELS["notice"])
        # The notice is darker than its wall, for the scanner as for the camera.
        within = (np.abs(points - corner - 0.5 * (along + up)) < 0.5 * (along + up) + 5.0 * NOISE).all(axis=1)
        intensity = np.where(within, 0.2, 0.8)
        frame = rp.Frame(images, worlds, image=picture, points=points, intensity=intensity)
        return lambda: rp.calibrate(self.camera, [frame] * count)

    def shared(self) -> SharedSession:
        """The picking page's pictures of photo and cloud, once their files are read."""
        given = self.inputs
        path = given.scene.with_name("picked.yaml")
        # Without the estimate, which would begin beside what is measured.
        solver = {"edges": False}
        return SharedSession(
            Session.create(path, image=given.image, camera=given.camera, cloud=given.cloud, solver=solver)
        )

    def solid_click(self) -> Callable[[], object]:
        """What finds the point that the first click in the picking page's 3D view meets."""
        shared = self.shared()
        return partial(shared.point_on_ray, CENTER - shared.middle, self.seed - CENTER)

    def run(self) -> None:
        """Estimate the scene and write all its files."""
        out = self.inputs.scene.parent / "result"
        out.mkdir()
        run = estimate_scene(load_scene(self.inputs.scene))
        for name, write in bundle(run, Stages()).writers.items():
            write(out / name)


def stages(inputs: Inputs, megapixels: float) -> dict[str, Callable[[], Callable[[], object]]]:
    """What is measured: each entry reads what its action needs and returns the action."""
    held = Loaded(inputs, megapixels)

    def on_points(action: Callable[[Array], object]) -> Callable[[], Callable[[], object]]:
        return lambda: partial(action, held.cloud().points)

    def on_both(action: Callable[[Array, NDArray[np.uint8]], object]) -> Callable[[], Callable[[], object]]:
        return lambda: partial(action, held.cloud().points, held.image())

    def wall() -> Array:
        points: Array = held.cloud().points
        return np.asarray(points[np.abs(points[:, 1] - ROOM[1]) < 3.0 * NOISE])

    def on_patch(seed: Array, sensor_origin: Array | None) -> Callable[[], Callable[[], object]]:
        def grown() -> Callable[[], object]:
            points = held.cloud().points
            return partial(
                rp.WorldRegion.from_scan, points, rp.segment.grow_plane(points, seed), sensor_origin=sensor_origin
            )

        return grown

    camera, pose, beside = held.camera, held.pose, np.array([1.0, 8.0, 1.5])
    return {
        "read_cloud (PLY)": lambda: held.cloud,
        "read image (PNG)": lambda: held.image,
        "grow_image_region": lambda: partial(rp.segment.grow_image_region, held.image(), held.pixel),
        "grow_plane": on_points(lambda points: rp.segment.grow_plane(points, held.seed)),
        "find_planes": on_points(rp.segment.find_planes),
        "WorldRegion.from_scan (a panel)": on_patch(held.seed, CENTER),
        "WorldRegion.from_scan (no scanner)": on_patch(held.seed, None),
        "grow_plane (a wall)": on_points(lambda points: rp.segment.grow_plane(points, beside)),
        "WorldRegion.from_scan (a wall)": on_patch(beside, CENTER),
        "WorldRegion.from_points (a wall)": lambda: partial(rp.WorldRegion.from_points, wall()),
        "colorize": on_both(lambda points, picture: rp.colorize(camera, picture, points, pose)),
        "overlay_depth": on_both(lambda points, picture: rp.overlay_depth(camera, picture, points, pose)),
        "calibration": held.calibration,
        "pick: the first pictures": lambda: held.shared,
        "pick: the first click in 3D": held.solid_click,
        "write_ply": lambda: partial(rp.io.write_ply, inputs.cloud.with_name("written.ply"), held.cloud()),
        "regionpose estimate, all files": lambda: held.run,
    }


def memory(field: str) -> float:
    """Megabytes that this process holds (`VmRSS`) or held at the most (`VmHWM`), as Linux counts them."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return float(next(line.split()[1] for line in lines if line.startswith(field))) / 1024.0


def run_stage(inputs: Inputs, megapixels: float, name: str) -> None:
    """Run one stage in this process and print its figures."""
    action = stages(inputs, megapixels)[name]()
    Path("/proc/self/clear_refs").write_text("5")  # the peak counts from here
    before, start, cpu = memory("VmRSS"), time.perf_counter(), time.process_time()
    action()
    seconds, cpu, peak = time.perf_counter() - start, time.process_time() - cpu, memory("VmHWM")
    print(
        f"{name:34} {seconds:7.2f} s  {cpu:7.2f} s cpu  {peak - before:7.0f} MB beside  {peak:7.0f} MB in all",
        flush=True,
    )


def main() -> None:
    """Make the scene and run each stage on it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=5_000_000)
    parser.add_argument("--megapixels", type=float, default=24.0)
    parser.add_argument("--stages", nargs="+", help="names or beginnings of names")
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.folder:
        return run_stage(Inputs.of(arguments.folder), arguments.megapixels, arguments.stages[0])
    with tempfile.TemporaryDirectory() as temporary:
        inputs = make_inputs(Path(temporary), arguments.points, arguments.megapixels)
        for name in stages(inputs, arguments.megapixels):
            if arguments.stages is None or name.startswith(tuple(arguments.stages)):
                options = ["--folder", temporary, "--megapixels", str(arguments.megapixels), "--stages", name]
                subprocess.run([sys.executable, __file__, *options], check=False)
    return None


if __name__ == "__main__":
    main()
