"""The scene that ships with the project: a courtyard seen by a camera and by a lidar, with the pose between them."""

import lazy_loader

# The names stand in `__init__.pyi`, and each is loaded when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
