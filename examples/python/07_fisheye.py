"""
A fisheye camera of 180 degrees
===============================

The same functions take any central camera. A fisheye bends straight edges; regionpose follows them on the sphere
of viewing directions. Regions near the rim count like those in the middle.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

camera = rp.FisheyeCamera(380, 380, 600, 600, distortion=(-0.02, 0.004, -0.001, 0.0), width=1200, height=1200)
print(f"sees up to {np.degrees(camera.max_angle):.0f} deg off the axis")

# A room of 4 x 6 m with a door, a picture and a window, the camera in the middle, looking along x.
door = [[3, -1.6, 0], [3, -0.7, 0], [3, -0.7, 2], [3, -1.6, 2]]
picture = [[0.5, 2, 1.0], [1.5, 2, 1.0], [1.5, 2, 1.5], [1.1, 2, 1.8], [0.5, 2, 1.8]]
window = [[-0.2, -2, 0.9], [1.4, -2, 0.9], [1.4, -2, 1.9], [-0.2, -2, 1.9]]
regions = [np.array(ring, dtype=float) for ring in (door, picture, window)]
camera_from_world = rp.Pose.from_parts([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.1, 1.4, 0.2])


def image_polygon(ring):
    """The bent outline, each edge by 40 points, to a tenth of a pixel."""
    ends = np.roll(ring, -1, axis=0)
    share = np.linspace(0, 1, 40, endpoint=False)[:, None, None]
    points = (ring + share * (ends - ring)).transpose(1, 0, 2).reshape(-1, 3)
    return np.round(camera.project(camera_from_world @ points), 1)


polygons = [image_polygon(ring) for ring in regions]
estimate = rp.estimate_pose(
    camera,
    [rp.ImageRegion.from_polygon(polygon) for polygon in polygons],
    [rp.WorldRegion.from_polygon(ring) for ring in regions],
)
turn = np.degrees((estimate.pose.rotation * camera_from_world.rotation.inv()).magnitude())
print(estimate)
print(f"off by {turn:.4f} deg")

# %%
# The three regions fill a large part of the field of view, the window and the picture near its rim.

figure, axes = plt.subplots(figsize=(5.5, 5.5), layout="constrained")
axes.add_patch(plt.Circle((600, 600), 380 * np.pi / 2, color="0.92"))
for name, polygon in zip(("door", "picture", "window"), polygons, strict=True):
    axes.fill(*polygon.T, alpha=0.7)
    axes.text(*polygon.mean(axis=0), name, ha="center", color="white", fontsize=9)
axes.set(xlim=(0, 1200), ylim=(1200, 0), aspect="equal")
axes.set_axis_off()
plt.show()
