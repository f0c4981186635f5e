"""A pose refined by the rest of the scene: gains where photo and cloud say enough, and nothing lost where not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, POSE, cards
from numpy.typing import NDArray
from regionpose.alignment.evidence import Evidence
from regionpose.alignment.posterior import SPREADS_PX, Posterior

Array = NDArray[np.float64]

SIGMAS = np.array([*np.radians([0.8, 0.8, 0.8]), 0.05, 0.05, 0.05])
COVARIANCE = np.diag(SIGMAS**2)


def off(seed: int) -> rp.Pose:
    """A pose as wrong as the covariance says."""
    return POSE.moved(np.random.default_rng(seed).normal(size=6) * SIGMAS)


def frame(seed: int) -> rp.SceneFrame:
    """A scene of cards."""
    photo, points = cards(seed)
    return rp.SceneFrame(photo, points, CAMERA)


def errors(pose: rp.Pose) -> Array:
    """Degrees and meters from the true pose."""
    turn = np.degrees((pose.rotation * POSE.rotation.inv()).magnitude())
    return np.array([turn, np.linalg.norm(pose.camera_center - POSE.camera_center)])


def test_poses_are_led_onto_the_edges_of_the_photo() -> None:
    before, after, sigmas = [], [], []
    for seed in range(4):
        start = off(seed)
        found = rp.refine_with_scene(start, COVARIANCE, [frame(seed)])
        assert found.refined and found.log_odds > 10.0 and found.before is start
        before.append(errors(start))
        after.append(errors(found.pose))
        error = found.pose.increment_to(POSE)
        sigmas.append(np.sqrt(error @ np.linalg.solve(found.covariance, error) / 6.0))
    # Every third pixel has a point: edges are known to some of them, a third of a degree.
    assert (np.median(after, axis=0) < 0.4 * np.median(before, axis=0)).all()
    assert (np.max(after, axis=0) < np.median(before, axis=0)).all()
    # Of unit size where deviations are those of the errors.
    assert 0.4 < np.median(sigmas) < 1.6


def test_frames_of_one_pose_are_refined_together() -> None:
    start = off(8)
    frames = [frame(seed) for seed in range(3)]
    single = rp.refine_with_scene(start, COVARIANCE, frames[:1])
    joint = rp.refine_with_scene(start, COVARIANCE, frames)
    assert len(joint.steps) == 3 and joint.log_odds > single.log_odds
    assert (np.diag(joint.covariance) < np.diag(single.covariance)).all()
    assert (errors(joint.pose) < 0.5 * errors(start)).all()
    assert joint.chance < 0.5 * joint.log_odds


@pytest.mark.parametrize("seed", range(4))
def test_another_photo_leaves_the_pose_as_it_is(seed: int) -> None:
    photo, _ = cards(seed)
    _, points = cards(seed + 10)
    start = off(seed)
    found = rp.refine_with_scene(start, COVARIANCE, [rp.SceneFrame(photo, points, CAMERA)])
    assert not found.refined and found.pose is start and (found.covariance == COVARIANCE).all()
    assert found.turned_deg == 0.0 and found.moved_m == 0.0


def test_a_pose_that_is_known_well_stays() -> None:
    known = 1e-4 * COVARIANCE
    found = rp.refine_with_scene(POSE, known, [frame(0)])
    assert found.turned_deg < 0.02 and found.moved_m < 2e-3
    # Edges are known far less well: they add nothing to it, and leave its covariance as large as it was.
    assert found.refined
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), np.sqrt(np.diag(known)), rtol=0.05)


def test_a_wider_prior_leaves_what_the_edges_hold() -> None:
    # Three times as wide, a tenth of the deviations moves edges by several times their spread.
    wide = np.diag(np.repeat([3.0, 1.0], 3)) ** 2 @ COVARIANCE
    narrow, wider = (rp.refine_with_scene(POSE, given, [frame(0)]) for given in (COVARIANCE, wide))
    assert narrow.refined and wider.refined
    deviations = [np.degrees(np.sqrt(np.linalg.eigvalsh(each.covariance[:3, :3]))) for each in (narrow, wider)]
    assert (deviations[1] < 1.5 * deviations[0]).all()


def searched(seed: int, widened: float, known: Sequence[rp.Pose] = ()) -> tuple[float, float]:
    """About a pose as wrong as a wider prior says: the mass of the best maximum, and degrees from the true pose."""
    sigmas = widened * SIGMAS
    start = POSE.moved(np.random.default_rng(seed).normal(size=6) * sigmas)
    evidence = Evidence(frame(seed), start)
    share = evidence.share(SPREADS_PX[-1])
    evidence.move_to(start)
    peaks = Posterior(start, np.diag(sigmas), [evidence], [share]).peaks(known)
    best = max(peaks, key=lambda peak: peak.mass)
    return best.mass, float(errors(best.pose)[0])


def test_a_wide_prior_is_searched() -> None:
    assert sum(searched(seed, 3.0)[1] < 1.0 for seed in range(12)) >= 8


@pytest.mark.parametrize("seed", [2, 4])
def test_steps_are_seen_from_where_they_lead_to(seed: int) -> None:
    # From degrees and decimeters beside the true pose other steps are seen, and these alone lead a degree or two past.
    sigmas = 3.0 * SIGMAS
    start = POSE.moved(np.random.default_rng(seed).normal(size=6) * sigmas)
    found = rp.refine_with_scene(start, np.diag(sigmas**2), [frame(seed)])
    mass, error = searched(seed, 3.0)
    assert found.refined and found.log_odds > mass + 9.0
    assert errors(found.pose)[0] < 0.5 and error > 0.8


def test_a_known_maximum_is_one_of_them() -> None:
    # Few of the poses drawn within 7 deg and 0.4 m are near the one that the edges show.
    (missed, _), (mass, error) = searched(6, 8.0), searched(6, 8.0, [POSE])
    assert mass > missed + 10.0 and error < 0.5


def test_nothing_in_view_leaves_the_pose_as_it_is() -> None:
    photo, points = cards(0)
    for cloud in (points[:3], np.full((5, 3), np.nan), np.zeros((0, 3))):
        found = rp.refine_with_scene(POSE, COVARIANCE, [rp.SceneFrame(photo, cloud, CAMERA)])
        assert not found.refined and found.steps == (0,)
    assert not rp.refine_with_scene(POSE, COVARIANCE, []).refined


def test_where_the_world_lies_does_not_matter() -> None:
    photo, points = cards(1)
    place = np.array([431_999.0, 5_400_000.0, 119.0])
    far = rp.Pose(POSE.rotation, POSE.translation - POSE.rotation.apply(place))
    step = POSE.increment_to(off(2))
    here = rp.refine_with_scene(POSE.moved(step), COVARIANCE, [rp.SceneFrame(photo, points, CAMERA)])
    there = rp.refine_with_scene(far.moved(step), COVARIANCE, [rp.SceneFrame(photo, points + place, CAMERA)])
    # Rounding moves points across the cells in which the nearest one counts.
    assert np.linalg.norm((there.pose.camera_center - place) - here.pose.camera_center) < 0.01


def test_regions_that_the_pose_comes_from_are_left_out() -> None:
    photo, points = cards(2)
    few = points[:: len(points) // 4000]
    whole = rp.ImageRegion.from_polygon([[100.0, 100.0], [400.0, 100.0], [400.0, 300.0], [100.0, 300.0]])
    all_over = Evidence(rp.SceneFrame(photo, few, CAMERA), POSE)
    beside = Evidence(rp.SceneFrame(photo, few, CAMERA, [whole]), POSE)
    assert 0 < beside.count < all_over.count < 2000


def test_a_covariance_that_is_none_is_named() -> None:
    with pytest.raises(ValueError, match=r"covariance has shape \(3, 3\); needed \(6, 6\)"):
        rp.refine_with_scene(POSE, np.eye(3), [frame(0)])
    with pytest.raises(ValueError, match="covariance has negative eigenvalues"):
        rp.refine_with_scene(POSE, -np.eye(6), [frame(0)])


def test_increments_lead_from_pose_to_pose() -> None:
    other = off(3)
    np.testing.assert_allclose(POSE.moved(POSE.increment_to(other)).matrix, other.matrix, atol=1e-12)
