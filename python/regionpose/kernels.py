"""The core's kernels on rings: moments, triangulations and outlines of points."""

from regionpose._core import alpha_shape, planar_moments, spherical_moments, triangulate

__all__ = ["alpha_shape", "planar_moments", "spherical_moments", "triangulate"]
