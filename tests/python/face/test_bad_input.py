"""Bad input: a ValueError that says which item, what was found and what is needed; never a panic, a hang or silence."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from regionpose import _core, kernels

from benchmarks.synthetic import load_templates

SAMPLES = Path(__file__).parents[1] / "samples"
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
MARKS = np.zeros(4, dtype=np.bool_)
LIFTED = np.column_stack([SQUARE, np.ones(4)])
BOW_TIE = SQUARE[[0, 2, 1, 3]]
CAMERA = rp.PinholeCamera(500.0, 500.0, 320.0, 240.0, width=640, height=480)
IMAGE = rp.ImageRegion.from_polygon(SQUARE * 100.0 + 200.0)
WORLD = rp.WorldRegion.from_polygon(LIFTED)
POSE = rp.Pose.from_matrix(np.eye(4))
UP = (0.0, -1.0, 0.0)
MASK = np.zeros((480, 640), dtype=bool)
MASK[100:200, 150:300] = True


def with_value(array: np.ndarray, value: float) -> np.ndarray:
    """The array with its entry [2, 1] replaced."""
    changed = array.copy()
    changed[2, 1] = value
    return changed


IMAGE_RING: Callable[[Any], object] = rp.ImageRegion.from_polygon
WORLD_RING: Callable[[Any], object] = rp.WorldRegion.from_polygon
POINTS: Callable[[Any], object] = rp.WorldRegion.from_points
FROM_MASK: Callable[[Any], object] = rp.ImageRegion.from_mask


class Mesh:
    """What `from_mesh` reads."""

    def __init__(self, vertices: object, faces: object) -> None:
        self.vertices: Any = vertices
        self.faces: Any = faces


def solve(prior: Any = None, **options: Any) -> object:
    """A pose of one square with these options."""
    return rp.estimate_pose(CAMERA, [IMAGE], [WORLD], prior=prior, solver=rp.Solver(**options))


def bordered(line: np.ndarray) -> object:
    """The problem of one square beside a line of the image's border, bearings (n, 3)."""
    observed = _core.ObservedRegion([LIFTED], 1e4, borders=[line])
    return _core.Problem([observed], [WORLD.core], system="plane", integration="boundary")


RINGS: list[tuple[Callable[[], object], str]] = [
    (lambda: IMAGE_RING([with_value(SQUARE, np.nan)]), "ring 0 vertex 2 is not finite: NaN; coordinates need to be"),
    (lambda: IMAGE_RING([SQUARE, with_value(SQUARE, np.inf)]), "ring 1 vertex 2 is not finite: inf"),
    (lambda: WORLD_RING([with_value(LIFTED, -np.inf)]), "ring 0 vertex 2 is not finite: -inf"),
    (lambda: IMAGE_RING([SQUARE[:2]]), "ring 0 has 2 distinct vertices; a region ring needs at least 3"),
    (lambda: IMAGE_RING([SQUARE[[0, 1, 0, 1]]]), "ring 0 has 2 distinct vertices"),
    (lambda: WORLD_RING([LIFTED[:2]]), "ring 0 has 2 distinct vertices; a region ring needs at least 3"),
    (lambda: IMAGE_RING([BOW_TIE]), r"edge \d of ring 0 crosses edge \d of ring 0; a ring needs to be simple"),
    (lambda: WORLD_RING([LIFTED[[0, 2, 1, 3]]]), r"edge \d of ring 0 crosses edge \d of ring 0"),
    (lambda: IMAGE_RING([SQUARE[[0, 2, 0, 2]]]), "ring 0 has 2 distinct vertices"),
    (lambda: IMAGE_RING([[[0, 0], [1, 1], [2, 2]]]), "ring 0 (overlaps|has area 0)|edge 0 of ring 0 overlaps"),
    (lambda: WORLD_RING([[[0, 0, 0], [1, 1, 1], [2, 2, 2]]]), "3 points that are identical or on one line; it needs"),
    (lambda: WORLD_RING([np.ones((4, 3))]), "4 points that are identical or on one line"),
    (
        lambda: IMAGE_RING([SQUARE, SQUARE + 5.0]),
        "ring 1 is a hole outside every outer ring; a hole needs to lie inside",
    ),
    (lambda: WORLD_RING([LIFTED, LIFTED + np.array([5.0, 0.0, 0.0])]), "ring 1 is a hole outside"),
    (lambda: IMAGE_RING([SQUARE, SQUARE + 0.5]), r"edge \d of ring 0 crosses edge \d of ring 1"),
    (lambda: IMAGE_RING([SQUARE * 9, SQUARE * 5 + 1, SQUARE + 2]), "ring 2 lies inside the hole ring 1"),
    (
        lambda: WORLD_RING([LIFTED * [1, 1, 0] + [[0, 0, 1], [0, 0, 0], [0, 0, 1], [0, 0, 0]]]),
        "ring 0 leaves the region's",
    ),
    (lambda: IMAGE_RING([]), r"rings is empty; needed at least one \(n, 2\) array"),
    (lambda: WORLD_RING([SQUARE]), r"ring 0 has shape \(4, 2\); needed \(n, 3\)"),
    (lambda: IMAGE_RING([SQUARE, None]), r"ring 1 has type object; needed real numbers \(n, 2\)"),
    (lambda: IMAGE_RING([[["0", "1"], ["1", "1"], ["1", "0"]]]), "ring 0 has type <U1; needed real numbers"),
    (lambda: IMAGE_RING([SQUARE * 1j]), "ring 0 has type complex128; needed real numbers"),
    (lambda: IMAGE_RING([[[1, 2], [3]]]), r"ring 0 has rows of unequal length; needed \(n, 2\)"),
    (lambda: IMAGE_RING(None), "rings is a NoneType; needed a list"),
    (lambda: IMAGE_RING("square"), "rings is a str; needed a list"),
    (lambda: IMAGE_RING({0: SQUARE}), "rings is a dict; needed a list"),
    (lambda: IMAGE_RING(3.5), "rings is a float; needed a list"),
    (lambda: IMAGE_RING(np.array(3.5)), "rings is a ndarray; needed a list"),
    (lambda: kernels.planar_moments([BOW_TIE], 2), r"edge \d of ring 0 crosses"),
    (
        lambda: kernels.planar_moments([SQUARE * 1e200], 2),
        "largest coordinate of the rings is 1e200; it needs to be from",
    ),
    (lambda: kernels.spherical_moments([LIFTED * 0.0], 2), "ring 0 bearing 0 is zero; a bearing needs a direction"),
    (
        lambda: kernels.spherical_moments([np.vstack([LIFTED, -LIFTED])], 2),
        "the observed region reaches 89.9 deg or more|distinct",
    ),
    (lambda: kernels.triangulate([SQUARE[:2]]), "ring 0 has 2 distinct vertices"),
    (lambda: kernels.triangulate(None), "rings need to be a list of arrays"),  # type: ignore[arg-type]
    (lambda: kernels.planar_moments([["a", "b"]], 2), "ring 0 is an array of type <U1; it needs to be an"),
]

MASKS: list[tuple[Callable[[], object], str]] = [
    (lambda: FROM_MASK(np.zeros((4, 5))), "mask is empty; needed at least one pixel"),
    (lambda: FROM_MASK(np.full((4, 5), 0.4)), "mask is empty"),
    (lambda: FROM_MASK(np.zeros((4, 0))), r"mask has shape \(4, 0\); needed \(h, w\)"),
    (lambda: FROM_MASK(np.ones((4, 5, 3))), r"mask has shape \(4, 5, 3\); needed \(h, w\)"),
    (lambda: FROM_MASK(np.full((4, 5), 1.5)), r"mask holds values from 1.5 to 1.5; needed coverage in \[0, 1\]"),
    (lambda: FROM_MASK(np.full((4, 5), np.nan)), "mask holds values from nan to nan; needed coverage"),
    (lambda: FROM_MASK(np.arange(20).reshape(4, 5)), "mask holds 20 integer values; needed 0 and one other"),
    (lambda: FROM_MASK(np.full((4, 5), "a")), "mask has type <U1; needed bool, integers or floats"),
    (lambda: FROM_MASK(np.ones((4, 5), dtype=complex)), "mask has type complex128"),
    (lambda: FROM_MASK(None), r"mask has shape \(\); needed \(h, w\)"),
    (lambda: FROM_MASK([[1, 0], [1]]), "mask has rows of unequal length"),
    (
        lambda: rp.estimate_pose(CAMERA, [FROM_MASK(MASK[:100, :200] | True)], [WORLD]),  # type: ignore[list-item]
        "mask of image region 0: found 200 x 100 pixels .*; needed the calibrated 640 x 480",
    ),
    (
        lambda: solve(system="sphere", integration="pixels"),
        "image region 0: the image region is a polygon; .* needs a region",
    ),
]

WORLDS: list[tuple[Callable[[], object], str]] = [
    (lambda: POINTS(np.ones((9, 3))), "9 points are given, of which fewer than 3 differ; needed at least 3"),
    (lambda: POINTS(np.outer(np.arange(9.0), [1, 2, 3])), "9 points that are identical or on one line"),
    (lambda: POINTS(LIFTED[:2]), "fewer than 3 differ"),
    (lambda: POINTS(with_value(LIFTED, np.nan)), r"point 2 is \[1.0, nan, 1.0\]; needed finite coordinates"),
    (
        lambda: POINTS(with_value(LIFTED, 1e61)),
        r"point 2 is \[1.0, 1e\+61, 1.0\]; needed coordinates of at most",
    ),
    (lambda: POINTS(LIFTED * 1e-70), "4 points are within 1e-70; needed an extent of 6.2e-61"),
    (
        lambda: rp.WorldRegion.from_points(LIFTED, sensor_origin=[0, 1e61, 0]),
        r"sensor_origin is \[0.0, 1e\+61, 0.0\]; nee",
    ),
    (
        lambda: rp.WorldRegion.from_samples(LIFTED, [[1e61, 0, 0]]),
        r"outside point 0 is \[1e\+61, 0.0, 0.0\]; needed coord",
    ),
    (
        lambda: rp.WorldRegion.from_scan(with_value(LIFTED, 1e61), [0, 1, 3]),
        "point 2 is .*; needed coordinates of at most",
    ),
    (lambda: rp.segment.grow_plane(with_value(LIFTED, 1e61), UP), "point 2 is .*; needed coordinates of at most 1.6e"),
    (lambda: POINTS(SQUARE), r"points has shape \(4, 2\); needed \(n, 3\)"),
    (lambda: POINTS(None), "points has type object"),
    (lambda: POINTS([["a", "b", "c"]]), "type <U1"),
    (lambda: rp.WorldRegion.from_points(LIFTED, radius_m=-1.0), "radius_m is -1.0; needed a positive number"),
    (lambda: rp.WorldRegion.from_points(LIFTED, radius_m=np.nan), "radius_m is nan; needed a positive number"),
    (lambda: rp.WorldRegion.from_points(LIFTED, radius_m="big"), "radius_m is a str; needed"),  # type: ignore[arg-type]
    (lambda: rp.WorldRegion.from_mesh(None), "mesh is a NoneType; needed one with vertices"),  # type: ignore[arg-type]
    (lambda: rp.WorldRegion.from_mesh(Mesh(LIFTED, [[0, 1, 9]])), "vertex index is 9; it needs to be below .*, 4"),
    (lambda: rp.WorldRegion.from_mesh(Mesh(LIFTED, [[0, 1, -1]])), "triangles hold -1; vertex indices need"),
    (lambda: rp.WorldRegion.from_mesh(Mesh(LIFTED, [[0, 1, 1]])), "the mesh has edge 1 to 1"),
    (
        lambda: rp.WorldRegion.from_mesh(Mesh(LIFTED, np.zeros((0, 3)))),
        "number of triangles is 0; it needs to be at least 1",
    ),
    (lambda: rp.WorldRegion.from_mesh(Mesh(with_value(LIFTED, np.nan), [[0, 1, 2]])), "vertex 2 is not finite: NaN"),
    (lambda: rp.WorldRegion.from_mesh(Mesh(LIFTED, "faces")), "mesh.faces has type <U5"),
    (lambda: kernels.alpha_shape(SQUARE[:2], 1.0), "2 distinct points; an outline needs at least 3"),
    (lambda: kernels.alpha_shape([[0, 0], [1, 1], [2, 2]], 1.0), "all 3 distinct points lie on one line"),
    (lambda: kernels.alpha_shape(SQUARE, 0.1), "radius 1e-1 keeps none of the triangles; it needs to be at least 7.07"),
    (lambda: kernels.alpha_shape(SQUARE, 0.0), "radius is 0; it needs to be positive"),
]

OPTIONS: list[tuple[Callable[[], object], str]] = [
    (lambda: solve(system="cylinder"), 'system is \'cylinder\'; needed "plane" or "sphere"'),
    (lambda: solve(system=None), 'system is None; needed "plane" or "sphere"'),
    (lambda: solve(integration="voxels"), 'integration is \'voxels\'; needed "boundary" or "mesh" or "pixels"'),
    (lambda: solve(integration={}), "integration is {}; needed"),
    (lambda: solve(integration=1), "integration is 1; needed"),
    (lambda: solve(mesh_size=0.1), 'mesh_size is 0.1 with integration "boundary"; needed "mesh"'),
    (lambda: solve(integration="mesh", mesh_size=0.0), "mesh_size is 0.0; needed a positive and finite number"),
    (lambda: solve(integration="mesh", mesh_size=-1.0), "mesh_size is -1.0; needed a positive"),
    (lambda: solve(integration="mesh", mesh_size=np.nan), "mesh_size is nan; needed a positive and finite number"),
    (lambda: solve(integration="mesh", mesh_size=1e-6), "it would make more than 100000 triangles"),
    (lambda: solve(integration="mesh", mesh_size="fine"), "mesh_size is 'fine'; needed a number, or None"),
    (lambda: solve(driver="ceres"), 'driver is \'ceres\'; needed "native" or "scipy"'),
    (lambda: solve(refine="edges"), "refine is 'edges'; needed \"contour\" or None"),
    (lambda: solve(start="random"), 'start is \'random\'; needed "global" or "paper"'),
    (lambda: solve(prior="up"), "prior is a str; needed a Prior or None"),
    (lambda: solve(prior={"up": UP}), "prior is a dict; needed a Prior or None"),
    (lambda: rp.Prior(initial=4.0), "initial is a float; needed a Pose"),  # type: ignore[arg-type]
    (lambda: rp.Prior(initial=np.eye(4)), "initial is a ndarray; needed a Pose"),  # type: ignore[arg-type]
    (lambda: rp.Prior(up={}), "up is a dict that is not an array|up is an array of type object; it needs"),  # type: ignore[arg-type]
    (lambda: rp.Prior(up="north"), "up is an array of type <U5; it needs to be an"),
    (lambda: rp.estimate_pose(CAMERA, None, [WORLD]), "image_regions is a NoneType; needed a list of ImageRegions"),  # type: ignore[arg-type]
    (lambda: rp.estimate_pose(CAMERA, [IMAGE], 7), "world_regions is a int; needed a list of WorldRegions"),  # type: ignore[arg-type]
    (lambda: rp.estimate_poses(None), "found a NoneType; needed a list of problems"),  # type: ignore[arg-type]
    (lambda: rp.estimate_poses([5]), r"problem 0: found a int; needed \(camera, image_regions"),  # type: ignore[list-item]
    (lambda: rp.estimate_poses([(CAMERA, [IMAGE])]), "problem 0: found 2 items; needed"),  # type: ignore[list-item]
    (lambda: rp.estimate_poses([(CAMERA, [IMAGE], [WORLD])], threads="two"), "threads is a str"),  # type: ignore[arg-type]
    (lambda: rp.estimate_poses([(CAMERA, [IMAGE], [WORLD])], threads=-1), "threads is a int; it needs"),
    (lambda: rp.estimate_poses([(CAMERA, [IMAGE], [WORLD])], prior=5), "prior is a int; needed a Prior, a list"),  # type: ignore[arg-type]
    (lambda: rp.estimate_poses([(CAMERA, [IMAGE], [WORLD])], prior=[]), "prior has 0 items; needed one Prior, or"),
    (lambda: rp.Prior(up=[0.0, 0.0, 0.0]), "up is a zero vector; it needs to be a direction"),
    (lambda: rp.Prior(up=[0.0, np.nan, 0.0]), r"up is \[0.0, NaN, 0.0\]; it needs to be 3 finite numbers"),
    (lambda: rp.Prior(up=[0.0, 1.0]), r"up is \[0.0, 1.0\]; it needs to be 3 finite numbers"),
    (lambda: rp.Prior(up=UP, up_sigma_deg=0.0), "up_sigma_deg holds 0; it needs positive numbers"),
    (lambda: rp.Prior(up=UP, up_sigma_deg="few"), "up_sigma_deg is a str; it needs to be a positive number of degrees"),  # type: ignore[arg-type]
    (lambda: rp.Prior(up_sigma_deg=5.0), "up_sigma_deg is 5.0 without up; it needs up"),
    (
        lambda: rp.Prior(initial=POSE, initial_rotation_sigma_deg=5.0),
        "initial_rotation_sigma_deg is given without initial_center_sigma_m; it needs both or neither",
    ),
    (
        lambda: rp.Prior(initial=POSE, initial_rotation_sigma_deg=5.0, initial_center_sigma_m=-1.0),
        "initial_center_sigma_m holds -1; it needs positive numbers",
    ),
    (
        lambda: rp.Prior(initial=POSE, initial_rotation_sigma_deg="5 deg", initial_center_sigma_m=1.0),  # type: ignore[arg-type]
        "initial_rotation_sigma_deg is a str; it needs",
    ),
    (
        lambda: rp.Prior(initial_rotation_sigma_deg=5.0, initial_center_sigma_m=1.0),
        "initial_rotation_sigma_deg is 5.0 without initial; it needs initial",
    ),
    (lambda: rp.Prior(camera_near=[0.0, np.inf, 1.0]), r"camera_near is \[0.0, inf, 1.0\]; it needs to be 3 finite"),
    (lambda: rp.Prior(camera_near=UP, camera_near_sigma_m=np.inf), "camera_near_sigma_m holds inf; it needs positive"),
    (lambda: rp.Prior(camera_near_sigma_m=2.0), "camera_near_sigma_m is 2.0 without camera_near; it needs camera_near"),
    (
        lambda: WORLD.with_viewpoint([0.0, np.nan, 1.0]),
        r"viewpoint is \[0.0, NaN, 1.0\]; it needs to be 3 finite numbers",
    ),
    (
        lambda: WORLD.with_viewpoint(LIFTED[0] + 3.0 * (LIFTED[1] - LIFTED[0])),
        "off the region's plane at a distance",
    ),
    (lambda: rp.estimate_pose(CAMERA, [], []), "there are 0 observed and 0 world regions; there need to be as many"),
    (lambda: rp.estimate_pose(CAMERA, [IMAGE], [WORLD, WORLD]), "there are 1 observed and 2 world regions"),
    (lambda: rp.estimate_pose(CAMERA, [WORLD], [WORLD]), r"image_regions\[0\] is a WorldRegion; needed a ImageRegion"),  # type: ignore[list-item]
    (lambda: rp.estimate_pose("cam", [IMAGE], [WORLD]), "camera is a str; needed a Camera"),  # type: ignore[arg-type]
    (lambda: kernels.planar_moments([SQUARE], -1), "order is -1; it needs to be 0 to 8"),
    (lambda: kernels.spherical_moments([LIFTED], 9), "order is 9; it needs to be 0 to 8"),
    (lambda: kernels.planar_moments([SQUARE], 10**30), "order is a int; it needs to be a whole number from 0 to 8"),
    (lambda: kernels.planar_moments([SQUARE], 2.5), "order is a float; it needs"),  # type: ignore[arg-type]
    (lambda: kernels.planar_moments([SQUARE], None), "order is a NoneType; it needs"),  # type: ignore[arg-type]
    (lambda: kernels.triangulate([SQUARE], max_area=0.0), "max_area is 0; it needs to be at least"),
    (lambda: kernels.triangulate([SQUARE], max_area=np.nan), "max_area is NaN; it needs"),
    (lambda: kernels.triangulate([SQUARE], min_angle=50.0), "min_angle is 50; it needs to be from 0.001 to 30"),
    (lambda: kernels.triangulate([SQUARE], min_angle="wide"), "min_angle is a str; it needs"),  # type: ignore[arg-type]
    (lambda: _core.mesh_planar_moments(with_value(SQUARE, np.nan), [[0, 1, 2]], 2), "vertices row 2 is not finite"),
    (lambda: bordered(np.empty((0, 3))), "region 0: border line 0 has 0 bearings; a line needs"),
    (lambda: bordered(LIFTED[:1]), "region 0: border line 0 has 1 bearings; a line needs"),
    (lambda: _core.pixel_moments(LIFTED, np.ones(3), 2), "bearings has 4 rows and solid_angles 3"),
    (lambda: _core.contour_pieces([], []), "the region has no rings"),
    (lambda: _core.contour_pieces([SQUARE[:2]], [MARKS[:2]]), "ring 0 has 2 distinct vertices"),
    (lambda: _core.contour_pieces([SQUARE], []), "on_border has 0 arrays; it needs one for each ring, 1"),
    (lambda: _core.contour_pieces([SQUARE], [MARKS[:3]]), r"on_border 0 needs to be a \(4,\) array of bool"),
    (lambda: _core.nearest_edges([SQUARE], with_value(SQUARE, np.inf)), "points row 2 is not finite"),
    (lambda: _core.nearest_edges([], SQUARE), "the region has no rings"),
]

CAMERAS: list[tuple[Callable[[], object], str]] = [
    (lambda: rp.PinholeCamera(-500.0, 500.0, 0.0, 0.0), "fx: found -500.0; needed a number above 0"),
    (lambda: rp.FisheyeCamera(500.0, 0.0, 0.0, 0.0), "fy: found 0.0; needed a number above 0"),
    (lambda: rp.cameras.UnifiedCamera(np.nan, 1.0, 0.0, 0.0, xi=1.0), "fx: found nan; needed a finite number"),
    (lambda: rp.PinholeCamera("500", 500.0, 0.0, 0.0), "fx: found '500'; needed a number"),  # type: ignore[arg-type]
    (lambda: rp.cameras.OcamCamera((0.0,), (0.0, 0.0)), "polynomial: found 0.0; needed a first coefficient a0 above 0"),
    (lambda: CAMERA.bearings(SQUARE * 1j), "pixels has type complex128; needed real numbers"),
    (lambda: rp.load_camera(None), "path is a NoneType; needed the path"),  # type: ignore[arg-type]
    (lambda: rp.load_camera(SAMPLES), "found a directory; needed a calibration file"),
    (lambda: rp.Pose.from_matrix(2.0 * np.eye(4)), r"last row \[0.0, 0.0, 0.0, 2.0\]; needed \[0, 0, 0, 1\]"),
    (lambda: rp.Pose.from_matrix(np.eye(3)), r"pose matrix has shape \(3, 3\); needed \(4, 4\) or \(3, 4\)"),
    (lambda: rp.Pose.from_parts(-np.eye(3), [0, 0, 0]), "det = -1.000; needed a rotation"),
    (lambda: rp.Pose.from_parts(np.eye(3), "here"), "translation has type <U4; needed real numbers"),
    (lambda: rp.Pose(None, np.zeros(3)), "rotation is NoneType; needed one scipy Rotation"),  # type: ignore[arg-type]
    (
        lambda: rp.Pose.from_parts(np.eye(3), [0.0, np.inf, 0.0]),
        r"translation is \[0.0, inf, 0.0\]; needed finite numbers",
    ),
]


@pytest.mark.parametrize(
    ("make", "message"),
    RINGS + MASKS + WORLDS + OPTIONS + CAMERAS,
    ids=lambda value: value[:50] if isinstance(value, str) else "made",
)
def test_bad_input_is_named(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_missing_calibration_is_a_missing_file() -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.yaml"):
        rp.load_camera(SAMPLES / "nowhere.yaml")


@pytest.mark.parametrize("name", ["opencv.yml", "ocam_calib_results.txt", "kalibr_camchain.yaml", "kitti_odometry.txt"])
def test_a_calibration_cut_anywhere_is_read_or_refused(name: str, tmp_path: Path) -> None:
    text = (SAMPLES / name).read_text()
    cut = tmp_path / name
    refused = 0
    for end in range(0, len(text), max(1, len(text) // 60)):
        cut.write_text(text[:end])
        try:
            rp.load_camera(cut, "cam0" if "kalibr" in name else None)
        except ValueError as error:
            assert name in str(error)
            refused += 1
    assert refused > 10


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    for content in (b"\x89PNG\r\n\x1a\n\x00\x00", b"hello", b"[1, 2, 3]", b"", b"a: {b: [c, d]}\n"):
        (tmp_path / "file").write_bytes(content)
        with pytest.raises(ValueError, match=r"file: found"):
            rp.load_camera(tmp_path / "file")


ANYTHING = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.binary(max_size=5),
    st.dictionaries(st.integers(), st.floats(), max_size=2),
    st.lists(st.lists(st.lists(st.floats(), max_size=4), max_size=5), max_size=3),
    st.lists(st.lists(st.floats(), min_size=2, max_size=3), max_size=5),
    st.sampled_from([object(), SQUARE, LIFTED, [SQUARE], [LIFTED], MASK, int, np.array(1.0), np.array("a"), range(3)]),
    arrays.arrays(
        st.sampled_from([np.float64, np.float32, np.int64, np.uint8, np.bool_, np.complex128]),
        arrays.array_shapes(max_dims=3, max_side=5),
    ),
)

FUNCTIONS: list[Callable[[Any], object]] = [
    rp.ImageRegion.from_polygon,
    rp.ImageRegion.from_mask,
    rp.WorldRegion.from_polygon,
    rp.WorldRegion.from_points,
    rp.WorldRegion.from_mesh,
    rp.Pose.from_matrix,
    CAMERA.bearings,
    CAMERA.project,
    kernels.triangulate,
    lambda value: rp.Pose(value, np.zeros(3)),
    lambda value: rp.Pose.from_parts(np.eye(3), value),
    lambda value: rp.Pose.from_parts(np.eye(3), [0, 0, 0]).transform(value),
    lambda value: kernels.planar_moments(value, 3),
    lambda value: kernels.spherical_moments(value, 3),
    lambda value: kernels.planar_moments([SQUARE], value),
    lambda value: kernels.alpha_shape(value, 1.0),
    lambda value: kernels.alpha_shape(SQUARE, value),
    lambda value: kernels.triangulate([SQUARE], max_area=value),
    lambda value: rp.WorldRegion.from_points(LIFTED, radius_m=value),
    lambda value: rp.WorldRegion.from_mesh(Mesh(value, [[0, 1, 2]])),
    lambda value: rp.WorldRegion.from_mesh(Mesh(LIFTED, value)),
    lambda value: rp.PinholeCamera(value, 1.0, 0.0, 0.0),
    lambda value: rp.PinholeCamera(1.0, 1.0, 0.0, 0.0, width=value),
    lambda value: rp.PinholeCamera(1.0, 1.0, 0.0, 0.0, distortion=value),
    lambda value: rp.FisheyeCamera(1.0, 1.0, 0.0, 0.0, distortion=value),
    lambda value: rp.cameras.OcamCamera(value, (0.0, 0.0)),
    lambda value: rp.cameras.UnifiedCamera(1.0, 1.0, 0.0, 0.0, xi=value),
    lambda value: rp.estimate_pose(value, [IMAGE], [WORLD]),
    lambda value: rp.estimate_pose(CAMERA, value, [WORLD]),
    lambda value: rp.estimate_pose(CAMERA, [IMAGE], value),
    lambda value: rp.estimate_poses(value),
    lambda value: rp.estimate_poses([value]),
    lambda value: solve(prior=value),
    lambda value: solve(start=value),
    lambda value: rp.estimate_poses([(CAMERA, [IMAGE], [WORLD])], prior=value),
    lambda value: rp.Prior(initial=value),
    lambda value: rp.Prior(up=value),
    lambda value: rp.Prior(up=UP, up_sigma_deg=value),
    lambda value: rp.Prior(initial=POSE, initial_rotation_sigma_deg=value, initial_center_sigma_m=value),
    lambda value: rp.Prior(camera_near=value),
    lambda value: rp.Prior(camera_near=UP, camera_near_sigma_m=value),
    lambda value: WORLD.with_viewpoint(value),
    lambda value: solve(system=value),
    lambda value: solve(integration=value),
    lambda value: solve(driver=value),
    lambda value: _core.mesh_planar_moments(value, [[0, 1, 2]], 2),
    lambda value: _core.mesh_planar_moments(SQUARE, value, 2),
    lambda value: _core.mesh_spherical_moments(LIFTED, value, 2),
    lambda value: _core.pixel_moments(value, value, 2),
    lambda value: _core.quad_solid_angles(value),
    lambda value: _core.contour_pieces([value], [MARKS]),
    lambda value: _core.contour_pieces([SQUARE], value),
    lambda value: _core.nearest_edges(value, SQUARE),
    lambda value: _core.nearest_edges([SQUARE], value),
]


@settings(max_examples=400, deadline=None)
@example(rp.Pose.from_parts(np.eye(3), [0, 0, 0]).transform, [[0.0, 0.0, np.inf]])
@example(POINTS, LIFTED * 1e307)
@given(st.sampled_from(FUNCTIONS), ANYTHING)
def test_anything_is_taken_or_refused_with_a_value_error(function: Callable[[Any], object], value: object) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            function(value)
        except ValueError as error:
            assert len(str(error)) > 10


COORDINATES = st.floats(-1e3, 1e3) | st.sampled_from([0.0, 1.0, 1e-300, 1e-12, 0.5]) | st.floats()


@settings(max_examples=150, deadline=None)
@example([np.array([[-1.25, 1e7], [0.0, 0.5], [1e7, -1.25], [0.0, 0.0]])])
@given(st.lists(arrays.arrays(np.float64, st.tuples(st.integers(1, 7), st.just(2)), elements=COORDINATES), max_size=3))
def test_rings_are_refused_or_have_a_positive_area(rings: list[np.ndarray]) -> None:
    try:
        moments = kernels.planar_moments(rings, 2)
    except ValueError:
        return
    assert moments[0, 0] > 0.0
    vertices, triangles = kernels.triangulate(rings)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    # The area of a sliver is a difference of products of its coordinates: each is rounded.
    rounding = len(vertices) * np.spacing(np.prod(np.abs(vertices).max(axis=0)))
    assert areas.sum() == pytest.approx(moments[0, 0], rel=1e-9, abs=rounding)


@settings(max_examples=25, deadline=None)
@example(210, 0.25, 1e-6, "plane", "boundary", "scipy")
@example(155, 1.0, 1.0, "plane", "boundary", "native")
@given(
    st.integers(0, 1000),
    st.floats(-1.0, 1.0),
    st.sampled_from([1e-6, 1.0, 1e6]),
    st.sampled_from(["plane", "sphere"]),
    st.sampled_from(["boundary", "mesh"]),
    st.sampled_from(["scipy", "native"]),
)
def test_pairs_that_do_not_match_end_in_a_pose_or_a_pose_error(
    seed: int, squeeze: float, size: float, system: Any, integration: Any, driver: Any
) -> None:
    """Any polygon in the image for any template in the world, thin ones and other units included."""
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, 7))
    radii = rng.uniform(20.0, 200.0, 7)
    ring = np.column_stack([radii * np.cos(angles), (1e-3 + abs(squeeze)) * radii * np.sin(angles)]) + np.array(
        [320.0, 240.0]
    )
    templates = load_templates("all")
    world = [size * part for part in templates[seed % len(templates)].region()]
    try:
        image = rp.ImageRegion.from_polygon(ring)
        estimate = rp.estimate_pose(
            CAMERA,
            [image],
            [rp.WorldRegion.from_polygon(world)],
            solver=rp.Solver(system=system, integration=integration, driver=driver),
        )
    except ValueError as error:
        assert len(str(error)) > 10
        return
    assert np.isfinite(estimate.pose.matrix).all()
    assert estimate.diagnostics.overlap_error < 0.05 or estimate.warnings
