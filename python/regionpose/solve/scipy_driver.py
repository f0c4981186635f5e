"""The final least squares by scipy: MINPACK on the core's equations."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionpose import _core

Array = NDArray[np.float64]

TOLERANCE = 1e-11
"""Relative change of cost and pose at which the scipy driver stops, as the native one."""

GRADIENT_TOLERANCE = 1e-15
"""Cosine between residual and Jacobian at which the scipy driver stops: MINPACK takes no zero."""

MOST_EVALUATIONS = 140
"""Evaluations of the equations for one minimum, as of the native driver."""

TERMINATIONS = {
    1: "the cost changes less than the tolerance",
    2: "the pose changes less than the tolerance",
    3: "cost and pose change less than the tolerance",
    4: "the gradient is zero",
}
"""What ended an iteration that converged, by MINPACK's code, in the words of the native driver."""

OUT_OF_VIEW = 1e6
"""Residual where a region leaves the view, so that the step there is refused."""


def scipy_minimum(search: _core.Search, rotation: Array, translation: Array) -> _core.Minimum:
    """The whitened minimum that scipy's Levenberg-Marquardt (MINPACK) reaches by one left increment of a candidate."""
    # Loaded when first used: batches and the native driver do without.
    from scipy.optimize import leastsq

    increments = _Increments(search, rotation, translation)
    if increments.out_of_view:
        return _core.Minimum(rotation, translation, np.inf, False, "a region left the view", 1)
    counted, _, details, message, code = leastsq(
        increments.residual,
        increments.unit,
        Dfun=increments.jacobian,
        full_output=True,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=GRADIENT_TOLERANCE,
        maxfev=MOST_EVALUATIONS,
    )
    pose = _core.retract_pose(rotation, translation, counted - increments.unit)
    cost, termination = float(details["fvec"] @ details["fvec"]), TERMINATIONS.get(code, " ".join(message.split()))
    return _core.Minimum(*pose, cost, code in TERMINATIONS, termination, int(details["nfev"]))


class _Increments:
    """The whitened equations as functions of one left increment (6,) of a pose, counted from `unit`.

    The unit is a radian about each axis and the distance along each, so that the solver's relative tolerance means
    those.
    """

    def __init__(self, search: _core.Search, rotation: Array, translation: Array) -> None:
        first = search.evaluate(rotation, translation, np.zeros(6))
        distance = search.distance(rotation, translation)
        self.unit = np.array([1.0, 1.0, 1.0, distance, distance, distance])
        self._at, self._evaluation = self.unit.tobytes(), first
        self._search, self._start = search, (rotation, translation)
        self.out_of_view = first is None
        self._count = 0 if first is None else len(first[0])

    def residual(self, counted: Array) -> Array:
        """Residuals (m,), large where a region is out of view."""
        evaluation = self._evaluated(counted)
        return np.full(self._count, OUT_OF_VIEW) if evaluation is None else evaluation[0]

    def jacobian(self, counted: Array) -> Array:
        """Derivatives (m, 6) by the increment."""
        evaluation = self._evaluated(counted)
        return np.zeros((self._count, 6)) if evaluation is None else evaluation[1]

    def _evaluated(self, counted: Array) -> tuple[Array, Array] | None:
        # As bytes: numpy takes longer to compare six numbers than to copy them.
        at = counted.tobytes()
        if at != self._at:
            self._at = at
            self._evaluation = self._search.evaluate(*self._start, counted - self.unit)
        return self._evaluation
