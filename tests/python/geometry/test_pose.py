"""Poses from exact and drawn regions: every camera, symmetric shapes, priors, overlap errors and covariances."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import regionpose as rp
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose import _core
from regionpose.cameras import Camera
from regionpose.solve.options import EXACT_EXPOSURE
from scipy.spatial.transform import Rotation

from benchmarks.synthetic import load_templates, perspective_scene, template_named
from benchmarks.synthetic.planar import even_odd_shape

Array = NDArray[np.float64]
Rings = list[Array]

EXACT = 1e-7
"""Rotation in rad, translation in m, from exact polygons: rounding, and drawn edges 1e-3 px from the true curve."""

EDGE_POINTS = 200
"""Exact image points along each edge of a region, so that the camera's bend of an edge stays out of it."""

PINHOLE = rp.PinholeCamera(800.0, 805.0, 640.0, 480.0, width=1280, height=960)
CAMERAS = [
    (
        rp.PinholeCamera(800.0, 805.0, 640.0, 480.0, width=1280, height=960, distortion=(-0.2, 0.05, 1e-3, -5e-4)),
        [0.0, 20.0],
    ),
    (
        rp.FisheyeCamera(300.0, 301.0, 640.0, 480.0, distortion=(0.02, -0.003, 0.0, 0.0), width=1280, height=960),
        [0.0, 60.0, 100.0],
    ),
    (
        rp.cameras.OcamCamera(
            (320.0, 0.0, -1.1e-3, 1.2e-6, -2.5e-9), (640.0, 480.0), stretch=((1.0, 7e-4), (-4e-4, 1.002))
        ),
        [0.0, 100.0],
    ),
    (
        rp.cameras.UnifiedCamera(
            700.0, 700.0, 640.0, 480.0, xi=1.2, distortion=(-0.1, 0.02, 1e-3, 0.0), width=1280, height=960
        ),
        [0.0, 60.0],
    ),
]
VIEWS = [(camera, angle) for camera, angles in CAMERAS for angle in angles]


def along_edges(ring: Array, count: int = EDGE_POINTS) -> Array:
    """The ring with every edge cut into so many parts."""
    share = np.arange(count)[:, None] / count
    following = np.roll(ring, -1, axis=0)
    return np.vstack([a + share * (b - a) for a, b in zip(ring, following, strict=True)])


def image_of(camera: Camera, pose: rp.Pose, rings: Rings, count: int = EDGE_POINTS) -> rp.ImageRegion:
    """The exact image of world rings."""
    return rp.ImageRegion.from_polygon([camera.project(pose.transform(along_edges(ring, count))) for ring in rings])


def seen_at(angle_deg: float, rotation: Rotation, distance: float = 3.0) -> rp.Pose:
    """A pose that sees the world's origin so far off the axis, to the lower right."""
    off_axis = Rotation.from_rotvec(np.radians(angle_deg) * np.array([-0.6, 0.8, 0.0]))
    return rp.Pose(off_axis * rotation, off_axis.apply([0.0, 0.0, distance]))


def difference(a: rp.Pose, b: rp.Pose, anchor: Array | None = None) -> tuple[float, float]:
    """Angle (rad) between two poses, and distance between where they put a world point."""
    point = np.zeros(3) if anchor is None else anchor
    return float((a.rotation * b.rotation.inv()).magnitude()), float(
        np.linalg.norm(a.transform(point) - b.transform(point))
    )


def solved(
    camera: Camera, pose: rp.Pose, regions: list[Rings], prior: rp.Prior | None = None, **options: Any
) -> rp.PoseEstimate:
    """The estimate from the exact images of world regions."""
    images = [image_of(camera, pose, rings) for rings in regions]
    worlds = [rp.WorldRegion.from_polygon(rings) for rings in regions]
    return rp.estimate_pose(camera, images, worlds, prior=prior, solver=rp.Solver(**EXACT_EXPOSURE | options))


TURN = Rotation.from_rotvec([0.3, -0.4, 0.5])


@pytest.mark.parametrize(("camera", "angle"), VIEWS, ids=lambda value: getattr(type(value), "__name__", str(value)))
def test_exact_polygons_give_the_exact_pose(camera: Camera, angle: float) -> None:
    pose = seen_at(angle, TURN)
    estimate = solved(camera, pose, [template_named("letter_r").region()])
    assert max(difference(estimate.pose, pose)) < EXACT
    assert estimate.diagnostics.overlap_error < EXACT and estimate.diagnostics.region_overlap_errors.shape == (1,)
    assert estimate.diagnostics.converged and not estimate.diagnostics.alternatives and not estimate.warnings


def test_a_region_around_a_right_angle_off_the_axis_is_solved() -> None:
    """Some of its points are before the camera's own plane and some behind."""
    camera, _ = CAMERAS[1]
    pose = seen_at(90.0, TURN, 2.0)
    rings = template_named("key").region()
    depth = pose.transform(rings[0])[:, 2]
    assert depth.min() < 0.0 < depth.max()
    assert max(difference(solved(camera, pose, [rings]).pose, pose)) < EXACT


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(["letter_f", "hook", "shard", "uneven_window"]))
def test_any_world_frame_and_any_way_to_write_the_rings_will_do(seed: int, name: str) -> None:
    rng = np.random.default_rng(seed)
    frame, offset = Rotation.from_quat(rng.normal(size=4)), rng.uniform(-50.0, 50.0, 3)
    local = seen_at(float(rng.uniform(0.0, 15.0)), Rotation.from_rotvec(rng.uniform(-0.5, 0.5, 3)))
    pose = rp.Pose(local.rotation * frame.inv(), local.translation - (local.rotation * frame.inv()).apply(offset))
    rings = [frame.apply(ring) + offset for ring in template_named(name).region()]
    image = image_of(PINHOLE, pose, rings, 1)
    written = [np.roll(ring, rng.integers(len(ring)), axis=0)[:: rng.choice([-1, 1])] for ring in rings]
    estimate = rp.estimate_pose(
        PINHOLE, [image], [rp.WorldRegion.from_polygon(written)], solver=rp.Solver(driver="native")
    )
    rotation, translation = difference(estimate.pose, pose, offset)
    assert rotation < EXACT and translation < EXACT


def square(half: float = 0.5, width: float = 0.5) -> Array:
    """A rectangle in the world's plane z = 0."""
    return np.array([[-half, -width, 0.0], [half, -width, 0.0], [half, width, 0.0], [-half, width, 0.0]])


@pytest.mark.parametrize(
    ("name", "turns"), [("rectangle", 4), ("square", 8), ("triangle", 12), ("hexagon", 12), ("letter_z", 2)]
)
def test_a_symmetric_shape_keeps_all_its_poses(name: str, turns: int) -> None:
    """Each symmetry of the shape, a mirror being half a turn about its axis, fits as well; three corners fit twice."""
    pose = seen_at(5.0, TURN)
    estimate = solved(PINHOLE, pose, [template_named(name).region()])
    found = [estimate.pose, *(alternative.pose for alternative in estimate.diagnostics.alternatives)]
    assert len(found) == turns
    assert min(max(difference(other, pose)) for other in found) < EXACT
    # Three corners hold a pose weakly, too.
    assert [warning.code for warning in estimate.warnings if warning.code != "weak-geometry"] == ["ambiguous-pose"]
    assert estimate.warnings[0].values["others"] == turns - 1
    assert all(alternative.overlap_error < EXACT for alternative in estimate.diagnostics.alternatives)


@pytest.mark.parametrize("driver", ["scipy", "native"])
def test_an_initial_pose_chooses_among_symmetric_ones(driver: str) -> None:
    rings = [square(0.6, 0.3)]
    first = solved(PINHOLE, seen_at(5.0, TURN), [rings], driver=driver)
    rough = Rotation.from_rotvec([0.1, 0.1, -0.2])
    for pose in (first.pose, *(alternative.pose for alternative in first.diagnostics.alternatives)):
        initial = rp.Pose(rough * pose.rotation, pose.translation + np.array([0.1, -0.1, 0.2]))
        estimate = solved(PINHOLE, seen_at(5.0, TURN), [rings], driver=driver, prior=rp.Prior(initial=initial))
        assert max(difference(estimate.pose, pose)) < EXACT
        assert len(estimate.diagnostics.alternatives) == 3


def test_the_up_direction_chooses_among_symmetric_poses() -> None:
    """The world's -y is up in the image (the camera's y is down) as nearly as in no other of the four poses."""
    pose = seen_at(5.0, Rotation.from_rotvec([0.2, -0.1, 0.1]))
    rings = [square(0.6, 0.3)]
    ups = {sign: solved(PINHOLE, pose, [rings], prior=rp.Prior(up=[0.0, sign, 0.0])).pose for sign in (-1.0, 1.0)}
    for sign, found in ups.items():
        assert found.rotation.apply([0.0, sign, 0.0])[1] < -0.9
    assert difference(ups[-1.0], ups[1.0])[0] > 1.0


@pytest.mark.parametrize("seed", range(6))
def test_the_papers_start_serves_small_in_plane_errors(seed: int) -> None:
    """Turned by up to 30 deg about the optical axis and tilted by up to 20 deg from facing the camera."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_euler("zyx", rng.uniform([-30.0, -20.0, -20.0], [30.0, 20.0, 20.0]), degrees=True)
    pose = seen_at(5.0, turn)
    estimate = solved(
        PINHOLE, pose, [template_named("letter_f").region()], start="paper", prior=rp.Prior(up=[0.0, -1.0, 0.0])
    )
    assert max(difference(estimate.pose, pose)) < EXACT


def test_the_overlap_error_is_the_normalized_planes_for_a_region_near_the_axis() -> None:
    """A region with a bite, within 4 deg of the axis, where projections differ by the square of that angle."""
    ring = template_named("letter_f").region()[0] * 0.25
    pose = seen_at(1.0, TURN)
    exact = image_of(PINHOLE, pose, [ring], 20)
    bite = shapely.Point(exact.rings[0][30]).buffer(6.0)
    bitten = shapely.Polygon(exact.rings[0]).difference(bite)
    assert isinstance(bitten, shapely.Polygon)
    image = rp.ImageRegion.from_polygon(np.asarray(bitten.exterior.coords)[:-1])
    estimate = rp.estimate_pose(PINHOLE, [image], [rp.WorldRegion.from_polygon(ring)])
    observed, predicted = (
        even_odd_shape([bearings[:, :2] / bearings[:, 2:]])
        for bearings in (image.bearings(PINHOLE)[0], estimate.pose.transform(ring))
    )
    expected = observed.symmetric_difference(predicted).area / observed.area
    assert expected > 0.005
    assert estimate.diagnostics.overlap_error == pytest.approx(expected, rel=0.01)
    assert estimate.diagnostics.region_overlap_errors[0] == pytest.approx(estimate.diagnostics.overlap_error, rel=1e-12)


def test_the_overlap_error_of_several_regions_is_their_weighted_mean() -> None:
    scene = perspective_scene(1, 3)
    images = [rp.ImageRegion.from_mask(mask) for mask in scene.masks()]
    worlds = [rp.WorldRegion.from_polygon(rings) for rings in scene.regions]
    estimate = rp.estimate_pose(scene.camera, images, worlds)
    errors = estimate.diagnostics.region_overlap_errors
    assert errors.shape == (3,) and errors.min() < estimate.diagnostics.overlap_error < errors.max()


def test_regions_that_do_not_match_are_warned_of() -> None:
    """A letter is no hexagon: whatever pose comes out says so."""
    image = image_of(PINHOLE, seen_at(5.0, TURN), template_named("letter_l").region())
    try:
        estimate = rp.estimate_pose(PINHOLE, [image], [rp.WorldRegion.from_polygon(template_named("gear").region())])
    except rp.PoseError:
        return
    assert "poor-overlap" in {warning.code for warning in estimate.warnings}


def test_a_region_of_few_pixels_is_weak_geometry() -> None:
    pose = seen_at(2.0, TURN, 100.0)
    estimate = solved(PINHOLE, pose, [template_named("letter_f").region()])
    assert "weak-geometry" in {warning.code for warning in estimate.warnings}


def moved_by_hand(pose: rp.Pose, tangent: Array) -> rp.Pose:
    """`P' = exp(omega) P + tau` with scipy's exponential map."""
    turn = Rotation.from_rotvec(tangent[:3])
    return rp.Pose(turn * pose.rotation, turn.as_matrix() @ pose.translation + tangent[3:])


def test_convention_tangents_are_rotation_first_and_applied_on_the_left() -> None:
    pose, tangent = seen_at(10.0, TURN), np.array([0.1, -0.2, 0.3, 0.5, -0.6, 0.7])
    rotation, translation = _core.retract_pose(pose.rotation.as_matrix(), pose.translation, tangent)
    expected = moved_by_hand(pose, tangent)
    assert np.allclose(rotation, expected.rotation.as_matrix(), rtol=0.0, atol=1e-14)
    assert np.allclose(translation, expected.translation, rtol=0.0, atol=1e-14)
    assert np.allclose(pose.retract(tangent).matrix, expected.matrix, rtol=0.0, atol=1e-14)
    assert np.allclose(pose.local_coordinates(pose.retract(tangent)), tangent, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("system", ["plane", "sphere"])
@pytest.mark.parametrize("integration", ["boundary", "mesh"])
@pytest.mark.parametrize("whitened", [False, True])
def test_convention_derivatives_are_by_the_left_increment(system: str, integration: str, whitened: bool) -> None:
    """Central differences over poses moved by hand; whitening magnifies their rounding."""
    pose = seen_at(10.0, TURN)
    rings = template_named("key").region()
    observed = _core.ObservedRegion(image_of(PINHOLE, pose, rings).bearings(PINHOLE), 1e4)
    world = rp.WorldRegion.from_polygon(rings).core
    problem = _core.Problem([observed], [world], system=system, integration=integration)  # type: ignore[arg-type]

    search = problem.search()

    def evaluated(at: rp.Pose) -> tuple[Array, Array]:
        parts = at.rotation.as_matrix(), at.translation
        found = search.evaluate(*parts, np.zeros(6)) if whitened else problem.evaluate(*parts)
        assert found is not None
        return found

    def residual(tangent: Array) -> Array:
        return evaluated(moved_by_hand(near, tangent))[0]

    near = moved_by_hand(pose, np.array([0.01, -0.02, 0.01, 0.02, 0.01, -0.03]))
    steps = 1e-5 * np.eye(6)
    numeric = np.column_stack([(residual(step) - residual(-step)) / 2e-5 for step in steps])
    assert np.abs(evaluated(near)[1] - numeric).max() <= (1e-4 if whitened else 1e-6) * np.abs(numeric).max()


def covariance_of(pose: rp.Pose, regions: list[Rings]) -> Array:
    return solved(PINHOLE_SQUARE, pose, regions).covariance


PINHOLE_SQUARE = rp.PinholeCamera(800.0, 800.0, 640.0, 480.0)


def test_convention_covariance_is_rotation_first_and_scales_with_the_world() -> None:
    """A world ten times as large at ten times the distance looks the same: only translations grow."""
    rings = template_named("letter_f").region()
    near = covariance_of(seen_at(10.0, TURN), [rings])
    far = covariance_of(seen_at(10.0, TURN, 30.0), [[10.0 * ring for ring in rings]])
    scale = np.repeat([1.0, 10.0], 3)
    assert near.shape == (6, 6) and np.allclose(near, near.T, rtol=1e-9) and np.linalg.eigvalsh(near).min() > 0.0
    # Round-off decides to which of two sides a piece over their corner belongs.
    sizes = np.outer(*2 * [np.sqrt(np.diag(near)) * scale])
    assert np.all(np.abs(far - near * np.outer(scale, scale)) < 1e-2 * sizes)


def test_convention_covariance_is_along_the_cameras_axes() -> None:
    """Another world frame changes nothing; a camera rolled about its axis rolls both blocks with it."""
    rings = template_named("letter_f").region()
    pose = seen_at(10.0, TURN)
    covariance = covariance_of(pose, [rings])
    frame = rp.Pose(Rotation.from_rotvec([1.0, 2.0, -0.5]), np.array([3.0, -2.0, 1.0]))
    moved = rp.Pose.from_matrix(pose.matrix @ frame.inverse().matrix)
    sizes = np.outer(*2 * [np.sqrt(np.diag(covariance))])
    again = covariance_of(moved, [[frame.transform(ring) for ring in rings]])
    # Round-off decides to which of two sides a piece over their corner belongs.
    assert np.all(np.abs(again - covariance) < 1e-2 * sizes)
    roll = Rotation.from_euler("z", 70.0, degrees=True)
    rolled = covariance_of(rp.Pose(roll * pose.rotation, roll.as_matrix() @ pose.translation), [rings])
    block = np.kron(np.eye(2), roll.as_matrix())
    turned = block @ covariance @ block.T
    assert np.all(np.abs(rolled - turned) < 1e-2 * np.outer(*2 * [np.sqrt(np.diag(turned))]))


def test_convention_sigmas_are_degrees_and_meters_along_the_axes() -> None:
    estimate = solved(PINHOLE, seen_at(10.0, TURN), [template_named("letter_f").region()])
    sigma = np.sqrt(np.diag(estimate.covariance))
    assert np.allclose(estimate.sigma.rotation_deg, np.degrees(sigma[:3]))
    assert np.allclose(estimate.sigma.translation_m, sigma[3:])


def test_the_covariance_tells_the_error_of_noisy_contours() -> None:
    """Independent noise on the vertices of 40 images: squared errors are some units of the covariance."""
    rings = template_named("letter_f").region()
    pose, rng, distances = seen_at(10.0, TURN), np.random.default_rng(0), []
    exact = image_of(PINHOLE, pose, rings, 5)
    for _ in range(40):
        noisy = rp.ImageRegion.from_polygon([ring + rng.normal(0.0, 0.5, ring.shape) for ring in exact.rings])
        estimate = rp.estimate_pose(
            PINHOLE, [noisy], [rp.WorldRegion.from_polygon(rings)], solver=rp.Solver(driver="native")
        )
        turn = (pose.rotation * estimate.pose.rotation.inv()).as_rotvec()
        error = np.append(
            turn, pose.translation - estimate.pose.translation - np.cross(turn, estimate.pose.translation)
        )
        distances.append(error @ np.linalg.solve(estimate.covariance, error))
    assert 0.5 < float(np.median(distances)) < 20.0


def test_a_pose_is_camera_from_world() -> None:
    pose = rp.Pose.from_parts(TURN.as_matrix(), [1.0, 2.0, 3.0])
    point = np.array([0.3, -0.2, 0.7])
    assert np.allclose(pose.transform(point), TURN.as_matrix() @ point + [1.0, 2.0, 3.0])
    assert np.allclose(pose.matrix @ np.append(point, 1.0), np.append(pose.transform(point), 1.0))
    assert np.allclose(pose.transform(pose.camera_center), 0.0, atol=1e-14)
    assert np.allclose(pose.inverse().matrix @ pose.matrix, np.eye(4), atol=1e-14)
    assert max(difference(rp.Pose.from_matrix(pose.matrix[:3]), pose)) < 1e-14
    assert np.allclose(pose.rotation.inv().apply(-pose.translation), pose.camera_center, atol=1e-14)


def test_every_asymmetric_template_is_solved_alone() -> None:
    names = [template.name for template in load_templates("all") if not template.symmetric]
    for name in names:
        pose = seen_at(8.0, TURN)
        estimate = solved(PINHOLE, pose, [template_named(name).region()], driver="native")
        assert max(difference(estimate.pose, pose)) < EXACT, name
