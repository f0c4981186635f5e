"""The two sides of a region: rings of the image, and outlines, surfaces or samples of the world."""

import lazy_loader

# The names stand in `__init__.pyi`, and each is loaded when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
