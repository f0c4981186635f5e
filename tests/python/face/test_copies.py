"""What is public can be pickled and copied: it answers the same, and arrays that nobody can write to stay so."""

from __future__ import annotations

import copy
import inspect
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from public_names import PUBLIC
from regionpose.datasets.demo import demo_folder, load_demo
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from rig_frames import fisheye_frames
from scene_files import write_scene
from scipy.spatial.transform import Rotation

COPIES: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "oldest pickle": lambda value: pickle.loads(pickle.dumps(value, protocol=2)),
    "copy": copy.copy,
    "deep copy": copy.deepcopy,
}

UNMADE = {
    "Camera": "abstract",
    "Scene": "made by load_scene",
    "SparseSamplingWarning": "a kind of warning, which Python's own pickles",
    "CalibrationError": "an error, which Python's own pickles",
    "CloudError": "an error, which Python's own pickles",
    "FileError": "an error, which Python's own pickles",
    "SceneError": "an error, which Python's own pickles",
    "DemoRegion": "of load_demo",
    "DemoScene": "of load_demo",
    "PredictorSegmenter": "holds the object of another library",
}
"""Public classes without an object below, and why."""

CLASSES = {held for held in PUBLIC.values() if inspect.isclass(held)}


@cache
def public_objects() -> dict[str, list[Any]]:
    """Objects of all public classes, by the class's name: what estimates take and give, and what a few calls give."""
    with TemporaryDirectory() as place:
        scene = estimate_scene(load_scene(write_scene(Path(place))))
    with pytest.raises(rp.PoseError) as failed:
        raise rp.PoseError("no pose")
    found: dict[str, list[Any]] = {}
    for each in (*cameras(), scene, *estimates(), *regions(), *parts_of_results(), failed.value):
        for _, part in parts_of(each):
            if type(part) in CLASSES or part is scene:
                found.setdefault(type(part).__name__, []).append(part)
    return found


def demo_pose() -> rp.Pose:
    """The demo's true pose."""
    return rp.Pose(Rotation.from_matrix(load_demo().rotation), load_demo().translation)


def demo_regions() -> tuple[list[rp.ImageRegion], list[rp.WorldRegion]]:
    """Two of the demo's regions, exact on both sides."""
    demo, pose = load_demo(), demo_pose()
    rings = [region.rings for region in demo.regions[:2]]
    images = [rp.ImageRegion.from_polygon([demo.camera.project(pose @ ring) for ring in each]) for each in rings]
    return images, [rp.WorldRegion.from_polygon(each) for each in rings]


def estimates() -> list[Any]:
    """Estimates of every kind, and what they were made from."""
    demo, (camera, frames), (images, worlds) = load_demo(), fisheye_frames(0, 2), demo_regions()
    rig = rp.estimate_rig(camera, frames)
    return [
        rp.calibrate(demo.camera, [rp.Frame(images, worlds, image=demo.image, points=demo.points[::4])]),
        rp.Frame(image=demo.image, points=np.ascontiguousarray(demo.points[::20])),
        *(rig, rig.sigma, *frames),
        rp.match_regions(demo.camera, images, worlds),
        rp.Prior(camera_near=demo_pose().camera_center, camera_near_sigma_m=0.5),
        rp.Solver(),
    ]


def regions() -> list[Any]:
    """Regions of both sides of every kind, and clouds."""
    demo, (images, worlds) = load_demo(), demo_regions()
    members = demo.regions[0].point_indices[::4]
    return [
        *images,
        *worlds,
        rp.Cloud.from_points(
            demo.points[:9] + 1e5, fields={"ring": np.arange(9)}, intensity=np.ones(9), triangles=np.array([[0, 1, 2]])
        ),
        rp.read_cloud(demo_folder() / "cloud.ply"),
        rp.WorldRegion.from_points(demo.points[members]).with_viewpoint(np.zeros(3)),
        rp.ImageRegion.from_polygon([[10, 10], [110, 10], [110, 60], [10, 60]], hidden_edges=[1]),
        rp.ImageRegion.from_mask(np.pad(np.ones((20, 30)), 5)),
        rp.scene.ConfirmedRegions(
            (rp.scene.ConfirmedRegion("plane 1", images[0], worlds[0], members, 3.0, 0.5),), 2, 3.0
        ),
    ]


def parts_of_results() -> list[Any]:
    """Parts of results that no estimate here holds."""
    demo, pose = load_demo(), demo_pose()
    return [
        rp.fusion.PosedImage(demo.camera, np.zeros((4, 6), dtype=np.uint8), pose),
        rp.PoseStatus.CHECK,
        rp.PoseWarning(rp.WarningCode.AMBIGUOUS_REGION, (0,)),
        rp.solve.Alternative(pose, np.eye(6), 0.5, 0.5, 0.1, np.zeros(2)),
        rp.solve.SharedEdge((0, 1), np.zeros((2, 3))),
        rp.solve.CameraRefinement(
            demo.camera, pose, "refined", ("fx",), np.zeros(1), np.zeros(1), np.eye(7), (), (1.0, 0.5)
        ),
    ]


def cameras() -> list[Any]:
    """One of each model but the demo's."""
    return [
        rp.FisheyeCamera(300.0, 300.0, 320.0, 240.0, width=640, height=480),
        rp.cameras.UnifiedCamera(300.0, 300.0, 320.0, 240.0, xi=0.9, width=640, height=480),
        rp.cameras.OcamCamera((200.0, 0.0, -1e-3), (320.0, 240.0), width=640, height=480),
        rp.cameras.FovCamera(300.0, 300.0, 320.0, 240.0, omega=1.2, width=640, height=480),
        rp.cameras.EquirectangularCamera(width=1000, height=500),
    ]


def parts_of(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """A value and all that it holds, with their places."""
    yield place, value
    if isinstance(value, Mapping):
        held = {f"{place}[{key!r}]": item for key, item in value.items()}
    elif isinstance(value, tuple | list):
        held = {f"{place}[{index}]": item for index, item in enumerate(value)}
    elif isinstance(value, rp.WorldRegion):
        held = {f"{place}.{name}": getattr(value, name) for name in ("rings", "samples", "viewpoint", "area")}
        held[f"{place}.axes"], held[f"{place}.outline"] = value.core.axes, value.core.outline
    elif is_dataclass(value) or type(value).__module__.startswith("regionpose"):
        held = {f"{place}.{name}": item for name, item in getattr(value, "__dict__", {}).items()}
    else:
        return
    for inner, item in held.items():
        yield from parts_of(item, inner)


def arrays_of(value: Any) -> dict[str, NDArray[Any]]:
    """All arrays that a value holds, by their places."""
    return {place: part for place, part in parts_of(value) if isinstance(part, np.ndarray)}


def test_every_public_class_has_an_object_here() -> None:
    assert {each.__name__ for each in CLASSES} == {*public_objects(), *UNMADE} - {"SceneEstimate"}


@pytest.mark.parametrize("way", COPIES)
def test_copies_hold_the_same_and_are_locked_as_before(way: str) -> None:
    for name, objects in public_objects().items():
        for value in objects[:4]:
            other = COPIES[way](value)
            assert type(other) is type(value)
            before, after = arrays_of(value), arrays_of(other)
            assert before.keys() == after.keys(), name
            for place, array in before.items():
                assert np.array_equal(array, after[place], equal_nan=array.dtype.kind == "f"), (name, place)
                assert array.dtype == after[place].dtype, (name, place)
                assert array.flags.writeable == after[place].flags.writeable, (name, place)
            scalars = [{p: v for p, v in parts_of(each) if isinstance(v, str | int | float)} for each in (value, other)]
            np.testing.assert_equal(scalars[0], scalars[1])


def test_fields_of_a_copied_cloud_can_t_be_changed() -> None:
    for cloud in public_objects()["Cloud"]:
        for copied in COPIES.values():
            assert isinstance(copied(cloud).fields, MappingProxyType)


@pytest.mark.parametrize("way", COPIES)
def test_sampled_regions_give_the_same_answer_after_copying(way: str) -> None:
    demo = load_demo()
    pose = rp.Pose(Rotation.from_matrix(demo.rotation), demo.translation)
    worlds = [
        rp.WorldRegion.from_scan(demo.points, region.point_indices, sensor_origin=np.zeros(3))
        for region in demo.regions[:3]
    ]
    images = [rp.ImageRegion.from_polygon(demo.camera.project(pose @ region.rings[0])) for region in demo.regions[:3]]
    assert any(world.samples is not None for world in worlds)
    first = rp.estimate_pose(demo.camera, images, worlds)
    second = rp.estimate_pose(*COPIES[way]((demo.camera, images, worlds)))
    assert first.pose.matrix.tobytes() == second.pose.matrix.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


def test_a_region_keeps_its_own_of_what_it_was_made_from() -> None:
    ring = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    viewpoint = np.array([0.0, 0.0, 1.0])
    region = rp.WorldRegion.from_polygon(ring).with_viewpoint(viewpoint)
    ring[:], viewpoint[:] = 9.0, -1.0
    assert COPIES["pickle"](region).viewpoint.tolist() == [0.0, 0.0, 1.0]
    assert COPIES["pickle"](region).area == 2.0
