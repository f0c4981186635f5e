"""None, and other things that are no camera, pose, region or frame: every public function names the argument."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, POSE
from public_names import PUBLIC
from regionpose.scene.loading import Scene
from regionpose.validation.arguments import checked_arguments

PHOTO = np.full((480, 640, 3), 90, dtype=np.uint8)
SIGN = np.array([[0.0, 0.0, 4.0], [0.8, 0.0, 4.0], [0.8, 0.4, 4.0], [0.4, 0.4, 4.0], [0.4, 1.0, 4.0], [0.0, 1.0, 4.0]])
POINTS = POSE.inverse().transform(SIGN)
IMAGE, WORLD = rp.ImageRegion.from_polygon(CAMERA.project(SIGN)), rp.WorldRegion.from_polygon(POINTS)
FRAME = rp.Frame([IMAGE], [WORLD], image=PHOTO, points=POINTS)

OWN = ("Camera", "Pose", "ImageRegion", "WorldRegion", "Frame", "Cloud", "Scene", "Prior", "Solver")
ASKED = re.compile(rf"(Sequence\[)?({'|'.join(OWN)})(?(1)\])( \| None)?")
"""A hint that asks for one of the package's classes, or for a list of them, and for nothing else but None."""

GIVEN: dict[str, Any] = {
    "camera": CAMERA,
    "cloud": rp.Cloud.from_points(POINTS),
    "covariance": 1e-6 * np.eye(6),
    "frame": FRAME,
    "frames": [FRAME],
    "image": PHOTO,
    "image_regions": [IMAGE],
    "image_shape": (480, 640),
    "initial": POSE,
    "other": POSE,
    "path": "cloud.ply",
    "points": POINTS,
    "pose": POSE,
    "regions": [IMAGE],
    "scene": [FRAME],
    "world_regions": [WORLD],
}

GIVEN_TO: dict[str, dict[str, Any]] = {
    "io.write_pose": {"folder": "out", "tool": "opencv"},
    "fusion.colored_cloud": {"views": []},
}
"""What a function is given instead under names that mean something else elsewhere."""

OBJECTS: dict[type, object] = {
    rp.ImageRegion: IMAGE,
    rp.Pose: POSE,
    rp.Prior: rp.Prior(),
    rp.Frame: FRAME,
}

ELSEWHERE = {"estimate_poses"}
"""What checks its arguments in a test of its own: test_solver.py."""


def public() -> Iterator[tuple[str, Callable[..., object]]]:
    """The public functions and methods, and the classes that users make."""
    for name, held in PUBLIC.items():
        if inspect.isfunction(held):
            yield name, held
        elif inspect.isclass(held) and held in OBJECTS:
            yield name, held
            methods = inspect.getmembers(OBJECTS[held], inspect.ismethod)
            yield from ((f"{name}.{method}", bound) for method, bound in methods if not method.startswith("_"))


def asked() -> Iterator[tuple[str, Callable[..., object], str, bool, bool]]:
    """Each public parameter that asks for an object of the package, whether for a list of such, and for None."""
    for name, function in public():
        for parameter in inspect.signature(function).parameters.values():
            hint = ASKED.fullmatch(str(parameter.annotation))
            if hint is not None and name not in ELSEWHERE:
                yield name, function, parameter.name, hint[1] is not None, hint[3] is not None


CASES = list(asked())


@pytest.mark.parametrize("case", CASES, ids=[f"{name}-{parameter}" for name, _, parameter, _, _ in CASES])
def test_an_argument_of_another_kind_is_named(
    case: tuple[str, Callable[..., object], str, bool, bool], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, function, parameter, is_list, or_none = case
    monkeypatch.chdir(tmp_path)
    given = GIVEN | GIVEN_TO.get(name, {})
    needed = {
        each.name: given[each.name]
        for each in inspect.signature(function).parameters.values()
        if each.default is inspect.Parameter.empty
    }
    wrong: list[object] = [5, *([] if or_none else [None]), *([[None], [IMAGE, "wall"]] if is_list else [])]
    for value in wrong:
        with pytest.raises(ValueError, match=rf"^{parameter}(\[[01]\])? is a .*; needed a "):
            function(**{**needed, parameter: value})


def test_all_that_users_give_is_looked_at() -> None:
    names = {name for name, *_ in CASES}
    assert {"estimate_pose", "estimate_rig", "colorize", "check_alignment", "Pose.local_coordinates"} <= names
    assert {"ImageRegion.bearings", "Frame", "io.write_ply", "estimate_scene"} <= names
    assert len(CASES) >= 40


@pytest.mark.parametrize(
    ("view", "said"),
    [
        (None, r"view 0 is a NoneType; needed a tuple \(camera, image, pose\)"),
        ((CAMERA, PHOTO), "view 0 is a tuple; needed a tuple"),
        ((None, PHOTO, POSE), "camera of view 0 is a NoneType; needed a Camera"),
        ((CAMERA, PHOTO, np.eye(4)), "pose of view 0 is a ndarray; needed a Pose"),
    ],
)
def test_a_view_of_other_parts_is_named(view: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        rp.fusion.blend_colors([view], POINTS)
    with pytest.raises(ValueError, match="views is a NoneType; needed a list"):
        rp.fusion.blend_colors(None, POINTS)  # type: ignore[arg-type]


@checked_arguments
def _taken(pose: rp.Pose | None, regions: Any = (), *, scene: Scene | None = None) -> object:
    return pose, regions, scene


def test_what_hints_allow_is_passed_on() -> None:
    regions = iter([1])
    assert _taken(None, regions) == (None, regions, None) and list(regions) == [1]
    assert _taken(pose=POSE) == (POSE, (), None)
    with pytest.raises(ValueError, match=r"^pose is a str; needed a Pose or None$"):
        _taken("north")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"^scene is a int; needed a Scene or None$"):
        _taken(POSE, scene=4)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="missing"):
        _taken()  # type: ignore[call-arg]
