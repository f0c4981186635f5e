"""The package's face: what is exported, what it costs to import, and that objects are what they say."""

from __future__ import annotations

import inspect
import pickle
import re
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from public_names import MODULES, PUBLIC
from regionpose import _core
from scipy.spatial.transform import Rotation

UTM = np.array([432_000.0, 5_400_000.0, 120.0])
SQUARE = np.array([[100.0, 100.0], [300.0, 110.0], [290.0, 300.0], [110.0, 280.0]])
PLATE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.7, 0.0], [0.4, 0.7, 0.0], [0.4, 1.0, 0.0], [0.0, 1.0, 0.0]])
CAMERA = rp.PinholeCamera(800.0, 800.0, 320.0, 240.0, width=640, height=480)
POSE = rp.Pose(Rotation.from_rotvec([0.4, -0.3, 0.1]), np.array([-0.4, -0.4, 3.0]))


def test_points_of_a_cloud_are_the_worlds() -> None:
    world = np.random.default_rng(0).uniform(-5.0, 5.0, (50, 3)) + UTM
    cloud = rp.Cloud.from_points(world).scanned_from(UTM)
    assert cloud.origin.any() and np.abs(cloud.points - world).max() < 1e-9
    assert cloud.points is cloud.points and not cloud.points.flags.writeable
    np.testing.assert_array_equal(cloud.sensor_origin, UTM)


def test_regions_of_a_cloud_in_map_coordinates_give_the_pose_there() -> None:
    rows, columns = np.meshgrid(np.arange(0.0, 1.0, 0.01), np.arange(0.0, 0.8, 0.01))
    cloud = rp.Cloud.from_points(np.stack([rows, columns, np.zeros_like(rows)], axis=-1).reshape(-1, 3) + UTM)
    image = rp.ImageRegion.from_polygon(CAMERA.project(POSE @ WIDE))
    given = rp.Prior(initial=POSE.rebase(-UTM))
    estimate = rp.estimate_pose(CAMERA, [image], [rp.WorldRegion.from_points(cloud.points)], prior=given)
    assert np.abs(estimate.pose.camera_center - POSE.camera_center - UTM).max() < 0.05


WIDE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.8, 0.0], [0.0, 0.8, 0.0]]) - np.array([0.005, 0.005, 0.0])


def test_a_region_made_by_hand_is_checked() -> None:
    with pytest.raises(ValueError, match="ring 0"):
        rp.ImageRegion((np.zeros((3, 2)),))
    with pytest.raises(ValueError, match="crosses"):
        rp.ImageRegion((SQUARE[[0, 2, 1, 3]],))
    with pytest.raises(ValueError, match="hidden has other shapes"):
        rp.ImageRegion((SQUARE,), hidden=(np.zeros(3, dtype=np.bool_),))
    turned = rp.ImageRegion((SQUARE[::-1],), hidden=(np.array([True, False, False, False]),))
    assert turned.area == rp.ImageRegion.from_polygon(SQUARE).area > 0.0 and turned.hidden is not None
    edge = int(np.flatnonzero(turned.hidden[0])[0])
    ends = {tuple(turned.rings[0][k % 4]) for k in (edge, edge + 1)}
    assert ends == {tuple(SQUARE[3]), tuple(SQUARE[2])}


def test_arrays_of_frozen_objects_are_read_only_and_the_givers_are_not() -> None:
    mine, image = np.zeros(3), rp.ImageRegion.from_polygon(SQUARE)
    estimate = rp.estimate_pose(CAMERA, [rp.ImageRegion.from_polygon(CAMERA.project(POSE @ PLATE))], [world()])
    masked = rp.ImageRegion.from_mask(np.pad(np.ones((5, 5), dtype=np.bool_), 3))
    assert masked.mask is not None
    held = [
        rp.Pose(Rotation.identity(), mine).translation,
        image.rings[0],
        masked.mask.coverage,
        estimate.covariance,
        estimate.diagnostics.region_overlap_errors,
        estimate.pose.translation,
        estimate.pose.rotation_matrix,
    ]
    for array in held:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 99.0
    mine[0] = 1.0


def world() -> rp.WorldRegion:
    return rp.WorldRegion.from_polygon(PLATE)


def test_what_objects_say_of_themselves() -> None:
    assert repr(world()) == "WorldRegion(area=0.82, vertices=6)"
    image = rp.ImageRegion.from_polygon(SQUARE, hidden_edges=[1])
    assert repr(image).startswith("ImageRegion(area=") and "4, polygon, 1 hidden edges)" in repr(image)
    cameras = [
        CAMERA,
        rp.FisheyeCamera(300.0, 301.0, 1.0, 2.0, distortion=(0.1, 0.0, 0.0, 0.0)),
        rp.cameras.UnifiedCamera(300.0, 301.0, 1.0, 2.0, xi=0.9),
        rp.cameras.OcamCamera((300.0, 0.0, -1e-3), (1.0, 2.0)),
    ]
    for camera in cameras:
        assert eval(repr(camera), vars(rp.cameras)) == camera


@pytest.mark.parametrize("position", ["width", "distortion"])
def test_cameras_take_by_keyword_what_follows_the_center(position: str) -> None:
    fifth: Any = {"width": 640, "distortion": (0.0,) * 4}[position]
    for kind in (rp.PinholeCamera, rp.FisheyeCamera):
        with pytest.raises(TypeError, match="positional"):
            kind(1.0, 1.0, 0.0, 0.0, fifth)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("model", "params"),
    [
        ("PINHOLE", [500.0, 501.0, 320.0, 240.0]),
        ("OPENCV", [500.0, 501.0, 320.0, 240.0, -0.1, 0.02, 1e-3, -2e-3]),
        ("FULL_OPENCV", [500.0, 501.0, 320.0, 240.0, -0.1, 0.02, 1e-3, -2e-3, 0.1, 0.01, 0.02, 0.03]),
        ("OPENCV_FISHEYE", [500.0, 501.0, 320.0, 240.0, -0.1, 0.02, 1e-3, -2e-3]),
    ],
)
def test_colmap_and_back(model: str, params: list[float]) -> None:
    assert rp.cameras.camera_to_colmap(rp.cameras.camera_from_colmap(model, 640, 480, params)) == (
        model,
        640,
        480,
        params,
    )


def test_what_colmap_has_not_is_named() -> None:
    with pytest.raises(ValueError, match="model: found 'THIN_PRISM'; needed one of SIMPLE_PINHOLE"):
        rp.cameras.camera_from_colmap("THIN_PRISM", 640, 480, [])
    with pytest.raises(ValueError, match="params: found 3 numbers; needed 4 for PINHOLE"):
        rp.cameras.camera_from_colmap("PINHOLE", 640, 480, [1.0, 1.0, 1.0])
    with pytest.raises(ValueError, match="found a UnifiedCamera; needed a pinhole or a fisheye"):
        rp.cameras.camera_to_colmap(rp.cameras.UnifiedCamera(1.0, 1.0, 0.0, 0.0, xi=1.0))


def test_poses_are_composed_and_taken_back() -> None:
    other = rp.Pose.from_quat([0.1, -0.5, 0.5, 0.7], [1.0, 2.0, -3.0])
    np.testing.assert_allclose((POSE @ other).matrix, POSE.matrix @ other.matrix, atol=1e-15)
    np.testing.assert_allclose(POSE @ (other @ PLATE), (POSE @ other) @ PLATE, atol=1e-14)
    np.testing.assert_allclose(other.rotation_matrix, other.rotation.as_matrix(), atol=1e-15)
    np.testing.assert_allclose((POSE @ POSE.inverse()).matrix, np.eye(4), atol=1e-14)
    np.testing.assert_allclose(POSE.rebase(UTM) @ (PLATE - UTM), POSE @ PLATE, atol=1e-8)
    turn, shift = np.split(POSE.local_coordinates(other), 2)
    moved = _core.retract_pose(POSE.rotation_matrix, POSE.translation, np.concatenate([turn, shift]))
    np.testing.assert_allclose(moved[0], other.rotation_matrix, atol=1e-14)
    np.testing.assert_allclose(moved[1], other.translation, atol=1e-14)
    with pytest.raises(ValueError, match="quaternion has norm 2; needed 1"):
        rp.Pose.from_quat([0.0, 0.0, 0.0, 2.0], [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(other)).matrix, other.matrix)


def test_poses_to_scipys_transforms_and_back() -> None:
    transforms = pytest.importorskip("scipy.spatial.transform", reason="scipy 1.16 has RigidTransform")
    if not hasattr(transforms, "RigidTransform"):
        pytest.skip("this scipy has no RigidTransform")
    np.testing.assert_allclose(POSE.as_rigid_transform().as_matrix(), POSE.matrix, atol=1e-15)
    back = rp.Pose.from_rigid_transform(POSE.as_rigid_transform())
    np.testing.assert_allclose(back.matrix, POSE.matrix, atol=1e-15)


@pytest.mark.parametrize(
    "solver",
    [
        rp.Solver(system="sphere"),
        rp.Solver(integration="mesh", mesh_size=0.3),
        rp.Solver(start="paper", refine=None),
        rp.Solver(driver="native"),
    ],
)
def test_one_solver_is_the_same_alone_in_a_batch_in_a_matching_and_in_a_rig(solver: rp.Solver) -> None:
    images, worlds = [rp.ImageRegion.from_polygon(CAMERA.project(POSE @ PLATE))], [world()]
    prior = rp.Prior(initial=POSE)
    alone = rp.estimate_pose(CAMERA, images, worlds, prior=prior, solver=solver)
    (batched,) = rp.estimate_poses([(CAMERA, images, worlds)], prior=prior, solver=solver)
    matched = rp.match_regions(CAMERA, images, worlds, prior=prior, solver=solver).estimate
    rig = rp.estimate_rig(CAMERA, [rp.Frame(images, worlds)], prior=prior, solver=solver)
    assert isinstance(batched, rp.PoseEstimate)
    for pose in (batched.pose, matched.pose, rig.pose):
        np.testing.assert_allclose(pose.matrix, alone.pose.matrix, atol=1e-6)
    assert rig.status == alone.status and rig.confidence == pytest.approx(alone.confidence, abs=1e-3)


def test_many_poses_at_once_are_native() -> None:
    with pytest.raises(ValueError, match='driver is "scipy"; needed "native" for'):
        rp.estimate_poses([], solver=rp.Solver(driver="scipy"))
    with pytest.raises(ValueError, match="solver is a str; needed a Solver or None"):
        rp.estimate_pose(CAMERA, [], [], solver="native")  # type: ignore[arg-type]


def test_overlap_errors_know_the_images_border() -> None:
    """A region that the border cuts differs by nothing at the true pose."""
    far = rp.Pose(POSE.rotation, POSE.translation + np.array([1.1, 0.0, 0.0]))
    seen = CAMERA.project(far @ PLATE)
    assert seen[:, 0].max() > 640.0 > seen[:, 0].min()
    from skimage.draw import polygon2mask

    mask = polygon2mask((480, 640), seen[:, ::-1])  # type: ignore[no-untyped-call]
    whole, each = rp.solve.overlap_errors(CAMERA, [rp.ImageRegion.from_mask(mask)], [world()], far)
    assert whole == each[0] < 0.02


def test_warnings_of_sparse_samples_point_at_the_callers_line() -> None:
    rows = np.stack(np.meshgrid(np.arange(0.0, 1.0, 0.02), np.arange(3) * 0.3), axis=-1).reshape(-1, 2)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        rp.WorldRegion.from_points(np.column_stack([rows, np.zeros(len(rows))]))
    assert {warning.category for warning in caught} == {rp.regions.SparseSamplingWarning}
    assert {Path(warning.filename).name for warning in caught} == {Path(__file__).name}


def test_warnings_carry_their_regions_and_values() -> None:
    images = [rp.ImageRegion.from_polygon(ring) for ring in (SQUARE, SQUARE + 200.0, SQUARE + 1.0)]
    (warning,) = rp.scene.check_regions(images, [])
    assert (warning.code, warning.regions) == ("duplicate-regions", (0, 2))
    assert warning.values["side"] == "image" and warning.values["fraction"] == pytest.approx(0.95, abs=0.05)


def test_the_document_lists_the_public_names() -> None:
    """Names in docs/reference/api.md, each of which gets its page; and nothing else is handed out."""
    document = (Path(__file__).resolve().parents[3] / "docs" / "reference" / "api.md").read_text(encoding="utf-8")
    blocks = re.findall(r"currentmodule:: regionpose\.?(\w*)\n(.*?)```", document, re.DOTALL)
    listed = {module: re.findall(r"^   (\w+)$", text, re.MULTILINE) for module, text in blocks}
    # A name of the package has its page there alone.
    expected = {module: [*{*getattr(rp, module).__all__} - {*rp.__all__}] for module in MODULES}
    expected[""] = [name for name in rp.__all__ if name not in (*MODULES, "__version__")]
    assert {name: sorted(names) for name, names in listed.items()} == {n: sorted(all_) for n, all_ in expected.items()}
    assert {*dir(rp), "__version__"} == set(rp.__all__)


HEAVY = (
    "scipy",
    "shapely",
    "skimage",
    "pydantic",
    "PIL",
    "ruamel",
    "jinja2",
    "typer",
    "rich",
    "matplotlib",
    "regionpose.scene",
)


@pytest.mark.parametrize(
    ("code", "left_out"),
    [
        ("import regionpose", (*HEAVY, "numpy")),
        ("import regionpose as rp; rp.PinholeCamera(1.0, 1.0, 0.0, 0.0); rp.Pose; rp.Prior; rp.Solver", HEAVY),
        (
            "import numpy as np, regionpose as rp\n"
            "c = rp.PinholeCamera(800.0, 800.0, 320.0, 240.0)\n"
            "p = np.array([[0, 0, 4], [1, 0, 4.0], [1, 0.3, 4], [0.3, 0.3, 4], [0.3, 1, 4], [0, 1, 4]])\n"
            "r = rp.ImageRegion.from_polygon(c.project(p)), rp.WorldRegion.from_polygon(p)\n"
            "assert rp.estimate_pose(c, [r[0]], [r[1]], solver=rp.Solver(driver='native')).pose.matrix is not None",
            HEAVY,
        ),
    ],
)
def test_what_is_heavy_is_imported_when_it_is_used(code: str, left_out: tuple[str, ...]) -> None:
    said = f"{code}\nimport sys\nprint(*(name for name in {left_out!r} if name in sys.modules))"
    run = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert run.stdout.split() == []


UNITLESS = {
    "fx fy cx cy distortion": "intrinsics, as every calibration file names them",
    "xi omega polynomial center stretch ss cde": "camera models' own coefficients",
    "tolerance": "differences of colors",
    "column": "a coordinate of pixels",
    "depth_tolerance mesh_size overlap_error": "fractions",
    "outlier_fraction edge_fraction hidden_fraction min_area_fraction": "fractions by name",
    "factor": "of focal lengths",
    "confidence mode_probability log_odds edge_log_odds sigmas": "probabilities and their like",
    "log_odds_over_next log_mass log_ratio": "logarithms of odds",
    "values": "of a warning, each with its unit in its key",
}
"""Names of numbers without a unit, and what they are."""


def _numbers_of(public: object) -> list[str]:
    """Parameters and fields of a public name, and parameters of its methods, that are floats."""
    callables = [public]
    if isinstance(public, type):
        callables += [value for name, value in inspect.getmembers(public, callable) if not name.startswith("_")]
    found = []
    for item in callables:
        try:
            parameters = inspect.signature(item).parameters.values()  # type: ignore[arg-type]
        except ValueError:
            continue
        found += [each.name for each in parameters if re.search(r"\bfloat\b", str(each.annotation))]
    return found


@pytest.mark.parametrize("name", PUBLIC)
def test_numbers_with_a_unit_say_it_in_their_names(name: str) -> None:
    known = set(" ".join(UNITLESS).split())
    assert [
        each
        for each in _numbers_of(PUBLIC[name])
        if not re.search(r"_(m|px|deg|rad|percent)$", each) and each not in known
    ] == []
