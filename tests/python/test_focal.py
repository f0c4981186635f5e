"""Focal lengths that photo and cloud contradict: told, and by which factor, and right ones left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, PLACES, POSE, SHAPE, cards
from numpy.typing import NDArray
from regionpose.alignment.evidence import Evidence
from regionpose.alignment.focal import focal_evidence

Array = NDArray[np.float64]


def worlds() -> list[rp.WorldRegion]:
    """Two regions before the cards."""
    return [rp.WorldRegion.from_polygon(POSE.inverse().transform(SHAPE + place)) for place in PLACES]


def images(seed: int, noise_px: float = 0.5) -> list[rp.ImageRegion]:
    """The same as the photo shows them, by corners that are some pixels off."""
    rng = np.random.default_rng(seed)
    rings = [CAMERA.project(SHAPE + place) for place in PLACES]
    return [rp.ImageRegion.from_polygon(ring + rng.normal(0.0, noise_px, ring.shape)) for ring in rings]


def judged(camera: rp.Camera, seed: int, photo: int | None = None) -> tuple[rp.PoseEstimate, rp.FocalEvidence]:
    """The estimate with a camera, and what photo and cloud say of its focal lengths."""
    _, points = cards(seed)
    picture, _ = cards(seed if photo is None else photo)
    estimate, witness = rp.estimate_with_scene(camera, images(seed), worlds(), picture, points)
    assert witness.refinement is not None and witness.refinement.focal is not None
    return estimate, witness.refinement.focal


@pytest.mark.parametrize(("seed", "factor"), [(0, 0.78), (1, 0.85), (2, 0.93), (0, 1.15), (1, 1.25)])
def test_wrong_focal_lengths_are_told_with_the_right_ones(factor: float, seed: int) -> None:
    estimate, focal = judged(CAMERA.zoomed(factor), seed)
    assert focal.log_odds < -np.log(9.0) and focal.factor * factor == pytest.approx(1.0, abs=0.03)
    told = {warning.code: warning for warning in estimate.warnings}["focal-contradicted"]
    assert told.values["factor"] == focal.factor and f"{focal.factor:.3f} times" in told.message
    assert estimate.confidence < 0.2


@pytest.mark.parametrize("seed", range(2))
def test_right_focal_lengths_are_left_alone(seed: int) -> None:
    estimate, focal = judged(CAMERA, seed)
    assert focal.log_odds > np.log(9.0)
    assert "focal-contradicted" not in {warning.code for warning in estimate.warnings}
    # As good as a calibration is, too.
    _, near = judged(CAMERA.zoomed(1.005), seed)
    assert near.log_odds > 0.0


def test_a_photo_that_shows_none_of_the_steps_says_nothing() -> None:
    _, focal = judged(CAMERA.zoomed(0.9), 1, photo=11)
    assert focal.log_odds > 0.0


@pytest.mark.parametrize("seed", range(2))
def test_a_percent_moves_the_pose_as_it_is_told(seed: int) -> None:
    photo, points = cards(seed)

    def alone(camera: rp.Camera) -> rp.PoseEstimate:
        return rp.estimate_pose(camera, images(seed), worlds())

    def refined(camera: rp.Camera) -> rp.PoseEstimate:
        return judged(camera, seed)[0]

    told = focal_evidence(alone(CAMERA), [rp.SceneFrame(photo, points, CAMERA)], lambda camera, _: alone(camera))
    assert told is not None
    for of, focal, within in ((alone, told, 0.05), (refined, judged(CAMERA, seed)[1], 0.2)):
        shorter, longer = (of(CAMERA.zoomed(factor)).pose for factor in (0.99, 1.01))
        found = 0.5 * shorter.increment_to(longer)
        assert np.linalg.norm(focal.shift[3:] - found[3:]) < within * np.linalg.norm(found[3:])
        assert focal.shift_m == pytest.approx(
            np.linalg.norm(longer.camera_center - shorter.camera_center) / 2.0, rel=within
        )


@pytest.mark.parametrize(("seed", "factor"), [(1, 1.0), (2, 0.85)])
def test_steps_are_seen_from_where_photo_and_cloud_lead(factor: float, seed: int) -> None:
    # The regions leave a pose degrees and decimeters off, from which other steps are seen than from the true one.
    sigmas = np.array([*np.radians([2.4, 2.4, 2.4]), 0.15, 0.15, 0.15])
    off = np.random.default_rng(seed).normal(size=6) * sigmas

    def estimated(camera: rp.Camera) -> rp.PoseEstimate:
        near = rp.estimate_pose(camera, images(seed), worlds())
        return replace(near, pose=near.pose.moved(off), covariance=np.diag(sigmas**2))

    camera = CAMERA.zoomed(factor)
    scene = [rp.SceneFrame(*cards(seed), camera)]
    focal = focal_evidence(estimated(camera), scene, lambda other, _: estimated(other))
    assert focal is not None and focal.factor * factor == pytest.approx(1.0, abs=0.03)
    assert focal.log_odds > np.log(9.0) if factor == 1.0 else focal.log_odds < -np.log(9.0)


def test_a_camera_without_focal_lengths_is_not_asked() -> None:
    camera = rp.EquirectangularCamera(1000, 500)
    photo, points = np.zeros((500, 1000), dtype=np.uint8), cards(0)[1]
    estimate = rp.estimate_pose(CAMERA, images(0), worlds())
    assert focal_evidence(estimate, [rp.SceneFrame(photo, points, camera)], lambda *_: estimate) is None


@pytest.mark.parametrize("failing", [-1.0, 1.0])
def test_focal_lengths_that_show_the_regions_no_pose_are_left_out(failing: float) -> None:
    photo, points = cards(1)

    def estimated(camera: rp.Camera, pose: rp.Pose) -> rp.PoseEstimate:
        assert isinstance(camera, rp.PinholeCamera)
        if failing * (camera.fx - given.fx) > 0.0:
            raise rp.PoseError("no pose shows the regions")
        return rp.estimate_pose(camera, images(1), worlds(), prior=rp.Prior(initial=pose))

    given = CAMERA.zoomed(0.9 if failing < 0.0 else 1.1)
    estimate = rp.estimate_pose(given, images(1), worlds())
    frame = rp.SceneFrame(photo, points, given, images(1))
    focal = focal_evidence(estimate, [frame], estimated)
    assert focal is not None and focal.log_odds < -np.log(9.0)
    assert focal.factor == pytest.approx(CAMERA.fx / given.fx, abs=0.02)

    def never(camera: rp.Camera, pose: rp.Pose) -> rp.PoseEstimate:
        raise rp.PoseError("no pose shows the regions")

    assert focal_evidence(estimate, [frame], never) is None


def test_frames_of_one_pose_are_heard_together() -> None:
    camera = CAMERA.zoomed(0.9)
    estimate = rp.estimate_pose(camera, images(0), worlds())
    frames = [rp.SceneFrame(*cards(seed), camera) for seed in range(2)]

    def estimated(other: rp.Camera, pose: rp.Pose) -> rp.PoseEstimate:
        return rp.estimate_pose(other, images(0), worlds(), prior=rp.Prior(initial=pose))

    both, one = focal_evidence(estimate, frames, estimated), focal_evidence(estimate, frames[:1], estimated)
    assert both is not None and one is not None
    assert both.log_odds < one.log_odds < 0.0


@pytest.mark.parametrize(
    "camera",
    [
        CAMERA,
        replace(CAMERA, distortion=(-0.1, 0.02, 0.0, 0.0)),
        rp.FisheyeCamera(400.0, 410.0, 330.0, 236.0, width=640, height=480),
    ],
)
def test_derivatives_by_the_focal_lengths_are_those_of_differences(camera: rp.PinholeCamera | rp.FisheyeCamera) -> None:
    photo, points = cards(2)
    held = Evidence(rp.SceneFrame(photo, points, camera), POSE, with_focal=True)
    h = 1e-5
    places = []
    for end in (h, -h):
        held.move_to(POSE, end)
        places.append(held.pixels)
    held.move_to(POSE)
    by_focal = held.moved[:, [6, 13]]
    np.testing.assert_allclose(by_focal, (places[0] - places[1]) / (2.0 * h), atol=1e-3)


def test_a_factor_is_above_zero() -> None:
    zoomed = CAMERA.zoomed(1.25)
    assert (zoomed.fx, zoomed.fy, zoomed.cx, zoomed.width) == (625.0, 625.0, CAMERA.cx, 640)
    for factor in (0.0, -1.0, np.nan):
        with pytest.raises(ValueError, match="factor: found"):
            CAMERA.zoomed(factor)
