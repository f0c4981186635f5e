"""What to know before trusting a pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class PoseWarning:
    """Something to know before trusting a pose.

    Parameters
    ----------
    code : str
        What it is about, the same from version to version.
    text : str
        The sentence, as of `str.format`: `{0}` stands for the first of the regions, names for the values.
    regions : tuple of int
        The places in the lists of the regions that it is about.
    values : mapping
        Numbers and words of the sentence by name, with units in the names.

    Examples
    --------
    >>> import regionpose as rp
    >>> told = rp.PoseWarning("poor-overlap", "{0} is off by {percent:.0f} %", (1,), {"percent": 12.3})
    >>> str(told)
    'poor-overlap: region 1 is off by 12 %'
    >>> told.message_for(["door", "sign"])
    'region 1 (sign) is off by 12 %'

    """

    code: str
    text: str
    regions: tuple[int, ...] = ()
    values: Mapping[str, float | str] = field(default_factory=dict, hash=False)

    @property
    def message(self) -> str:
        """The sentence, with regions by their places in the lists."""
        return self.text.format(*(f"region {index}" for index in self.regions), **self.values)

    def message_for(self, names: Sequence[str]) -> str:
        """The sentence, with the regions' names, of which there is one for each."""
        return self.text.format(*(f"region {index} ({names[index]})" for index in self.regions), **self.values)

    def __str__(self) -> str:
        """The code and the sentence."""
        return f"{self.code}: {self.message}"
