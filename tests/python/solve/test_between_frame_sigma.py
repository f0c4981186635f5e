"""Errors of whole frames: the pose and covariance that allow for them, against independent ways to the same numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose.solve.between_frame_sigma import Factor, scattered
from scipy.linalg import block_diag
from scipy.stats import chi2

Array = NDArray[np.float64]

NOTHING = Factor(np.zeros((6, 6)), np.zeros(6))
UNITS = np.array([2e-3, 2e-3, 2e-3, 0.02, 0.02, 0.02])
"""Deviations of drawn frames, rad and meters."""
LOCAL = np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0])


def covariance_of(generator: np.random.Generator) -> Array:
    """A covariance (6, 6) of about the drawn frames' deviations."""
    root = UNITS[:, None] * generator.normal(size=(6, 8)) / np.sqrt(8.0)
    return np.asarray(root @ root.T)


def factor_of(place: Array, covariance: Array) -> Factor:
    """What a frame with its pose at an increment says."""
    information = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    return Factor(information, information @ place)


def by_all_numbers(places: Array, covariances: list[Array], known: Array) -> tuple[Array, Array]:
    """The same mean and covariance from the normal distribution of all frames' numbers at once.

    Their common part has the covariance `known` about 0; each pair of scatters counts by its density and by what is
    thought of it beforehand.
    """
    count = len(places)
    scales = [
        np.median([np.linalg.eigvalsh(np.linalg.inv(c)[p, p]) for c in covariances]) ** -0.5
        for p in (slice(3), slice(3, 6))
    ]
    common = np.kron(np.ones((count, count)), known)
    found = []
    for turn in np.geomspace(0.02, 200.0, 24):
        for shift in np.geomspace(0.02, 200.0, 24):
            variances = [(times * scale) ** 2 for times, scale in zip((turn, shift), scales, strict=True)]
            beforehand = np.log([times / (1.0 + times**2) for times in (turn, shift)]).sum()
            whole = common + block_diag(*(c + np.diag(np.repeat(variances, 3)) for c in covariances))
            root = np.linalg.cholesky(whole)
            white = np.linalg.solve(root, np.column_stack([places.ravel(), np.tile(known, count).T]))
            density = beforehand - 0.5 * white[:, 0] @ white[:, 0] - np.log(np.diag(root)).sum()
            found.append((density, white[:, 1:].T @ white[:, 0], known - white[:, 1:].T @ white[:, 1:]))
    weights = np.exp(np.array([density for density, _, _ in found]) - max(density for density, _, _ in found))
    weights /= weights.sum()
    means = np.array([mean for _, mean, _ in found])
    mean = weights @ means
    spread = np.einsum("n,ni,nj->ij", weights, means - mean, means - mean)
    return mean, np.einsum("n,nij->ij", weights, np.array([held for _, _, held in found])) + spread


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 3))
def test_pose_and_covariance_are_those_of_all_numbers_at_once(seed: int, count: int) -> None:
    generator = np.random.default_rng(seed)
    covariances = [covariance_of(generator) for _ in range(count)]
    places = 2.0 * UNITS * generator.normal(size=(count, 6))
    known = np.diag((5.0 * UNITS) ** 2)
    factors = [factor_of(place, c) for place, c in zip(places, covariances, strict=True)]
    found = scattered(factors, factor_of(np.zeros(6), known))
    mean, covariance = by_all_numbers(places, covariances, known)
    deviations = np.sqrt(np.diag(covariance))
    assert np.abs((found.increment - mean) / deviations).max() < 0.02
    assert np.abs((found.covariance - covariance) / np.outer(deviations, deviations)).max() < 0.05


@given(st.integers(0, 2**32 - 1))
def test_a_prior_that_counts_in_a_posterior_is_taken_out(seed: int) -> None:
    generator = np.random.default_rng(seed)
    said = factor_of(UNITS * generator.normal(size=6), covariance_of(generator))
    covariance = np.asarray(np.linalg.inv(said.information + np.diag(LOCAL**-2.0)), dtype=np.float64)
    found = Factor.of_posterior(covariance @ said.vector, covariance, LOCAL, held=True)
    scale = np.outer(UNITS, UNITS)
    np.testing.assert_allclose(scale * found.information, scale * said.information, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(UNITS * found.vector, UNITS * said.vector, rtol=1e-6, atol=1e-6)


def test_a_frame_that_is_held_without_error_has_a_finite_factor() -> None:
    found = Factor.of_posterior(np.zeros(6), np.zeros((6, 6)), LOCAL, held=True)
    assert np.isfinite(found.information).all()
    pose = scattered([found, found], Factor.about(LOCAL))
    assert np.isfinite(pose.covariance).all() and np.sqrt(np.diag(pose.covariance) / LOCAL**2).max() < 1e-6


def test_a_posterior_wider_than_its_prior_says_nothing_there() -> None:
    covariance = np.diag(np.concatenate([UNITS[:5] ** 2, [4.0]]))
    found = Factor.of_posterior(np.full(6, 1e-3), covariance, LOCAL, held=True)
    assert found.information[5, 5] == found.vector[5] == 0.0
    assert np.linalg.matrix_rank(LOCAL[:, None] * found.information * LOCAL) == 5


@pytest.mark.slow
@pytest.mark.parametrize(("count", "times"), [(2, 0.0), (2, 5.0), (4, 1.0), (4, 5.0)])
def test_true_poses_lie_in_the_ellipsoid_however_far_frames_are_off(count: int, times: float) -> None:
    """Of frames that are off by so many times their deviations, 70 of 100 true poses or more lie in that of 90 %: how
    far two frames scatter is known to a factor. The scatter of many is found.
    """
    generator = np.random.default_rng(5)
    inside = 0
    for _ in range(300):
        covariances = [covariance_of(generator) for _ in range(count)]
        places = [
            np.linalg.cholesky(c) @ generator.normal(size=6) + times * UNITS * generator.normal(size=6)
            for c in covariances
        ]
        found = scattered([factor_of(p, c) for p, c in zip(places, covariances, strict=True)], NOTHING)
        squared = found.increment @ np.linalg.solve(found.covariance, found.increment)
        inside += bool(squared < chi2.ppf(0.9, 6))
    assert inside / 300 > (0.7 if times else 0.95)
    covariances = [covariance_of(generator) for _ in range(60)]
    off = [np.linalg.cholesky(c) @ generator.normal(size=6) for c in covariances]
    places = [place + times * UNITS * generator.normal(size=6) for place in off]
    many = scattered([factor_of(p, c) for p, c in zip(places, covariances, strict=True)], NOTHING).between_frame_sigma
    turn, shift = np.radians(many.rotation_sigma_deg) / UNITS[0], many.center_sigma_m / UNITS[3]
    assert abs(turn - times) < 0.2 + 0.15 * times and abs(shift - times) < 0.2 + 0.15 * times


def test_a_direction_that_frames_leave_free_is_as_known_as_beforehand() -> None:
    line = Factor(np.diag([1e6, 1e6, 1e6, 1e4, 1e4, 0.0]), np.zeros(6))
    found = scattered([line, line], Factor.about(LOCAL))
    assert found.covariance[5, 5] == pytest.approx(LOCAL[5] ** 2)
    assert np.sqrt(np.diag(found.covariance)[:5]) == pytest.approx(
        np.sqrt(np.diag(line.information)[:5] ** -1.0), rel=0.5
    )
