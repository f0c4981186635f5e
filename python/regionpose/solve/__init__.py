"""From pairs of regions to poses: of one image, of many, of a rig, and which regions are pairs."""

import lazy_loader

# The names stand in `__init__.pyi`, and each is loaded when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
