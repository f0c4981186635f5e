"""Regions found in the data: in an image from a seed, a file or a segmenter, and in a point cloud."""
