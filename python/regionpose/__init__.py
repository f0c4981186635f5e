"""Absolute pose of a central camera from planar regions, without correspondences."""

import lazy_loader

from regionpose._core import __version__ as __version__

# The names stand in `__init__.pyi`, and each is loaded when first used: scipy alone takes half a second.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
