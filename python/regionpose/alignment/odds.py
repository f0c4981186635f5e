"""Prior probabilities and decision thresholds of the hypotheses about photo and cloud (docs/math.md, section 18)."""

from __future__ import annotations

import numpy as np

DECISIVE = float(np.log(9.0))
"""Logarithm of the odds from which on they decide, for a pose or against it or between two: a convention, 90 %."""

SHARED_ERROR_PRIOR = float(1.0 / (1.0 + np.exp(2.0 * DECISIVE)))
"""Least probability that all regions share a mistake, such as a wrong frame, at which they fit as well, and that of a
wrong calibration: that at which odds that decide against a pose leave it a confidence of 90 % at most, less than it
needs."""

HIDDEN = -DECISIVE
"""Logarithm of the odds that a pose has which hides one of its regions: a convention. None of 104 right poses does, and
13 % of 964 wrong ones (`python -m benchmarks.visibility`): the odds are these if something that the photo does not show
stands before a region in one cloud of 70."""

UNINFORMATIVE_PRIOR = 0.1
"""Probability that the edges of any photo and cloud are uninformative at a right solution of regions: of 21 true
poses one has log odds below 0 (`python -m benchmarks.agreement`), by Laplace's rule of succession."""

CHANCE_PRIOR = 0.5
"""Probability that photo and cloud agree at no pose of a prior, as those of different scenes: a convention."""
