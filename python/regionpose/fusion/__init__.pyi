"""Public names and their homes."""

from .colors import PosedImage as PosedImage
from .colors import blend_colors as blend_colors
from .colors import colored_cloud as colored_cloud

__all__: list[str]
