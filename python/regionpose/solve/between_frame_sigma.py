"""One pose from frames of a rig of which each is off as a whole (docs/math.md, section 12)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionpose.solve.rig_diagnostics import BetweenFrameSigma

Array = NDArray[np.float64]

TIMES = np.log(2.0) * np.arange(-4, 11)
"""Logarithms of how many times the frames' own deviations their scatter may be, at first."""

REACH = 4.0
"""Deviations of that logarithm which are averaged over in as many steps once it is about known."""

LEAST_KNOWN = 1e-6
"""Information below which there is none: deviations of 1,000 rad or meters."""

LEAST_VARIANCE = 1e-14
"""Of a frame that its regions hold without error: a ten-millionth of a place across, squared."""

PARTS = (slice(0, 3), slice(3, 6))
"""Rotation and place in an increment."""


class Factor(NamedTuple):
    """A Gaussian factor on the left increment x from a pose, in information form: `exp(vector . x - x . information x /
    2)`.
    """

    information: Array
    vector: Array

    @classmethod
    def about(cls, deviations: Array) -> Factor:
        """That the increment is 0, to these deviations (6,)."""
        return cls(np.diag(deviations**-2.0), np.zeros(6))

    @classmethod
    def of_posterior(cls, increment: Array, covariance: Array, deviations: Array, *, held: bool) -> Factor:
        """That of a frame, from the increment (6,) to its own pose and the covariance (6, 6) of it; where `held`, a
        prior about the increment 0 with these deviations (6,) counts in them and is taken out.
        """
        variances, axes = np.linalg.eigh(covariance / np.outer(deviations, deviations))
        known = 1.0 / np.maximum(variances, LEAST_VARIANCE)
        # A covariance with hardly any information may be wider than the prior.
        left = np.maximum(known - held, 0.0)
        vector = known * (axes.T @ (increment / deviations)) * (left > 0.0)
        scale = 1.0 / deviations
        return cls(np.outer(scale, scale) * ((axes * left) @ axes.T), scale * (axes @ vector))


class Scattered(NamedTuple):
    """The increment (6,) to the pose of all frames, its covariance (6, 6), and how the frames scatter."""

    increment: Array
    covariance: Array
    between_frame_sigma: BetweenFrameSigma


class _Averaged(NamedTuple):
    """Poses by how far frames may scatter: the weight of each scatter, its variances (n, 2) of rotation and place, the
    increments (n, 6) and their covariances (n, 6, 6).
    """

    weights: Array
    variances: Array
    increments: Array
    covariances: Array


def scattered(frames: Sequence[Factor], known: Factor) -> Scattered:
    """The pose of frames that each have an error of their own, beside what else is known of it, which leaves no
    direction free (eqs. 12.7 and 12.8).
    """
    first = _averaged(frames, known, [TIMES, TIMES])
    logs = 0.5 * np.log(first.variances) - np.log(_scales(frames))
    middle = first.weights @ logs
    # A single step of the first ones may hold all the weight.
    spread = np.maximum(np.sqrt(first.weights @ (logs - middle) ** 2), 0.5 * (TIMES[1] - TIMES[0]))
    steps = np.linspace(-REACH, REACH, len(TIMES))
    weights, variances, increments, covariances = _averaged(frames, known, middle[:, None] + np.outer(spread, steps))
    mean = weights @ increments
    away = increments - mean
    covariance = np.einsum("n,nij->ij", weights, covariances) + np.einsum("n,ni,nj->ij", weights, away, away)
    turn, shift = np.sqrt(weights @ variances).tolist()
    return Scattered(mean, 0.5 * (covariance + covariance.T), BetweenFrameSigma(float(np.degrees(turn)), shift))


def _averaged(frames: Sequence[Factor], known: Factor, logs: Sequence[Array] | Array) -> _Averaged:
    """Poses at each pair of scatters of rotation and place, given as logarithms of times the frames' own deviations."""
    pairs = np.stack([grid.ravel() for grid in np.meshgrid(*logs, indexing="ij")], axis=1)
    variances = (np.exp(pairs) * _scales(frames)) ** 2
    scatter = np.eye(6) * np.repeat(variances, 3, axis=1)[:, None, :]
    information, vector = known.information, known.vector
    # Half of Cauchy's distribution of each, by equal steps of the logarithm.
    evidence = np.sum(pairs - np.log1p(np.exp(2.0 * pairs)), axis=1)
    for frame in frames:
        blur = np.eye(6) + frame.information @ scatter
        through = np.linalg.inv(blur)
        own = through @ frame.vector
        information, vector = information + through @ frame.information, vector + own
        evidence += 0.5 * (np.einsum("i,nij,nj->n", frame.vector, scatter, own) - np.linalg.slogdet(blur)[1])
    covariances = np.asarray(np.linalg.inv(information), dtype=np.float64)
    increments = np.einsum("nij,nj->ni", covariances, vector)
    evidence += 0.5 * (np.einsum("ni,ni->n", vector, increments) - np.linalg.slogdet(information)[1])
    weights = np.exp(evidence - evidence.max())
    return _Averaged(weights / weights.sum(), variances, increments, covariances)


def _scales(frames: Sequence[Factor]) -> Array:
    """Deviations (2,) to which frames know single directions of rotation and place, the median of each: that of the
    prior of their scatter (Gelman 2006).
    """
    known = [np.median([np.linalg.eigvalsh(frame.information[part, part]) for frame in frames]) for part in PARTS]
    # Where frames have no information, how far they are off does not matter.
    return np.maximum(known, LEAST_KNOWN) ** -0.5
