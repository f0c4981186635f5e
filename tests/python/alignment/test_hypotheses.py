"""Explanations of photos and clouds: what they weigh, which are one cluster, and what follows for a pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, PLACES, POSE, SHAPE, turned
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose.alignment.hypotheses import Hypothesis, clusters_of, confidences_of, priors_of
from regionpose.alignment.odds import SHARED_ERROR_PRIOR
from regionpose.solve.edge_diagnostics import EdgeMode
from regionpose.solve.estimate import Alternative

Array = NDArray[np.float64]

TIGHT = np.diag([1e-4] * 3 + [1e-3] * 3) ** 2


def estimate_of(shares: list[float]) -> rp.PoseEstimate:
    """Answers that are turned by 0, 30, 60... degrees, known to a hundredth of a degree."""
    images = [rp.ImageRegion.from_polygon(CAMERA.project(SHAPE + place)) for place in PLACES]
    worlds = [rp.WorldRegion.from_polygon(POSE.inverse().transform(SHAPE + place)) for place in PLACES]
    whole = rp.estimate_pose(CAMERA, images, worlds)
    others = [
        Alternative(turned(30.0 * number), TIGHT, share, share, 0.01, np.zeros(2))
        for number, share in enumerate(shares[1:], start=1)
    ]
    diagnostics = replace(whole.diagnostics, mode_probability=shares[0], alternatives=tuple(others))
    return replace(whole, covariance=TIGHT, diagnostics=diagnostics)


WHOLE = estimate_of([1.0])


def with_shares(shares: list[float]) -> rp.PoseEstimate:
    others = [
        Alternative(turned(30.0 * number), TIGHT, share, share, 0.01, np.zeros(2))
        for number, share in enumerate(shares[1:], start=1)
    ]
    diagnostics = replace(WHOLE.diagnostics, mode_probability=shares[0], alternatives=tuple(others))
    return replace(WHOLE, diagnostics=diagnostics)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 1.0), st.booleans()), min_size=1, max_size=5))
def test_answers_leave_room_for_a_mistake_of_all_and_hidden_regions_cost_nine_to_one(
    answers: list[tuple[float, bool]],
) -> None:
    shares = np.array([share for share, _ in answers])
    shares /= max(1.0, shares.sum())
    priors = priors_of(with_shares(shares.tolist()), [hides for _, hides in answers])
    assert (priors >= 0.0).all() and priors.sum() <= 1.0 - SHARED_ERROR_PRIOR + 1e-12
    factors = np.where([hides for _, hides in answers], 1.0 / 9.0, 1.0)
    # Odds of answer to answer are those before, by what is hidden.
    np.testing.assert_allclose(priors * (shares * factors).sum(), priors.sum() * shares * factors, atol=1e-7)
    if priors.sum() < 1.0 - SHARED_ERROR_PRIOR - 1e-9:
        none = 1.0 - shares.sum()
        np.testing.assert_allclose(priors * none, (1.0 - priors.sum()) * shares * factors, atol=1e-7)


def hypothesis_at(degrees: float, log_weight: float, *, by_edges: bool = False) -> Hypothesis:
    pose = turned(degrees)
    mode = EdgeMode(pose, TIGHT, log_weight, 0.0, 10) if by_edges else None
    return Hypothesis(pose, TIGHT, log_weight, None if by_edges else 0, mode)


def test_clusters_are_five_degrees_wide_and_add_up() -> None:
    given_ones = [hypothesis_at(0.0, 0.0), hypothesis_at(40.0, 1.0), hypothesis_at(3.0, 2.0), hypothesis_at(-1.0, 0.5)]
    first, second = clusters_of(given_ones)
    assert first.best is given_ones[2] and len(first.hypotheses) == 3 and second.best is given_ones[1]
    assert first.log_weight == pytest.approx(np.log(np.exp([0.0, 2.0, 0.5]).sum()))
    shares = confidences_of([first, second], 3.0)
    weights = np.exp([first.log_weight, second.log_weight])
    np.testing.assert_allclose(shares, weights / (weights.sum() + 3.0))
    np.testing.assert_allclose(confidences_of([first, second], 0.0).sum(), 1.0)


def test_a_pose_passes_from_one_explanation_to_another_without_a_jump() -> None:
    exposure = np.diag([1e-6] * 6)
    silent = hypothesis_at(0.0, 0.0)
    for log_weight, share in ((-40.0, 0.0), (0.0, 0.5), (40.0, 1.0)):
        (cluster,) = clusters_of([silent, hypothesis_at(1.0, log_weight - 1e-9, by_edges=True)])
        way = np.radians(1.0) if log_weight <= 0.0 else -np.radians(1.0)
        apart = share if log_weight <= 0.0 else 1.0 - share
        covariance = cluster.covariance(exposure)
        expected = TIGHT + share * exposure
        expected[1, 1] += apart * way**2
        np.testing.assert_allclose(np.diag(covariance)[:3], np.diag(expected)[:3], rtol=1e-6, atol=1e-12)
