"""The two sides of a region: rings of the image, and outlines, surfaces or samples of the world."""
