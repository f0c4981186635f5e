"""Public names and their homes."""

from .absent_beams import absent_beams as absent_beams
from .mask import MaskWindow as MaskWindow
from .outline import SparseSamplingWarning as SparseSamplingWarning

__all__: list[str]
