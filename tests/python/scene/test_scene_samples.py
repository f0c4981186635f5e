"""Regions of scene files by what their scan knows of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose.io.clouds import Cloud, write_ply
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.exposure import scene_sides
from regionpose.scene.loading import load_scene
from regionpose.scene.region_sides import WorldSide
from regionpose.scene.result import scene_result
from scene_files import PLATES, POSE, scene_values, write_scene

from benchmarks.synthetic.lidar import lidar_scan

SCANNER = POSE.camera_center + POSE.rotation.inv().apply([0.0, -0.5, 0.0])
"""Near the camera, as on a vehicle, and off the axes, so that beams see the plates from elsewhere than the camera."""


def scanned(folder: Path, world: dict[str, dict[str, Any]] | None = None, **keys: object) -> Path:
    """A scene file of the two plates in one turn of a lidar, each by the indices of its returns or by `world`."""
    scan = lidar_scan([[plate] for plate in PLATES.values()], SCANNER, np.random.default_rng(1))
    write_ply(folder / "cloud.ply", Cloud(scan.points), overwrite=True)
    np.save(folder / "labels.npy", scan.regions)
    np.save(folder / "part.npy", scan.points[scan.regions == 0])
    values = {**scene_values(), "cloud": "cloud.ply", **keys}
    for label, region in enumerate(values["regions"]):
        region["world"] = (world or {}).get(region["name"], {"points": "labels.npy", "label": label})
    values["regions"] = [region for region in values["regions"] if world is None or region["name"] in world]
    return write_scene(folder, values)


def first_side(folder: Path, world: dict[str, Any], **keys: object) -> WorldSide:
    """The world side of the first plate."""
    return scene_sides(load_scene(scanned(folder, {"floor": world}, **keys))).world_sides[0]


def seed_on(plate: NDArray[np.float64]) -> list[float]:
    middle: list[float] = (plate[0] + 0.2 * (plate[1] - plate[0]) + 0.2 * (plate[5] - plate[0])).tolist()
    return middle


def test_samples_of_a_scan_give_the_pose_and_are_said(tmp_path: Path) -> None:
    run = estimate_scene(load_scene(scanned(tmp_path, sensor_origin=SCANNER.tolist())))
    assert np.degrees((run.estimate.pose.rotation * POSE.rotation.inv()).magnitude()) < 1.0
    assert np.linalg.norm(run.estimate.pose.camera_center - POSE.camera_center) < 0.08
    for side, region in zip(run.sides.world_sides, scene_result(run)["diagnostics"]["regions"], strict=True):
        assert side.region.samples is not None
        inside, outside = map(len, side.region.samples)
        assert region["boundary_source"] == f"samples: {inside} inside, {outside} outside"


@pytest.mark.parametrize(
    "world", [{"points": "labels.npy", "label": 0}, {"points": "part.npy"}, {"seed": seed_on(PLATES["floor"])}], ids=str
)
def test_labels_places_and_clicks_are_the_same_returns(world: dict[str, Any], tmp_path: Path) -> None:
    side = first_side(tmp_path, world, sensor_origin=SCANNER.tolist())
    labels = np.load(tmp_path / "labels.npy")
    assert side.region.samples is not None and side.indices is not None and side.outline_because is None
    # A click leaves out returns beyond three standard deviations of the noise.
    assert len(np.setxor1d(side.indices, np.flatnonzero(labels == 0))) <= 0.01 * len(side.indices)


@pytest.mark.parametrize(
    ("world", "keys", "why"),
    [
        ({"polygon": PLATES["floor"].tolist()}, {}, "it is given as a polygon"),
        ({"points": "labels.npy", "label": 0, "radius_m": 0.2}, {}, "its radius_m is given"),
        ({"points": "labels.npy", "label": 0}, {"sensor_origin": None}, "sensor_origin is missing, and no points"),
        ({"points": "moved.npy"}, {}, "its points aren't the cloud's"),
    ],
)
def test_an_outline_says_why_it_is_one(
    world: dict[str, Any], keys: dict[str, object], why: str, tmp_path: Path
) -> None:
    np.save(tmp_path / "moved.npy", PLATES["floor"][[0, 1, 3, 4]] + 0.01)
    side = first_side(tmp_path, world, **{"sensor_origin": SCANNER.tolist(), **keys})
    assert side.region.samples is None
    assert side.outline_because is not None and side.outline_because.startswith(why)


def test_neighbors_on_the_plane_serve_without_the_scanner(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(-2.0, 2.0, 0.02), np.arange(-1.5, 1.5, 0.02))
    wall = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)])
    np.savetxt(tmp_path / "wall.xyz", wall)
    np.save(tmp_path / "poster.npy", np.flatnonzero((np.abs(wall[:, :2]) < [0.505, 0.405]).all(axis=1)))
    for extends, known in ((False, True), (True, False)):
        world = {"points": "poster.npy", "extends": extends}
        side = first_side(tmp_path, world, cloud="wall.xyz")
        assert (side.region.samples is not None) is known


def test_map_coordinates_lose_no_sample(tmp_path: Path) -> None:
    path = scanned(tmp_path, sensor_origin=SCANNER.tolist())
    near = scene_sides(load_scene(path)).world_sides[0].region.samples
    shift = np.array([512_345.25, 5_405_678.5, 240.0])
    scan = lidar_scan([[plate] for plate in PLATES.values()], SCANNER, np.random.default_rng(1))
    np.savetxt(tmp_path / "far.xyz", scan.points + shift, fmt="%.9f")
    values = {"cloud": "far.xyz", "sensor_origin": (SCANNER + shift).tolist()}
    far = scene_sides(load_scene(scanned(tmp_path, **values)))
    samples = far.world_sides[0].region.samples
    assert near is not None and samples is not None and np.abs(far.origin).max() > 1e5
    for here, there in zip(near, samples, strict=True):
        np.testing.assert_allclose(there + far.origin - shift, here, atol=1e-4)


def test_segmented_regions_keep_their_options(tmp_path: Path) -> None:
    from regionpose.cli.segment import _scene_writers

    world = {"points": "labels.npy", "label": 0, "viewpoint": SCANNER.tolist(), "radius_m": 0.2}
    scene = load_scene(scanned(tmp_path, {"floor": world}, sensor_origin=SCANNER.tolist()))
    writers = _scene_writers(scene, scene_sides(scene), tmp_path / "out")
    writers["scene.yaml"](tmp_path / "again.yaml")
    text = (tmp_path / "again.yaml").read_text(encoding="utf-8")
    assert "radius_m: 0.2" in text and "viewpoint" in text
