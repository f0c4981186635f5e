"""Files: clouds, calibrations, masks, bags, exports, and how they are read and written whole."""

import lazy_loader

# The names stand in `__init__.pyi`, and each is loaded when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
