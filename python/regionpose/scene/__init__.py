"""Scene files: a camera, an image, a cloud and regions named in one YAML or JSON file, run from there to a pose."""

import lazy_loader

# The names stand in `__init__.pyi`, and each is loaded when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
