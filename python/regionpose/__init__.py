"""Absolute pose of a central camera from planar regions."""
