"""The rest of a scene as witness of a pose: agreement of photo and cloud, odds, and what a scene makes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, POSE, cards, painted, turned
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose.alignment import Photo, weighed, witnessed
from regionpose.alignment.odds import log_odds
from regionpose.alignment.photo import blurred, largest
from regionpose.estimation.answer import Alternative, PoseEstimate
from regionpose.estimation.warning import PoseWarning
from scipy.ndimage import gaussian_filter, maximum_filter

Array = NDArray[np.float64]


@pytest.mark.parametrize("seed", range(3))
def test_photo_and_cloud_agree_at_the_pose_alone(seed: int) -> None:
    photo, points = cards(seed)
    right = rp.check_alignment(photo, points, CAMERA, POSE)
    assert right.z > 3.0 and right.log_odds > 2.0 and right.share_worse == 1.0
    assert right.agrees.mean() > 0.9
    others = [rp.check_alignment(photo, points, CAMERA, turned(degrees)) for degrees in (-20.0, -10.0, 9.0, 15.0)]
    odds = [other.log_odds for other in others]
    # Single cards may fall on others' edges.
    assert (
        max(odds) < 0.5 * right.log_odds and np.median(odds) < 0.0 and max(other.z for other in others) < 0.4 * right.z
    )


def test_the_best_turn_undoes_that_of_the_pose() -> None:
    photo, points = cards(0)
    alignment = rp.check_alignment(photo, points, CAMERA, turned(0.5))
    assert np.degrees(alignment.turn) == pytest.approx([0.0, -0.5, 0.0], abs=0.3)
    assert alignment.z > 3.0


def test_where_the_world_lies_does_not_matter() -> None:
    photo, points = cards(1)
    moved = rp.Pose(POSE.rotation, POSE.translation - POSE.rotation.apply([431_999.0, 5_400_000.0, 119.0]))
    here = rp.check_alignment(photo, points, CAMERA, POSE)
    there = rp.check_alignment(photo, points + np.array([431_999.0, 5_400_000.0, 119.0]), CAMERA, moved)
    assert there.z == pytest.approx(here.z, abs=0.2)


def test_steps_beside_the_regions_are_left_out() -> None:
    photo, points = cards(2)
    whole = rp.ImageRegion.from_polygon([[100.0, 100.0], [400.0, 100.0], [400.0, 300.0], [100.0, 300.0]])
    alignment = rp.check_alignment(photo, points, CAMERA, POSE, regions=[whole])
    within = (alignment.places > [89.0, 89.0]).all(axis=1) & (alignment.places < [411.0, 311.0]).all(axis=1)
    corner = np.hypot(*(np.abs(alignment.places - [250.0, 200.0]) - [150.0, 100.0])[within].clip(0.0).T)
    assert (corner > 9.0).all()
    everywhere = rp.check_alignment(photo, points, CAMERA, POSE).places
    assert (np.abs(everywhere - [250.0, 200.0]) < [150.0, 100.0]).all(axis=1).sum() > 100


def test_a_photo_serves_more_than_one_pose_and_large_ones_are_reduced() -> None:
    image, points = cards(0)
    large = np.kron(image, np.ones((3, 3), dtype=np.uint8))
    camera = rp.PinholeCamera(1500.0, 1500.0, 959.5, 719.5, width=1920, height=1440)
    photo = Photo.of(large)
    assert photo.reduction == 2 and photo.luminance.shape == (720, 960)
    alignment = rp.check_alignment(photo, points, camera, POSE)
    assert alignment.z > 3.0 and alignment.places.max() > 960.0
    np.testing.assert_allclose(photo.pixels(photo.places(alignment.places)), alignment.places, atol=1e-9)


@pytest.mark.parametrize("shape", [(40, 53), (64, 32), (3, 7), (1, 1)])
def test_pictures_are_filtered_as_by_scipy_to_the_last_bit(shape: tuple[int, int]) -> None:
    picture = np.random.default_rng(0).uniform(size=shape).astype(np.float32)
    for spread, reach in ((2.0, 3.0), (8.0, 3.0), (30.0, 2.0)):
        np.testing.assert_array_equal(blurred(picture, spread, reach), gaussian_filter(picture, spread, truncate=reach))
    for pixels in (1, 4):
        np.testing.assert_array_equal(largest(picture, pixels), maximum_filter(picture, 2 * pixels + 1))


def test_intensity_adds_steps_where_surfaces_change_their_shade() -> None:
    photo, points, intensity = painted(0)
    by_depth = rp.check_alignment(photo, points, CAMERA, POSE)
    assert len(by_depth.places) == 0 and by_depth.log_odds == 0.0
    right = rp.check_alignment(photo, points, CAMERA, POSE, intensity=intensity)
    assert right.z > 3.0 and right.log_odds > 2.0 and right.agrees.mean() > 0.9
    scaled = rp.check_alignment(photo, points, CAMERA, POSE, intensity=4.0 - 0.25 * intensity)
    np.testing.assert_array_equal(scaled.places, right.places)
    wrong = rp.check_alignment(photo, points, CAMERA, turned(12.0), intensity=intensity)
    assert wrong.log_odds < 0.0


def test_nothing_in_view_says_nothing() -> None:
    photo, points = cards(0)
    for pose, cloud in ((turned(180.0), points), (POSE, points[:5]), (POSE, np.full((7, 3), np.nan))):
        alignment = rp.check_alignment(photo, cloud, CAMERA, pose)
        assert np.isnan(alignment.z) and np.isnan(alignment.share_worse) and alignment.log_odds == 0.0


def test_a_photo_of_one_shade_says_nothing() -> None:
    _, points = cards(0)
    alignment = rp.check_alignment(np.full((480, 640), 128, dtype=np.uint8), points, CAMERA, POSE)
    assert len(alignment.places) > 100 and np.isnan(alignment.z) and alignment.log_odds == 0.0


def test_wrong_shapes_are_named() -> None:
    photo, points = cards(0)
    with pytest.raises(ValueError, match=r"points has shape \(5, 2\); needed \(n, 3\)"):
        rp.check_alignment(photo, points[:5, :2], CAMERA, POSE)
    with pytest.raises(ValueError, match=r"image has shape \(3,\)"):
        rp.check_alignment([1.0, 0.5, 0.25], points, CAMERA, POSE)
    with pytest.raises(ValueError, match=r"intensity has shape \(4,\); needed \(\d+,\), one value a point"):
        rp.check_alignment(photo, points, CAMERA, POSE, intensity=np.ones(4))


@settings(max_examples=50, deadline=None)
@given(st.floats(0.005, 0.08), st.floats(-4.0, 4.0))
def test_odds_rise_with_the_agreement(deviation: float, z: float) -> None:
    assert log_odds((z + 0.5) * deviation, deviation) > log_odds(z * deviation, deviation) - 1e-9


def test_odds_of_a_score_like_those_of_turned_poses_speak_against_by_what_is_known() -> None:
    # The better known the turned poses' scores are, the more an unmoved one says.
    odds = [log_odds(0.0, deviation) for deviation in (0.1, 0.05, 0.02, 0.01, 0.005)]
    assert odds == sorted(odds, reverse=True) and -1.0 < odds[0] < 0.0 and odds[-1] < -3.0
    assert log_odds(0.1, 0.01) > 4.0


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-9.0, 9.0)), min_size=1, max_size=5))
def test_probabilities_follow_from_odds(answers: list[tuple[float, float]]) -> None:
    shares = np.array([share for share, _ in answers])
    before, odds = shares / max(1.0, shares.sum() / 0.99), [each for _, each in answers]
    after = weighed(before.tolist(), odds)
    assert (after >= 0.0).all() and after.sum() <= 1.0 + 1e-12
    np.testing.assert_allclose(weighed(before.tolist(), [0.0] * len(before)), before, atol=1e-12)
    # Odds of answer to answer, and of each to none of them.
    none = 1.0 - after.sum()
    np.testing.assert_allclose(after * (1.0 - before.sum()), none * before * np.exp(odds), rtol=1e-3, atol=1e-4)


def estimate(confidences: list[float], *codes: str) -> PoseEstimate:
    """Answers that are turned by 0, 90, 180... degrees."""
    first, *rest = confidences
    poses = [turned(90.0 * place) for place in range(len(confidences))]
    others = (
        Alternative(pose, np.eye(6), confidence, confidence, 0.01, np.zeros(1))
        for pose, confidence in zip(poses[1:], rest, strict=True)
    )
    warnings = tuple(PoseWarning(code, "as it was") for code in codes)
    nothing = np.zeros(1)
    return PoseEstimate(
        poses[0],
        np.eye(6),
        first,
        first,
        0.01,
        nothing,
        0.1,
        None,
        tuple(others),
        warnings,
        True,
        "",
        1,
        5.0,
        0.001,
        np.zeros(6),
    )


def alignment(lead: float) -> rp.Alignment:
    """An agreement that leads that of turned poses by so much, of a deviation of 0.005."""
    turned_scores = 0.005 * np.resize([-1.0, 1.0], 40) * np.sqrt(39.0 / 40.0)
    return rp.Alignment(np.zeros((50, 2)), np.ones(50, dtype=np.bool_), lead, np.zeros(3), turned_scores)


def heard(given: PoseEstimate, leads: list[float]) -> tuple[PoseEstimate, list[rp.Pose]]:
    """The estimate after the rest of the scene leads by so much at each answer, and the poses that it settled on."""
    settled: list[rp.Pose] = []
    answers = [given.pose, *(other.pose for other in given.alternatives)]

    def align(pose: rp.Pose) -> list[rp.Alignment | None]:
        gaps = [(pose.rotation * answer.rotation.inv()).magnitude() for answer in answers]
        return [alignment(leads[int(np.argmin(gaps))])]

    def settle(pose: rp.Pose) -> PoseEstimate:
        settled.append(pose)
        first = next(other for other in given.alternatives if np.allclose(other.pose.matrix, pose.matrix))
        rest = tuple(other for other in given.alternatives if other is not first)
        old = Alternative(given.pose, np.eye(6), given.confidence, given.share, 0.01, np.zeros(1))
        return replace(
            given, pose=first.pose, alternatives=(old, *rest), confidence=first.confidence, share=first.share
        )

    return witnessed(given, align, settle).estimate, settled


def test_the_scene_chooses_among_answers_that_fit_alike() -> None:
    after, settled = heard(estimate([0.49, 0.49], "ambiguous"), [0.0, 0.12])
    assert len(settled) == 1 and np.allclose(after.pose.matrix, turned(90.0).matrix)
    assert after.confidence > 0.9 and after.alternatives[0].confidence < 0.1
    assert after.warnings == ()


def test_a_choice_that_leaves_doubt_is_no_longer_ambiguous() -> None:
    after, settled = heard(estimate([0.4, 0.4], "ambiguous"), [0.0, 0.12])
    assert len(settled) == 1 and 0.7 < after.confidence < 0.9
    assert [warning.code for warning in after.warnings] == ["low-confidence"]
    weak, _ = heard(estimate([0.4, 0.4], "ambiguous", "weak-geometry"), [0.0, 0.12])
    assert [warning.code for warning in weak.warnings] == ["weak-geometry"]


def test_answers_near_one_another_share_what_is_said_of_the_place() -> None:
    given = estimate([0.5, 0.48], "ambiguous")
    near = replace(given.alternatives[0], pose=turned(2.0))
    after, _ = heard(replace(given, alternatives=(near,)), [0.06, 0.06])
    assert after.confidence == after.alternatives[0].confidence == pytest.approx(0.98)
    assert after.share == pytest.approx(0.5) and after.warnings == ()


def test_a_scene_that_does_not_decide_leaves_the_answers_ambiguous() -> None:
    for leads in ([0.05, 0.06], [0.0, 0.0]):
        after, _ = heard(estimate([0.45, 0.45], "ambiguous"), leads)
        assert "ambiguous" in [warning.code for warning in after.warnings]


def test_an_answer_that_the_scene_contradicts_is_warned_of() -> None:
    after, settled = heard(estimate([0.95]), [0.0])
    assert settled == [] and after.confidence < 0.5
    assert [warning.code for warning in after.warnings] == ["scene-disagrees"]
    assert "confidence falls from 95.0 %" in after.warnings[0].message


def test_agreement_never_makes_a_pose_surer_than_its_regions_do() -> None:
    after, _ = heard(estimate([0.7], "low-confidence"), [0.2])
    assert after.confidence == pytest.approx(0.7)
    assert [warning.code for warning in after.warnings] == ["low-confidence"]


def test_without_confidence_there_is_none_after_either() -> None:
    after, _ = heard(estimate([0.0, 0.0], "ambiguous"), [0.1, 0.1])
    assert after.confidence == 0.0 and [warning.code for warning in after.warnings] == ["ambiguous"]


def test_a_pose_that_only_falls_below_what_is_trusted_has_a_low_confidence() -> None:
    after, _ = heard(estimate([0.91]), [0.01])
    assert after.confidence < 0.9 and [warning.code for warning in after.warnings] == ["low-confidence"]
