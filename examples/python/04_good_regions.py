"""
What makes a pose weak
======================

How well a pose is known depends on where the regions lie. This example takes masks with the noise of a careful
hand and looks at the standard deviations that ``estimate_pose`` states.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp
from scipy.spatial.transform import Rotation

camera = rp.PinholeCamera(1200, 1200, 800, 600, width=1600, height=1200)
generator = np.random.default_rng(3)
flag = np.array([[0, 0, 0], [1, 0, 0], [1, 0.5, 0], [0.6, 0.5, 0], [0.6, 1, 0], [0, 1, 0]]) - [0.5, 0.5, 0]


def placed(rotation_deg, center, size=1.0):
    """The shape, turned about the camera's axes and moved to a place before the camera."""
    return Rotation.from_euler("xyz", rotation_deg, degrees=True).apply(size * flag) + center


def drawn(polygon):
    """The mask that a careful hand draws: the corners are off by half a pixel."""
    corners = camera.project(polygon)
    return rp.ImageRegion.from_polygon(corners + generator.normal(scale=0.5, size=corners.shape))


def estimated(polygons):
    """The pose of the shapes, which is the identity."""
    worlds = [rp.WorldRegion.from_polygon(polygon) for polygon in polygons]
    return rp.estimate_pose(camera, [drawn(polygon) for polygon in polygons], worlds)


# %%
# One plane that faces the camera determines its tilt badly: a small turn either way looks the same. Turn the camera, or
# choose another face.

angles = np.array([2, 5, 10, 20, 30, 45, 60])
tilts = [estimated([placed([0, angle, 0], [0, 0, 5])]) for angle in angles]
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.semilogy(angles, [np.max(each.sigma.rotation_deg) for each in tilts], "o-")
axes.set(xlabel="angle between the plane and a frontal one, deg", ylabel="largest rotation sigma, deg")
axes.grid(alpha=0.3)
plt.show()

# %%
# More regions help most where they lie in other planes and far apart. Below each image: the largest rotation
# sigma.

layouts = {
    "one\n": [placed([0, 30, 0], [0, 0, 5])],
    "two side by side,\none plane": [placed([0, 30, 0], [-0.6, 0, 5]), placed([0, 30, 0], [0.6, 0, 4.3])],
    "two apart,\nother planes": [placed([0, 30, 0], [-1.8, 0, 5]), placed([0, -40, 0], [1.8, 0, 6])],
    "three apart,\nother planes": [
        placed([0, 30, 0], [-1.8, 0, 5]),
        placed([0, -40, 0], [1.8, 0, 6]),
        placed([50, 0, 0], [0, 1.3, 5]),
    ],
}
figure, panels = plt.subplots(1, 4, figsize=(10, 2.9), layout="constrained")
for axes, (name, polygons) in zip(panels, layouts.items(), strict=True):
    sigma = np.max(estimated(polygons).sigma.rotation_deg)
    for polygon in polygons:
        axes.fill(*camera.project(polygon).T, alpha=0.8)
    axes.set(xlim=(0, camera.width), ylim=(camera.height, 0), aspect="equal", xticks=[], yticks=[])
    axes.set(title=name, xlabel=f"{sigma:.2f} deg")
plt.show()

# %%
# Weak geometry is a warning that names the weak direction and its cause.

small_and_frontal = estimated([placed([0, 2, 0], [0, 0, 9], size=0.25)])
for warning in small_and_frontal.warnings:
    print(warning)
