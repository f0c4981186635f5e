"""Cameras: round trips, exact cases, folds, what is not visible, and bad parameters."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from regionpose.cameras import Camera, FisheyeCamera, FovCamera, OcamCamera, PinholeCamera, UnifiedCamera

DATA = Path(__file__).parents[4] / "shared" / "data"
WIDTH, HEIGHT = 1280, 960
CENTER = (640.25, 479.5)

ROUND_TRIP = 1e-9
"""Pixels: the rounding of a pixel coordinate, 1e-13, with room for the condition of strong distortion."""

INSIDE = 0.999
"""Share of the largest radius or angle of a model up to which its inverse is well conditioned."""

CAMERAS = [
    PinholeCamera(900.0, 910.0, *CENTER),
    PinholeCamera(900.0, 910.0, *CENTER, distortion=(-0.3, 0.1, 1e-3, -2e-3)),
    PinholeCamera(500.0, 510.0, *CENTER, distortion=(-0.3, 0.02, 0.0, 0.0)),
    PinholeCamera(500.0, 510.0, *CENTER, distortion=(-0.3, 0.02, 1e-2, -2e-2, -0.02)),
    PinholeCamera(500.0, 510.0, *CENTER, distortion=(0.3, 0.02, 0.1, 0.1, 0.1)),
    PinholeCamera(500.0, 510.0, *CENTER, distortion=(0.3, 0.02, 0.01, -0.02, 0.1, 0.5, 0.1, 0.01)),
    PinholeCamera(500.0, 510.0, *CENTER, distortion=(0.1, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0)),
    PinholeCamera(500.0, 510.0, *CENTER, distortion=(0.1, 0.0, 0.001, 0.0, 0.0, -0.5, 0.0, 0.0)),
    PinholeCamera(600.0, 600.0, *CENTER, distortion=(4.925, 158.936, -0.003, -0.001, -33.028, 4.847, 160.036, -34.213)),
    FisheyeCamera(250.0, 255.0, *CENTER),
    FisheyeCamera(300.0, 310.0, *CENTER, distortion=(0.05, -0.01, 0.002, -0.001)),
    FisheyeCamera(280.0, 281.0, *CENTER, distortion=(0.1, 0.02, 0.003, 0.001)),
    OcamCamera((320.0, 0.0, -1.1e-3, 1.2e-6, -2.5e-9), CENTER, stretch=((1.0, 7e-4), (-4e-4, 1.002))),
    OcamCamera((400.0,), CENTER),
    OcamCamera((300.0, 0.2, -5e-4), CENTER, stretch=((0.9, 0.1), (0.05, 1.1))),
    UnifiedCamera(700.0, 710.0, *CENTER, xi=0.0, distortion=(-0.2, 0.05, 1e-3, 1e-3)),
    UnifiedCamera(700.0, 710.0, *CENTER, xi=0.7),
    UnifiedCamera(600.0, 610.0, *CENTER, xi=1.0, distortion=(-0.2, 0.05, 1e-3, 1e-3)),
    UnifiedCamera(900.0, 910.0, *CENTER, xi=1.8, distortion=(-0.1, 0.02, 1e-3, -1e-3, 0.001)),
    PinholeCamera(700.0, 710.0, *CENTER, distortion=(-0.2, 0.05, 1e-3, -2e-3, 0, 0, 0, 0, 4e-3, -2e-3, -3e-3, 1e-3)),
    PinholeCamera(700.0, 710.0, *CENTER, distortion=(-0.2, 0.05, 1e-3, 0, 0, 0, 0, 0, 0.01, 0, 0, 0.02, 0.04, -0.06)),
    PinholeCamera(700.0, 710.0, *CENTER, distortion=(*(0.0,) * 12, 0.1, 0.2)),
    FovCamera(600.0, 610.0, *CENTER, omega=0.95),
    FovCamera(600.0, 610.0, *CENTER, omega=2.5),
]


def image_grid(step: float = 16.0) -> np.ndarray:
    """Pixels (n, 2) over the whole image, its border, the center and a point next to the center."""
    u, v = np.meshgrid(np.arange(-0.5, WIDTH, step), np.arange(-0.5, HEIGHT, step))
    corner = [WIDTH - 0.5, HEIGHT - 0.5]
    return np.vstack([np.stack([u.ravel(), v.ravel()], axis=1), [corner, CENTER, np.add(CENTER, 1e-7)]])


def angles_off_axis(bearings: np.ndarray) -> np.ndarray:
    """Angles to the z axis, in radians."""
    angles: np.ndarray = np.arctan2(np.hypot(bearings[:, 0], bearings[:, 1]), bearings[:, 2])
    return angles


def directions(angles: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Unit vectors at `angles` off the axis, turned by `turns` about it."""
    sine = np.sin(angles)
    return np.stack([sine * np.cos(turns), sine * np.sin(turns), np.cos(angles)], axis=1)


def assert_round_trip(camera: Camera, pixels: np.ndarray) -> np.ndarray:
    """Pixels with a bearing come back from it; returns the bearings."""
    bearings = camera.bearings(pixels)
    seen = np.isfinite(bearings[:, 0])
    inner = seen.copy()
    inner[seen] = angles_off_axis(bearings[seen]) <= camera.max_angle
    assert np.allclose(np.linalg.norm(bearings[seen], axis=1), 1.0, rtol=0.0, atol=1e-14)
    if isinstance(camera, OcamCamera):
        offsets = (pixels - camera.center) @ np.linalg.inv(camera.stretch).T
        inner &= np.hypot(*offsets.T) <= INSIDE * camera._rho_limit
    assert np.abs(camera.project(bearings[inner]) - pixels[inner]).max(initial=0.0) <= ROUND_TRIP
    return bearings


@pytest.mark.parametrize("camera", CAMERAS, ids=repr)
def test_pixels_come_back_from_their_bearings(camera: Camera) -> None:
    bearings = assert_round_trip(camera, image_grid())
    assert np.isfinite(bearings[:, 0]).mean() > 0.2
    assert np.allclose(bearings[-2], [0.0, 0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("camera", CAMERAS, ids=repr)
def test_directions_come_back_from_their_pixels(camera: Camera) -> None:
    random = np.random.default_rng(3)
    rays = directions(random.uniform(0.0, INSIDE * camera.max_angle, 500), random.uniform(0.0, 2.0 * np.pi, 500))
    pixels = camera.project(rays * random.uniform(0.01, 100.0, (500, 1)))
    assert np.isfinite(pixels).all()
    assert np.allclose(camera.bearings(pixels), rays, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("camera", CAMERAS, ids=repr)
def test_nothing_is_visible_beyond_the_largest_angle(camera: Camera) -> None:
    turns = np.linspace(0.0, 6.0, 50)
    for share in (0.001, 0.5, 0.999) if camera.max_angle < math.pi else ():
        angle = camera.max_angle + share * (math.pi - camera.max_angle)
        assert np.isnan(camera.project(directions(np.full(50, angle), turns))).all()
    assert np.isnan(camera.project([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]])).all()


FOLDED = [
    CAMERAS[2],
    CAMERAS[3],
    CAMERAS[9],
    UnifiedCamera(900.0, 910.0, *CENTER, xi=1.8),
    OcamCamera((90, 0, 0.01), CENTER),
]


@pytest.mark.parametrize("camera", FOLDED, ids=repr)
def test_pixels_beyond_the_fold_have_no_bearing(camera: Camera) -> None:
    """A ring of pixels twice as far out as the fold's image."""
    turns = np.linspace(0.0, 6.0, 50)
    rim = camera.project(directions(np.full(50, INSIDE * camera.max_angle), turns))
    assert np.isfinite(camera.bearings(rim)).all()
    assert np.isnan(camera.bearings(2.0 * rim - CENTER)).all()


# Rounded: a coefficient of 1e-315 bends a camera only at radii that no float holds.
coefficient = st.floats(-0.4, 0.4).map(lambda value: round(value, 6))
tangential = st.floats(-0.02, 0.02).map(lambda value: round(value, 6))
focal = st.floats(200.0, 2000.0)
distortions = st.one_of(
    st.just(()),
    st.tuples(coefficient, coefficient, tangential, tangential),
    st.tuples(coefficient, coefficient, st.just(0.0), st.just(0.0), coefficient),
    st.tuples(coefficient, coefficient, tangential, tangential, *[coefficient] * 4),
)
cameras = st.one_of(
    st.builds(lambda f, g, d: PinholeCamera(f, g, *CENTER, distortion=d), focal, focal, distortions),
    st.builds(
        lambda f, g, k: FisheyeCamera(f, g, *CENTER, distortion=k), focal, focal, st.tuples(*[st.floats(-0.1, 0.1)] * 4)
    ),
    st.builds(
        lambda a, b, c, d: OcamCamera((a, b, c / a, d / a**2), CENTER, stretch=((1.0, 0.01), (-0.02, 0.98))),
        focal,
        coefficient,
        coefficient,
        coefficient,
    ),
    st.builds(
        lambda x, f, g, d: UnifiedCamera(f, g, *CENTER, xi=x, distortion=d),
        st.floats(0.0, 3.0),
        focal,
        focal,
        distortions,
    ),
)


@settings(max_examples=150, deadline=None)
@given(camera=cameras, seed=st.integers(0, 2**32 - 1))
def test_any_camera_gives_its_pixels_back(camera: Camera, seed: int) -> None:
    random = np.random.default_rng(seed)
    bearings = assert_round_trip(camera, random.uniform((0.0, 0.0), (WIDTH, HEIGHT), (200, 2)))
    seen = bearings[np.isfinite(bearings[:, 0])]
    assert angles_off_axis(seen).max(initial=0.0) <= camera.max_angle * (1.0 + 1e-9)


@settings(max_examples=150, deadline=None)
@given(camera=cameras, seed=st.integers(0, 2**32 - 1))
def test_any_camera_sees_each_direction_once(camera: Camera, seed: int) -> None:
    """The pixel of a direction inside the largest angle has that direction as its bearing, not another branch's."""
    random = np.random.default_rng(seed)
    largest = min(0.99 * camera.max_angle, 3.0)
    rays = directions(random.uniform(0.0, largest, 100), random.uniform(0.0, 2.0 * np.pi, 100))
    pixels = camera.project(rays)
    near = np.hypot(*(pixels - CENTER).T) < 1e5
    assert np.isfinite(pixels).all()
    assert np.allclose(camera.bearings(pixels[near]), rays[near], rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("camera", CAMERAS, ids=repr)
def test_a_resized_camera_sees_what_the_photo_shows(camera: Camera) -> None:
    """A pixel u of the calibrated photo is s (u + 0.5) - 0.5 of the resized one, with the same bearing."""
    known = replace(camera, width=WIDTH, height=HEIGHT)  # type: ignore[type-var]
    smaller = known.resized(427, 320)
    factors = np.array([427 / WIDTH, 320 / HEIGHT])
    pixels = image_grid(64.0)
    moved = factors * (pixels + 0.5) - 0.5
    np.testing.assert_allclose(smaller.bearings(moved), known.bearings(pixels), rtol=0.0, atol=1e-9)
    assert (smaller.width, smaller.height) == (427, 320)


def test_a_camera_is_resized_by_one_factor_only() -> None:
    camera = PinholeCamera(500.0, 500.0, *CENTER, width=WIDTH, height=HEIGHT)
    with pytest.raises(ValueError, match="size: found 640 x 400 pixels for 1280 x 960; needed both sides"):
        camera.resized(640, 400)
    with pytest.raises(ValueError, match="camera: found no width and height"):
        PinholeCamera(500.0, 500.0, *CENTER).resized(640, 480)


def test_a_pinhole_pixel_one_focal_length_off_center_is_seen_at_45_degrees() -> None:
    camera = PinholeCamera(500.0, 400.0, 320.0, 240.0, width=640, height=480)
    half = math.sqrt(0.5)
    assert np.allclose(camera.bearings([[820.0, 240.0], [320.0, -160.0]]), [[half, 0, half], [0, -half, half]])
    assert np.allclose(camera.project([[2.0, 1.0, 4.0]]), [[570.0, 340.0]])


def test_an_equidistant_fisheye_sees_the_side_a_quarter_turn_from_the_center() -> None:
    camera = FisheyeCamera(100.0, 100.0, 0.0, 0.0)
    assert np.allclose(camera.project([[1.0, 0.0, 0.0], [0.0, -1.0, -1.0]]), [[50 * np.pi, 0], [0, -75 * np.pi]])
    assert camera.max_angle == math.pi


def test_a_fold_is_where_the_polynomial_says() -> None:
    """t (1 - t^2 / 3) stops growing at 1 rad; so does a radius r (1 - r^2 / 3) at r = 1, that is at 45 degrees."""
    assert FisheyeCamera(1, 1, 0, 0, distortion=(-1 / 3, 0, 0, 0)).max_angle == pytest.approx(1.0, abs=1e-14)
    assert PinholeCamera(1, 1, 0, 0, distortion=(-1 / 3, 0, 0, 0)).max_angle == pytest.approx(math.pi / 4, abs=1e-14)


def test_a_rational_distortion_ends_at_its_pole() -> None:
    """The denominator 1 - r^2 / 2 is zero at r = sqrt 2; the image goes to infinity there."""
    camera = PinholeCamera(1.0, 1.0, 0.0, 0.0, distortion=(0, 0, 0, 0, 0, -0.5, 0, 0))
    assert camera.max_angle == pytest.approx(math.atan(math.sqrt(2.0)), abs=1e-14)
    far = camera.bearings([[1e6, 0.0]])
    assert far[0, 0] / far[0, 2] == pytest.approx(math.sqrt(2.0), rel=1e-5)
    assert np.isnan(camera.project([[1.5, 0.0, 1.0]])).all()


def rounded(size: float) -> st.SearchStrategy[float]:
    """Coefficients up to `size`, with the digits that calibration files have."""
    return st.floats(-size, size).map(lambda value: round(value, 6))


# Calibrations fit numerators and denominators that nearly cancel, with coefficients up to hundreds, and often with a
# pole: beyond the image, or behind everything.
denominators = st.one_of(
    st.tuples(rounded(10.0), rounded(100.0), rounded(300.0)),
    st.builds(
        lambda pole, a, b: tuple(np.convolve((1.0, -1.0 / pole**2), (1.0, a, b))[1:].tolist()),
        st.floats(0.5, 30.0),
        st.floats(0.0, 30.0),
        st.floats(0.0, 100.0),
    ),
)
differences = st.tuples(rounded(0.3), rounded(1.0), rounded(2.0))


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@example(d=(18.379448867736873, 67.70653369114298, -37.609063970656635), n=(0, 0.598917, 0), p=(0, 0), seed=203290)
@given(d=denominators, n=differences, p=st.tuples(tangential, tangential), seed=st.integers(0, 2**32 - 1))
def test_rational_distortions_give_back_every_direction_that_they_show(
    d: tuple[float, ...], n: tuple[float, ...], p: tuple[float, float], seed: int
) -> None:
    """Also next to a pole, where pixels run away, and whatever the rounding of the denominator there."""
    k1, k2, k3 = np.add(d, n)
    camera = PinholeCamera(600.0, 600.0, *CENTER, distortion=(k1, k2, *p, k3, *d))
    random = np.random.default_rng(seed)
    shares = np.append(random.uniform(0.0, INSIDE, 100), 1.0 - 10.0 ** random.uniform(-5.0, -3.0, 20))
    angles = np.arctan(shares * min(math.tan(camera.max_angle), 2.0))
    rays = directions(angles, random.uniform(0.0, 2.0 * np.pi, 120))
    pixels = camera.project(rays)
    assert np.isfinite(pixels).all()
    assert np.allclose(camera.bearings(pixels), rays, rtol=0.0, atol=1e-7)


def test_the_angles_of_a_unified_camera_end_where_the_sphere_turns_away() -> None:
    """xi = 1/2 and xi = 2 both see 120 degrees off the axis; xi = 1 sees all but the direction straight back."""
    angles = [UnifiedCamera(1, 1, 0, 0, xi=xi).max_angle for xi in (0.0, 0.5, 1.0, 2.0)]
    assert np.allclose(angles, np.radians([90.0, 120.0, 180.0, 120.0]), atol=1e-14)


def test_a_polynomial_camera_folds_where_the_angle_stops_growing() -> None:
    """g = 100 + rho^2 / 100: g - rho g' = 100 - rho^2 / 100 is zero at rho = 100, where g = 200."""
    camera = OcamCamera((100.0, 0.0, 0.01), (0.0, 0.0))
    assert camera.max_angle == pytest.approx(math.atan2(100.0, 200.0), abs=1e-14)
    assert np.isnan(camera.bearings([[100.1, 0.0]])).all()
    assert np.isfinite(camera.bearings([[99.9, 0.0]])).all()
    assert np.isnan(camera.project([[1.0, 0.0, 1.9]])).all()


def test_a_parabolic_mirror_is_both_unified_and_polynomial() -> None:
    """xi = 1 sees along (x, y, (1 - x^2 - y^2) / 2)."""
    unified = UnifiedCamera(300.0, 300.0, *CENTER, xi=1.0)
    ocam = OcamCamera((150.0, 0.0, -1.0 / 600.0), CENTER)
    assert np.allclose(unified.bearings(image_grid()), ocam.bearings(image_grid()), rtol=0.0, atol=1e-13)


def test_xi_zero_and_a_constant_polynomial_are_pinhole_cameras() -> None:
    pinhole = PinholeCamera(400.0, 400.0, *CENTER).bearings(image_grid())
    assert np.allclose(UnifiedCamera(400.0, 400.0, *CENTER, xi=0.0).bearings(image_grid()), pinhole, atol=1e-14)
    assert np.allclose(OcamCamera((400.0,), CENTER).bearings(image_grid()), pinhole, atol=1e-14)


@pytest.mark.parametrize("p", [(0.01, 0.0), (0.02, -0.03), (0.0, 0.1)])
@pytest.mark.parametrize("k", [(0.0, 0.0), (-0.3, 0.02), (0.2, 0.0)])
def test_tangential_distortion_is_regular_inside_its_disc(k: tuple[float, ...], p: tuple[float, ...]) -> None:
    """Both eigenvalues of the Jacobian, by central differences, are positive inside; one is near 0 on the rim."""
    camera = PinholeCamera(1.0, 1.0, 0.0, 0.0, distortion=(*k, *p))
    radius, step = math.tan(camera.max_angle), 1e-6
    turns = np.linspace(0.0, 2.0 * np.pi, 721)
    for share in (0.3, 0.7, 0.9999):
        rim = share * radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
        columns = []
        for offset in np.eye(2) * step * radius:
            ahead, behind = (camera.project(np.c_[rim + s * offset, np.ones(721)]) for s in (1, -1))
            columns.append((ahead - behind) / (2.0 * step * radius))
        least = np.linalg.eigvalsh(np.stack(columns, axis=2)).min()
        assert least > 0.0
    assert least < 0.01 or k[0] > 0.0


@pytest.mark.parametrize("camera", CAMERAS, ids=repr)
def test_straight_lines_says_whether_lines_stay_straight(camera: Camera) -> None:
    largest = math.tan(min(0.9 * camera.max_angle, 0.8))
    ends = np.array([[-0.8 * largest, 0.3 * largest, 1.0], [0.5 * largest, 0.4 * largest, 1.0]])
    a, b, c = camera.project([ends[0], ends[1], ends.mean(axis=0)])
    bend = np.linalg.det([b - a, c - a]) / np.linalg.norm(b - a)
    assert camera.straight_lines == bool(abs(bend) < 1e-9)


@pytest.mark.parametrize("camera", CAMERAS, ids=repr)
def test_rows_that_are_not_finite_are_nan_and_leave_others_alone(camera: Camera) -> None:
    bearings = camera.bearings([[np.nan, 1.0], [640.0, 480.0], [np.inf, 0.0]])
    assert np.isnan(bearings).all(axis=1).tolist() == [True, False, True]
    pixels = camera.project([[np.nan, 0.0, 1.0], [0.1, 0.1, 1.0], [0.0, np.inf, 1.0]])
    assert np.isnan(pixels).all(axis=1).tolist() == [True, False, True]
    assert camera.bearings(np.empty((0, 2))).shape == (0, 3)
    assert camera.project(np.empty((0, 3))).shape == (0, 2)


def test_many_rows_are_mapped_like_few() -> None:
    pixels = np.random.default_rng(0).uniform(0.0, 900.0, (40000, 2))
    camera = CAMERAS[1]
    assert np.array_equal(camera.bearings(pixels)[39000:], camera.bearings(pixels[39000:]))


def test_cameras_are_values() -> None:
    camera = OcamCamera(np.array([300.0, 0.0, -1e-3]), [10, 20], stretch=np.eye(2), width=640, height=480)  # type: ignore[arg-type]
    assert camera == eval(repr(camera))
    assert hash(camera) == hash(eval(repr(camera)))
    assert PinholeCamera(1, 2, 3, 4) != PinholeCamera(1, 2, 3, 5)
    with pytest.raises(AttributeError):
        PinholeCamera(1, 2, 3, 4).fx = 3  # type: ignore[misc]


def test_the_matrix_and_the_camera_hold_the_same() -> None:
    matrix = [[500.0, 0.0, 320.0], [0.0, 510.0, 240.0], [0.0, 0.0, 1.0]]
    k = (0.1, 0.2, 0.3, 0.4)
    cameras: list[PinholeCamera | FisheyeCamera | UnifiedCamera] = [
        PinholeCamera.from_matrix(matrix, distortion=np.reshape(k, (1, 4)), width=640, height=480),
        FisheyeCamera.from_matrix(matrix, distortion=np.reshape(k, (4, 1)), width=640, height=480),
        UnifiedCamera.from_matrix(matrix, distortion=k, width=640, height=480, xi=1.2),
    ]
    assert cameras[0] == PinholeCamera(500, 510, 320, 240, width=640, height=480, distortion=k)
    assert cameras[1] == FisheyeCamera(500, 510, 320, 240, distortion=k, width=640, height=480)
    assert cameras[2] == UnifiedCamera(500, 510, 320, 240, xi=1.2, distortion=k, width=640, height=480)
    assert all(np.array_equal(camera.matrix, matrix) for camera in cameras)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PinholeCamera(0.0, 1, 0, 0), "fx: found 0.0; needed a number above 0"),
        (lambda: PinholeCamera(1, -2, 0, 0), "fy: found -2.0"),
        (lambda: PinholeCamera(1, 1, math.nan, 0), "cx: found nan; needed a finite number"),
        (lambda: PinholeCamera(1, 1, 0, "middle"), "cy: found 'middle'; needed a number"),  # type: ignore[arg-type]
        (
            lambda: PinholeCamera(1, 1, 0, 0, distortion=(1, 2, 3)),
            "distortion: found 3 coefficients; needed 0, 4, 5, 8, 12 or 14",
        ),
        (lambda: PinholeCamera(1, 1, 0, 0, distortion=(0, 0, math.inf, 0)), r"distortion\[2\]: found inf"),
        (
            lambda: PinholeCamera(1, 1, 0, 0, width=640.5, height=480),  # type: ignore[arg-type]
            "width: found 640.5; needed a whole number",
        ),
        (lambda: PinholeCamera(1, 1, 0, 0, width=640, height=0), "height: found 0; needed a whole number from 1 to"),
        (
            lambda: PinholeCamera(1, 1, 0, 0, width=10**400, height=1),
            "width: found 10000.*; needed a whole number from 1",
        ),
        (lambda: PinholeCamera.from_matrix(((1, 0.5, 0), (0, 1, 0), (0, 0, 1))), "skew of 0.5"),
        (lambda: PinholeCamera.from_matrix(np.eye(4)), r"matrix has shape \(4, 4\)"),
        (lambda: FisheyeCamera(1, 1, 0, 0, distortion=(1, 2)), "distortion: found 2 coefficients; needed 4"),
        (lambda: FisheyeCamera(1, 1, 0, 0, distortion=3), "distortion: found 3; needed a sequence of numbers"),  # type: ignore[arg-type]
        (lambda: OcamCamera((), (0, 0)), "polynomial: found no coefficients"),
        (lambda: OcamCamera((-300.0, 0.0), (0, 0)), "polynomial: found -300.0; needed a first coefficient a0 above 0"),
        (lambda: OcamCamera((1.0,), (0, 0, 0)), "center: found 3 numbers; needed 2"),
        (lambda: OcamCamera((1.0,), (0, 0), stretch=((1, 2), (2, 4))), "stretch: found .* invertible"),
        (
            lambda: OcamCamera((1.0,), (0, 0), stretch=(1, 2)),  # type: ignore[arg-type]
            r"stretch has shape \(2,\)",
        ),
        (lambda: FovCamera(1, 1, 0, 0, omega=0.0), "omega: found 0.0; needed a number above 0"),
        (lambda: FovCamera(1, 1, 0, 0, omega=3.2), "omega: found 3.2; needed an angle below pi"),
        (lambda: UnifiedCamera(1, 1, 0, 0, xi=-0.1), "xi: found -0.1; needed a number of at least 0"),
        (lambda: CAMERAS[0].bearings([1.0, 2.0, 3.0]), r"pixels has shape \(3,\); needed \(n, 2\)"),
        (lambda: CAMERAS[0].project(np.zeros((3, 2))), r"points has shape \(3, 2\); needed \(n, 3\)"),
        (lambda: CAMERAS[0].project([["a", "b", "c"]]), "points has type .* needed real numbers"),
    ],
)
def test_bad_parameters_are_named(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]


@pytest.mark.parametrize(
    "distortion",
    [
        (),
        (-0.3, 0.1, 1e-3, -2e-3),
        (-0.3, 0.1, 1e-3, -2e-3, 0.02),
        (0.3, 0.1, 1e-3, -2e-3, 0.02, 0.4, 0.1, 0.01),
        (0.3, 0.1, 1e-3, -2e-3, 0.02, 0.4, 0.1, 0.01, 0.01, -0.02, 0.03, 0.005),
        (0.3, 0.1, 1e-3, -2e-3, 0.02, 0.4, 0.1, 0.01, 0.01, -0.02, 0.03, 0.005, 0.07, -0.11),
    ],
)
def test_pinhole_pixels_are_those_of_opencv(distortion: tuple[float, ...]) -> None:
    cv2 = pytest.importorskip("cv2")
    camera = PinholeCamera(900.0, 910.0, *CENTER, distortion=distortion)
    points = np.random.default_rng(1).uniform((-2, -2, 4), (2, 2, 6), (200, 3))
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, np.array(distortion or (0.0,) * 4))
    assert np.abs(camera.project(points) - expected[:, 0]).max() < 1e-9


def doublet(center: float, width: float, shifted: float) -> tuple[float, ...]:
    """Coefficients of a rational polynomial with a zero and a pole beside one another, around a squared radius."""
    under = np.convolve((1.0, 0.4), ((center**2 + width**2), -2.0 * center, 1.0))
    over = np.convolve((1.0, 0.3), ((center**2 + width**2), -2.0 * (center + shifted), 1.0))
    (_, k4, k5, k6), (k0, k1, k2, k3) = under / under[0], over / under[0]
    assert k0 == 1.0
    return (k1, k2, 1e-3, -5e-4, k3, k4, k5, k6)


def test_a_lens_that_folds_in_a_narrow_ring_is_used_on_both_sides() -> None:
    """As numerators and denominators that nearly cancel do: over the whole image as OpenCV, but for the ring."""
    cv2 = pytest.importorskip("cv2")
    size = {"width": WIDTH, "height": HEIGHT}
    camera = PinholeCamera(1500.0, 1510.0, *CENTER, distortion=doublet(0.09, 1.2e-3, 1e-5), **size)
    assert 0.28 < math.tan(camera.max_angle) < 0.29
    slopes = np.stack(np.meshgrid(np.linspace(-0.42, 0.42, 43), np.linspace(-0.31, 0.31, 31)), axis=-1).reshape(-1, 2)
    rays = np.c_[slopes, np.ones(len(slopes))]
    expected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion))
    pixels, seen = camera.project(rays), np.isfinite(camera.project(rays)).all(axis=1)
    assert (np.hypot(*slopes[~seen].T) > 0.28).all() and (np.hypot(*slopes[~seen].T) < 0.32).all()
    assert (np.hypot(*slopes[seen].T) > 0.32).any()
    assert np.abs(pixels[seen] - expected[seen, 0]).max() < 1e-9
    assert np.allclose(camera.bearings(pixels[seen])[:, :2] / camera.bearings(pixels[seen])[:, 2:], slopes[seen])
    corners = camera.bearings([[-0.5, -0.5], [WIDTH - 0.5, HEIGHT - 0.5]])
    assert np.isfinite(corners).all()
    without = replace(camera, width=None, height=None)
    assert np.isnan(without.bearings([[-0.5, -0.5]])).all()


def test_a_fold_without_a_return_ends_the_model() -> None:
    camera = PinholeCamera(900.0, 900.0, *CENTER, distortion=(-2.0, 1.5, 0, 0), width=WIDTH, height=HEIGHT)
    assert math.tan(camera.max_angle) < 0.5
    assert np.isnan(camera.bearings([[-0.5, -0.5]])).all()


def test_fisheye_pixels_are_those_of_opencv() -> None:
    cv2 = pytest.importorskip("cv2")
    camera = FisheyeCamera(300.0, 310.0, *CENTER, distortion=(0.05, -0.01, 0.002, -0.001))
    points = np.random.default_rng(1).uniform((-9, -9, 4), (9, 9, 6), (200, 1, 3))
    expected, _ = cv2.fisheye.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion)
    )
    assert np.abs(camera.project(points[:, 0]) - expected[:, 0]).max() < 1e-9


def test_unified_pixels_are_those_of_opencv() -> None:
    cv2 = pytest.importorskip("cv2")
    if not hasattr(cv2, "omnidir"):
        pytest.skip("this OpenCV has no omnidir module")
    camera = UnifiedCamera(600.0, 610.0, *CENTER, xi=1.2, distortion=(-0.1, 0.02, 1e-3, -1e-3))
    points = np.random.default_rng(1).uniform((-9, -9, -1), (9, 9, 6), (200, 1, 3))
    expected, _ = cv2.omnidir.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, camera.xi, np.array(camera.distortion)
    )
    assert np.abs(camera.project(points[:, 0]) - expected[:, 0]).max() < 1e-9


def scenes(model: str) -> list[Path]:
    """Folders of the shared scenes taken with a camera of `model`."""
    return [
        path.parent
        for path in sorted(DATA.glob("*/*/calib.json"))
        if json.loads(path.read_text()).get("model") == model
    ]


def test_chessboard_corners_of_a_strong_fisheye_fall_where_they_were_found() -> None:
    """The published polynomial and the pose fitted to the 48 corners reproject them to about half a pixel."""
    folders = scenes("ocam_taylor")
    if not folders:
        pytest.skip("the shared scenes are not here")
    for folder in folders:
        calibration = json.loads((folder / "calib.json").read_text())
        region = json.loads((folder / "regions.json").read_text())[0]
        camera = OcamCamera(
            calibration["taylor_coefficient"],
            calibration["distortion_center_xy"],
            stretch=calibration["stretch_matrix"],
        )
        points = np.array(region["chessboard_corners_3d"]) @ np.transpose(calibration["R"]) + calibration["t"]
        errors = camera.project(points) - np.array(region["chessboard_corners_px"])
        assert math.sqrt(np.mean(np.sum(errors**2, axis=1))) == pytest.approx(calibration["pnp_rms_px"], abs=0.02)
