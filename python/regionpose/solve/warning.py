"""What to know before trusting a pose: a code, the regions concerned, a text and an advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from regionpose import _core
from regionpose.solve.warning_code import WarningCode
from regionpose.solve.warning_texts import TEXTS, Value, warning_text


@dataclass(frozen=True)
class PoseWarning:
    """Something to know before trusting a pose.

    Parameters
    ----------
    code : WarningCode
        What it is about; a string that stays the same from version to version.
    regions : tuple of int
        Indices of the regions concerned, in the lists that the pose was estimated from.
    values : mapping
        Numbers and words of the text by name, with units in the names; percentages and probabilities are fractions.

    Examples
    --------
    >>> import regionpose as rp
    >>> warning = rp.PoseWarning(rp.WarningCode.POOR_OVERLAP, (1,), {"overlap_error": 0.123})
    >>> str(warning)
    'poor-overlap: region 1, projected with this pose, misses the observed region by 12.3 % of its area'
    >>> warning.text_with(["door", "sign"])
    'region 1 (sign), projected with this pose, misses the observed region by 12.3 % of its area'
    >>> warning.advice
    'Look at this region in the overlay: its mask or outline is wrong, or the pair does not match.'

    """

    code: WarningCode
    regions: tuple[int, ...] = ()
    values: Mapping[str, Value] = field(default_factory=dict, hash=False)

    @property
    def text(self) -> str:
        """What was found, with regions by their indices."""
        return warning_text(self.code, [f"region {index}" for index in self.regions], self.values)

    def text_with(self, names: Sequence[str]) -> str:
        """What was found, with the names of the regions, one for each of the lists' regions."""
        named = [f"region {index} ({names[index]})" for index in self.regions]
        return warning_text(self.code, named, self.values)

    @property
    def advice(self) -> str:
        """What to do about it."""
        return TEXTS[self.code].advice

    def __str__(self) -> str:
        """The code and the text."""
        return f"{self.code}: {self.text}"


def warning_from_core(parts: _core._WarningParts) -> PoseWarning:
    """A warning of the core."""
    code, regions, values = parts
    return PoseWarning(WarningCode(code), tuple(regions), values)
