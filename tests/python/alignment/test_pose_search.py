"""What the core searches poses with: projections as tables, edges of clouds, densities of poses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from regionpose import _core
from regionpose.cameras import Camera
from regionpose.cameras.matrix import MatrixCamera
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

WIDTH, HEIGHT = 640, 480
SIZE: dict[str, Any] = {"width": WIDTH, "height": HEIGHT}
CENTER = (322.5, 238.0)

TABLE_PX = 0.15
"""What a table of a projection may be off by: it is made finer until a tenth holds in the middles of its cells."""

CAMERAS: dict[str, Camera] = {
    "pinhole": rp.PinholeCamera(400.0, 405.0, *CENTER, **SIZE),
    "pinhole with distortion": rp.PinholeCamera(400.0, 405.0, *CENTER, distortion=(-0.3, 0.1, 1e-3, -2e-3), **SIZE),
    "rational": rp.PinholeCamera(400.0, 400.0, *CENTER, distortion=(0.3, 0.02, 0, 0, 0.1, 0.5, 0.1, 0.01), **SIZE),
    "narrow": rp.PinholeCamera(4000.0, 4000.0, *CENTER, distortion=(-0.5, 0.3, 0.0, 0.0), **SIZE),
    "fisheye": rp.FisheyeCamera(160.0, 161.0, *CENTER, distortion=(0.05, -0.01, 0.002, -0.001), **SIZE),
    "unified": rp.cameras.UnifiedCamera(350.0, 355.0, *CENTER, xi=0.9, distortion=(-0.1, 0.02, 1e-3, -1e-3), **SIZE),
    "unified, wide": rp.cameras.UnifiedCamera(250.0, 250.0, *CENTER, xi=1.3, **SIZE),
    "fov": rp.cameras.FovCamera(300.0, 305.0, *CENTER, omega=0.95, **SIZE),
    "ocam": rp.cameras.OcamCamera(
        (160.0, 0.0, -2.2e-3, 4.8e-6, -2e-8), CENTER, stretch=((1.0, 7e-4), (-4e-4, 1.002)), **SIZE
    ),
    "equirectangular": rp.cameras.EquirectangularCamera(width=WIDTH, height=320),
}

RIGHT = np.diag([1e-4] * 3 + [1e-2] * 3)


def table_of(camera: Camera) -> _core.Projection:
    assert camera.width is not None and camera.height is not None
    return _core.Projection([camera.width, camera.height], camera.project)


def random_pixels(camera: Camera, margin: float) -> Array:
    """Pixels (n, 2) of the image that the camera has rays at, away from its border."""
    assert camera.width is not None and camera.height is not None
    rng = np.random.default_rng(4)
    pixels = rng.uniform(margin - 0.5, np.array([camera.width, camera.height]) - 0.5 - margin, (4_000, 2))
    return np.asarray(pixels[np.isfinite(camera.bearings(pixels)).all(axis=1)])


@pytest.mark.parametrize("name", CAMERAS)
def test_a_table_projects_as_its_camera(name: str) -> None:
    camera = CAMERAS[name]
    # Away from the seam of a panorama, at its left and right border, and from its poles.
    pixels = random_pixels(camera, 8.0 if name == "equirectangular" else 0.0)
    assert len(pixels) > 1_500
    lengths = np.random.default_rng(5).uniform(0.1, 200.0, (len(pixels), 1))
    found = table_of(camera).project(lengths * camera.bearings(pixels))
    assert np.abs(found - pixels).max() < TABLE_PX
    if name == "pinhole":
        assert found == pytest.approx(pixels, abs=1e-3)


@pytest.mark.parametrize("name", CAMERAS)
def test_what_a_table_shows_is_what_its_camera_shows(name: str) -> None:
    camera = CAMERAS[name]
    bearings = Rotation.random(4_000, random_state=6).apply([0.0, 0.0, 1.0])
    found, exact = table_of(camera).project(bearings), camera.project(bearings)
    assert camera.width is not None and camera.height is not None
    inside = (found > -0.5).all(axis=1) & (found < np.array([camera.width, camera.height]) - 0.5).all(axis=1)
    # Next to a seam, a cell of the table is left out or ends a little beyond what the camera sees.
    apart = np.abs(found[inside] - exact[inside]).max(axis=1)
    assert (apart < TABLE_PX).mean() > 0.99


@pytest.mark.parametrize("name", ["pinhole with distortion", "rational", "fisheye"])
def test_a_zoomed_table_projects_as_the_zoomed_camera(name: str) -> None:
    camera = CAMERAS[name]
    assert isinstance(camera, MatrixCamera)
    widest = table_of(camera.zoomed(0.8))
    for factor in (0.8, 0.97, 1.0, 1.2):
        zoomed = camera.zoomed(factor)
        pixels = random_pixels(zoomed, 0.0)
        found = widest.zoomed(factor / 0.8, CENTER).project(zoomed.bearings(pixels))
        assert np.abs(found - pixels).max() < TABLE_PX * factor / 0.8


def test_nothing_is_seen_at_bearings_that_are_none() -> None:
    for camera in CAMERAS.values():
        none = table_of(camera).project([[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [np.inf, np.inf, np.inf]])
        assert np.isnan(none).all()
    assert table_of(CAMERAS["pinhole"]).project(np.empty((0, 3))).shape == (0, 2)
    assert np.isnan(table_of(CAMERAS["pinhole"]).project([[0.0, 0.0, -1.0]])).all()


BAD_PROJECTIONS: dict[str, tuple[Callable[[Array], Any], str]] = {
    "nothing within the image": (lambda rays: np.full((len(rays), 2), np.nan), "sees nothing within its 640 x 480"),
    "pixels far outside": (lambda rays: np.full((len(rays), 2), 1e6), "sees nothing within its 640 x 480"),
    "too few pixels": (lambda rays: np.zeros((3, 2)), r"project gave 3 pixels for \d+ bearings"),
    "three columns": (lambda rays: np.zeros((len(rays), 3)), r"pixels has shape .*; it needs to be an \(n, 2\) array"),
    "words": (lambda rays: "here", "pixels is .*; it needs to be"),
}


@pytest.mark.parametrize("case", BAD_PROJECTIONS)
def test_projections_that_are_none_are_refused(case: str) -> None:
    project, message = BAD_PROJECTIONS[case]
    with pytest.raises(ValueError, match=message):
        _core.Projection([WIDTH, HEIGHT], project)


def test_errors_of_a_projection_come_through() -> None:
    def broken(bearings: Array) -> Array:
        raise KeyError("lens")

    with pytest.raises(KeyError, match="lens"):
        _core.Projection([WIDTH, HEIGHT], broken)
    with pytest.raises(ValueError, match="bearings has shape"):
        table_of(CAMERAS["pinhole"]).project(np.zeros((3, 2)))


def plates() -> tuple[Array, Array]:
    """A wall of two shades at 6 m and a card at 3 m before it, and the shades (n,)."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 101), np.linspace(-0.4, 0.4, 81))
    rays = np.column_stack([x.ravel(), y.ravel(), np.ones(x.size)])
    card = (np.abs(rays[:, :2] - [0.1, 0.05]) < 0.15).all(axis=1)
    shades = np.where(card, 50.0, np.where(rays[:, 0] < -0.2, 10.0, 90.0))
    return rays * np.where(card, 3.0, 6.0)[:, None], shades


def edges_of(points: Array, shades: Array | None = None, place: Any = (0.0, 0.0, 0.0)) -> _core.CloudEdges:
    return _core.CloudEdges(points, place, 0.005, 0.02, 0.1, shades)


def test_edges_are_where_surfaces_end_and_where_shades_change() -> None:
    points, shades = plates()
    by_depth, by_both = edges_of(points), edges_of(points, shades)
    assert 60 < len(by_depth) < len(by_both)
    assert len(edges_of(points[points[:, 2] > 5.0])) < len(by_depth)
    assert len(edges_of(points + 1e3, place=[1e3, 1e3, 1e3])) == pytest.approx(len(by_depth), rel=0.05)


def test_edges_are_detected_within_an_angle_of_given_axes() -> None:
    points, shades = plates()
    whole = len(edges_of(points, shades))
    assert len(_core.CloudEdges(points, np.zeros(3), 0.005, 0.02, 0.1, shades, [[0.0, 0.0, 1.0]], 1.2)) == whole
    # The half of the card's border that lies to the right of its middle.
    beside = _core.CloudEdges(points, np.zeros(3), 0.005, 0.02, 0.1, None, [[1.0, 0.0, 0.0]], np.pi / 2 - 0.1)
    assert 0 < len(beside) < 0.7 * len(edges_of(points))
    assert len(_core.CloudEdges(points, np.zeros(3), 0.005, 0.02, 0.1, shades, [[0.0, 0.0, -1.0]], 1.0)) == 0


def test_points_that_are_not_finite_have_no_edges() -> None:
    points, shades = plates()
    holed = points.copy()
    holed[:40] = np.nan
    assert len(edges_of(holed, shades)) > 60
    assert len(edges_of(np.full((50, 3), np.nan))) == len(edges_of(np.empty((0, 3)))) == len(edges_of(points[:1])) == 0


def test_wrong_shapes_of_edges_are_named() -> None:
    points, shades = plates()
    with pytest.raises(ValueError, match=r"points has shape .*; it needs to be an \(n, 3\) array"):
        edges_of(points[:, :2])
    with pytest.raises(ValueError, match=r"place is .*; it needs to be 3 finite numbers"):
        edges_of(points, place=[0.0, 0.0])
    with pytest.raises(ValueError, match=r"place is .*; it needs to be 3 finite numbers"):
        edges_of(points, place=[0.0, np.nan, 0.0])
    with pytest.raises(ValueError, match=r"shades has 3 values for 8181 points; it needs one a point"):
        edges_of(points, shades[:3])
    for angle in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="cell"):
            _core.CloudEdges(points, [0, 0, 0], angle, 0.02, 0.1)
        with pytest.raises(ValueError, match="gap"):
            _core.CloudEdges(points, [0, 0, 0], 0.005, angle, 0.1)


def ratios_of(*shape: int) -> list[tuple[NDArray[np.float32], int]]:
    rng = np.random.default_rng(8)
    return [(rng.normal(0.0, 0.2, shape).astype(np.float32), reduction) for reduction in (8, 4, 2, 1)]


def frame_of(ratios: Any, origin: Any = (0.0, 0.0, 0.0)) -> _core.AlignmentFrame:
    return _core.AlignmentFrame(table_of(CAMERAS["pinhole"]), 0.8, ratios, edges_of(*plates()), origin)


def test_sums_over_edges_are_those_at_their_pixels() -> None:
    ratios = ratios_of(4, HEIGHT, WIDTH)
    frame, straight, nowhere = frame_of(ratios), np.eye(3), np.zeros(3)
    pixels, directions = frame.project_edges(straight, nowhere)
    total, count = frame.log_ratio(straight, nowhere, 3)
    assert pixels.shape == (len(directions), 2) and set(directions.tolist()) <= {0, 1, 2, 3}
    values = []
    for (x, y), direction in zip(pixels, directions, strict=True):
        if 0 <= x < WIDTH - 1 and 0 <= y < HEIGHT - 1:
            column, row = int(x), int(y)
            corners = ratios[3][0][direction, row : row + 2, column : column + 2].astype(float)
            right, down = x - column, y - row
            values.append(np.array([1.0 - down, down]) @ corners @ np.array([1.0 - right, right]))
    assert count == len(values) > 100
    assert total == pytest.approx(sum(values), abs=0.02 * np.sqrt(count))
    back = Rotation.from_rotvec([0.0, np.pi, 0.0]).as_matrix()
    assert frame.log_ratio(back, nowhere, 0) == (0.0, 0)
    assert len(frame.project_edges(back, nowhere)[0]) == 0


def test_other_edges_and_other_cameras_take_the_place_of_a_frame_s() -> None:
    frame, pose = frame_of(ratios_of(4, HEIGHT, WIDTH)), (np.eye(3), np.zeros(3))
    bare = frame.with_edges(edges_of(np.empty((0, 3))))
    assert bare.log_ratio(*pose, 0) == (0.0, 0)
    assert bare.with_edges(edges_of(*plates())).log_ratio(*pose, 3) == frame.log_ratio(*pose, 3)
    longer = rp.PinholeCamera(800.0, 810.0, *CENTER, **SIZE)
    zoomed = frame.with_projection(table_of(longer), 0.5)
    first, second = frame.project_edges(*pose)[0], zoomed.project_edges(*pose)[0]
    assert 0 < len(second) <= len(first)
    assert zoomed.with_projection(table_of(CAMERAS["pinhole"]), 0.8).log_ratio(*pose, 3) == frame.log_ratio(*pose, 3)


BAD_RATIOS: dict[str, Any] = {
    "three spreads": ratios_of(4, 60, 80)[:3],
    "five spreads": ratios_of(4, 60, 80) + ratios_of(4, 60, 80)[:1],
    "three directions": ratios_of(3, 60, 80),
    "no pixel": ratios_of(4, 0, 80),
    "no reduction": [(values, 0) for values, _ in ratios_of(4, 60, 80)],
}


@pytest.mark.parametrize("case", BAD_RATIOS)
def test_pictures_of_other_shapes_are_refused(case: str) -> None:
    with pytest.raises(ValueError, match=r"ratios needs 4 pictures \(4, h, w\)"):
        frame_of(BAD_RATIOS[case])


def test_wrong_poses_and_spreads_are_named() -> None:
    frame = frame_of(ratios_of(4, HEIGHT, WIDTH))
    with pytest.raises(ValueError, match="spread is 4; it needs to be below 4"):
        frame.log_ratio(np.eye(3), np.zeros(3), 4)
    with pytest.raises(ValueError, match="rotation"):
        frame.log_ratio(np.eye(2), np.zeros(3), 0)
    with pytest.raises(ValueError, match="translation"):
        frame.project_edges(np.eye(3), np.zeros(2))
    with pytest.raises(ValueError, match=r"origin is .*; it needs to be 3 finite numbers"):
        frame_of(ratios_of(4, HEIGHT, WIDTH), origin=[0.0, 0.0])


KNOWN = rp.Prior(camera_near=[1.0, 2.0, 3.0], camera_near_sigma_m=0.5, up=[0.0, 0.0, 1.0], up_sigma_deg=3.0)


def level(heading: float, center: Any = (1.0, 2.0, 3.0), tilt_deg: float = 0.0) -> rp.Pose:
    """An upright camera in a place, its heading in rad, pitched by a tilt."""
    rotation = Rotation.from_rotvec([np.radians(tilt_deg), 0.0, 0.0]) * Rotation.from_euler("y", heading)
    rotation = rotation * Rotation.from_matrix([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return rp.Pose(rotation, -rotation.apply(center))


def log_at(density: _core.Density, pose: rp.Pose) -> float:
    return density.log_at(pose.rotation.as_matrix(), pose.translation)


def test_a_prior_is_a_density_of_places_and_tilts() -> None:
    density = _core.Density.of_prior(KNOWN.core)
    top = log_at(density, level(0.0))
    # Every heading is alike.
    for heading in (0.7, -2.0, 3.1):
        assert log_at(density, level(heading)) == pytest.approx(top, abs=1e-9)
    # Normal in the place along each axis, and about so in the tilt.
    for axis in range(3):
        moved = np.array([1.0, 2.0, 3.0]) + 0.8 * np.eye(3)[axis]
        assert log_at(density, level(1.0, moved)) - top == pytest.approx(-0.5 * (0.8 / 0.5) ** 2, rel=1e-6)
    for tilt_deg in (3.0, -3.0, 6.0):
        fall = log_at(density, level(0.4, tilt_deg=tilt_deg)) - top
        assert fall == pytest.approx(-0.5 * (tilt_deg / 3.0) ** 2, rel=0.02)


def test_a_density_does_not_depend_on_where_the_world_begins() -> None:
    shift = np.array([5e3, -2e3, 40.0])
    here, there = (_core.Density.of_prior(prior.core) for prior in (KNOWN, KNOWN.rebase(-shift)))
    for pose in (level(0.3), level(1.0, [1.4, 1.7, 3.2], tilt_deg=2.0)):
        assert log_at(there, pose.rebase(-shift)) == pytest.approx(log_at(here, pose), abs=1e-3)


def test_a_wider_prior_is_lower_at_its_middle_and_higher_far_out() -> None:
    sigmas = (0.25, 0.5, 1.0)
    densities = [
        _core.Density.of_prior(rp.Prior(camera_near=[1, 2, 3], camera_near_sigma_m=sigma, up=[0, 0, 1]).core)
        for sigma in sigmas
    ]
    tops = [log_at(density, level(0.0)) for density in densities]
    # By the volume that it fills.
    assert np.diff(tops) == pytest.approx([-3.0 * np.log(2.0)] * 2, abs=1e-6)
    far = [log_at(density, level(0.0, [4.0, 2.0, 3.0])) for density in densities]
    assert far == sorted(far)


def test_priors_that_say_more_are_higher_where_they_hold() -> None:
    place = rp.Prior(camera_near=[1.0, 2.0, 3.0], camera_near_sigma_m=0.5)
    upright = rp.Prior(camera_near=[1.0, 2.0, 3.0], camera_near_sigma_m=0.5, up=[0, 0, 1], up_sigma_deg=3.0)
    mounted = rp.Prior(initial=level(0.3), initial_rotation_sigma_deg=3.0, initial_center_sigma_m=0.5)
    values = [log_at(_core.Density.of_prior(prior.core), level(0.3)) for prior in (place, upright, mounted)]
    assert values == sorted(values) and np.diff(values).min() > 1.0


@pytest.mark.parametrize("prior", [rp.Prior(), rp.Prior(up=[0, 0, 1]), rp.Prior(initial=level(0.0))])
def test_a_prior_without_a_place_is_no_density(prior: rp.Prior) -> None:
    with pytest.raises(ValueError, match="prior has no place of the camera; needed camera_near"):
        _core.Density.of_prior(prior.core)


def test_student_s_density_falls_alike_on_both_sides() -> None:
    middle = level(0.8)
    density = _core.Density.student(middle.rotation.as_matrix(), middle.translation, RIGHT)
    top = log_at(density, middle)
    for axis in range(6):
        way = np.sqrt(RIGHT[axis, axis]) * np.eye(6)[axis]
        falls = [log_at(density, middle.retract(scale * way)) - top for scale in (-2.0, -1.0, 1.0, 2.0)]
        # Of 4 degrees of freedom in 6 dimensions.
        assert falls == pytest.approx([-5.0 * np.log1p(s * s / 4.0) for s in (2.0, 1.0, 1.0, 2.0)], rel=1e-6)
    wider = _core.Density.student(middle.rotation.as_matrix(), middle.translation, 4.0 * RIGHT)
    assert log_at(wider, middle) - top == pytest.approx(-6.0 * np.log(2.0))


BAD_COVARIANCES: dict[str, tuple[Any, str]] = {
    "five rows": (np.eye(5), "covariance"),
    "a negative one": (np.diag([1.0, 1.0, 1.0, 1.0, 1.0, -1.0]), "covariance"),
    "nothing": (np.zeros((6, 6)), "covariance"),
    "not finite": (np.full((6, 6), np.nan), "covariance"),
    "words": ("wide", "covariance"),
}


@pytest.mark.parametrize("case", BAD_COVARIANCES)
def test_what_is_no_covariance_is_refused(case: str) -> None:
    covariance, message = BAD_COVARIANCES[case]
    with pytest.raises(ValueError, match=message):
        _core.Density.student(np.eye(3), np.zeros(3), covariance)


def test_densities_are_asked_about_poses_alone() -> None:
    density = _core.Density.of_prior(KNOWN.core)
    with pytest.raises(ValueError, match="pose entry 0 is not finite"):
        density.log_at(np.full((3, 3), np.nan), np.zeros(3))
    with pytest.raises(ValueError, match="translation"):
        density.log_at(np.eye(3), np.zeros(4))


def test_searches_of_next_to_nothing_end() -> None:
    frame, density = frame_of(ratios_of(4, HEIGHT, WIDTH)), _core.Density.of_prior(KNOWN.core)
    start = (level(0.0).rotation.as_matrix(), level(0.0).translation)
    assert _core.search_poses([frame], density, [], 0, [0, 0, 0]) == []
    assert len(_core.search_poses([frame], density, [], 100, [5, 3, 2])) <= 2
    assert len(_core.search_poses([frame], density, [start], 0, [1, 1, 1])) <= 1
    for given in ([], [start]):
        for mode in _core.search_poses([], density, given, 10, [3, 2, 1]):
            assert mode[5] == 0
    with pytest.raises(ValueError, match="translation"):
        _core.search_poses([frame], density, [(np.eye(3), np.zeros(2))], 10, [3, 2, 1])


@pytest.mark.slow
def test_what_progress_raises_ends_a_search() -> None:
    frame, density = frame_of(ratios_of(4, HEIGHT, WIDTH)), _core.Density.of_prior(KNOWN.core)
    shares: list[float] = []

    def unwanted(share: float) -> None:
        shares.append(share)
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        _core.search_poses([frame], density, [], 1_000_000, [2_000, 400, 64], progress=unwanted)
    assert len(shares) == 1 and 0.0 <= shares[0] < 0.5


def test_spreads_go_from_wide_to_narrow() -> None:
    spreads = _core.edge_spreads()
    assert len(spreads) == 4 and list(spreads) == sorted(spreads, reverse=True)
