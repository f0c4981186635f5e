"""Alignment of clouds with photos by their edges: poses from nothing else or with regions, and how well both agree at a
pose.
"""

import lazy_loader

# The names stand in `__init__.pyi`, and each is loaded when first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
