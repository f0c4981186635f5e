"""How the projected regions fit the observed ones, by the measure that counts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from regionpose.scene.estimate import SceneEstimate
from regionpose.solve.sample_fit import SampleFit


class Fit(NamedTuple):
    """Two measures. `on_their_side`: the fraction of a scan's samples that lie on their side of the observed outlines;
    it counts where regions are given as samples, and is None elsewhere. `overlap_error`: it counts there.

    A scan that knows a wall by its samples doesn't know how far the wall reaches between them: then areas differ at the
    true pose, too.
    """

    on_their_side: float | None
    overlap_error: float

    @property
    def value(self) -> str:
        """The fraction that counts, in percent."""
        return f"{100.0 * (self.overlap_error if self.on_their_side is None else self.on_their_side):.1f} %"

    @property
    def measure(self) -> str:
        """What that is the fraction of."""
        return "overlap error" if self.on_their_side is None else "samples on their side"

    @property
    def short_measure(self) -> str:
        """The same where there is little room."""
        return "overlap error" if self.on_their_side is None else "of samples"


def scene_fit(run: SceneEstimate) -> Fit:
    """How all regions of a run fit: by their samples where all have such, else by their areas."""
    return Fit(_fraction(run.sample_fits), float(run.estimate.diagnostics.overlap_error))


def region_fits(run: SceneEstimate) -> list[Fit]:
    """How each region of a run fits."""
    errors = run.estimate.diagnostics.region_overlap_errors.tolist()
    return [Fit(_fraction([fit]), error) for fit, error in zip(run.sample_fits, errors, strict=True)]


def _fraction(fits: Sequence[SampleFit | None]) -> float | None:
    """The fraction of the informative samples of all regions that lie on their side; None where a region has none."""
    sampled = [fit for fit in fits if fit is not None]
    count = sum(fit.count for fit in sampled)
    if len(sampled) < len(fits) or not count:
        return None
    return 1.0 - sum(len(fit.beyond) + len(fit.within) for fit in sampled) / count
