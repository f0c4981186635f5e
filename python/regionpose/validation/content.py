"""Arrays by their values, so that what takes long to make of one can be kept."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

Level = TypeVar("Level", bound=np.generic)


@dataclass(frozen=True)
class Content(Generic[Level]):
    """An array of numbers that equals another one of the same shape, type and values: a key of a cache, which an array
    that was changed in place does not find.
    """

    digest: bytes
    array: NDArray[Level] = field(compare=False, repr=False)

    @classmethod
    def of(cls, array: NDArray[Level]) -> Self:
        """That of an array, whose values are read once."""
        digest = hashlib.sha256(repr((array.shape, array.dtype.str)).encode())
        digest.update(np.ascontiguousarray(array).data)
        return cls(digest.digest(), array)
