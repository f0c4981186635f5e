"""
Faces of a CAD model
====================

The 3D side may be a model instead of a scan. Every flat face is a region: its outline as a polygon, or its
triangles as a mesh. No scanner is involved, so that outlines are exact.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

# A bench block: a box of 0.4 x 0.3 x 0.2 m whose front has a slanted corner, meters.
front = [[0, 0, 0], [0.4, 0, 0], [0.4, 0, 0.12], [0.3, 0, 0.2], [0, 0, 0.2]]
side = [[0.4, 0, 0], [0.4, 0.3, 0], [0.4, 0.3, 0.12], [0.4, 0, 0.12]]
top = [[0, 0, 0.2], [0.3, 0, 0.2], [0.3, 0.3, 0.2], [0, 0.3, 0.2]]
slant = [[0.3, 0, 0.2], [0.4, 0, 0.12], [0.4, 0.3, 0.12], [0.3, 0.3, 0.2]]
faces = [np.array(face, dtype=float) for face in (front, side, top, slant)]
# Each face is seen from outside of the block only.
outside = [0.8, -0.8, 0.8]
world_regions = [rp.WorldRegion.from_polygon(face).with_viewpoint(outside) for face in faces]

camera = rp.PinholeCamera(1000, 1000, 400, 300, width=800, height=600)
eye, target = np.array([0.75, -0.7, 0.6]), np.array([0.2, 0.15, 0.1])
forward = (target - eye) / np.linalg.norm(target - eye)
right = np.cross(forward, [0, 0, 1]) / np.linalg.norm(np.cross(forward, [0, 0, 1]))
rotation = np.stack([right, np.cross(forward, right), forward])
camera_from_model = rp.Pose.from_parts(rotation, -rotation @ eye)

generator = np.random.default_rng(2)
exact = [camera.project(camera_from_model @ face) for face in faces]
polygons = [polygon + generator.normal(scale=0.4, size=polygon.shape) for polygon in exact]
estimate = rp.estimate_pose(camera, [rp.ImageRegion.from_polygon(polygon) for polygon in polygons], world_regions)
shift = 1000 * np.linalg.norm(estimate.pose.camera_center - camera_from_model.camera_center)
print(estimate)
print(f"camera center off by {shift:.1f} mm, sigma {np.round(1000 * estimate.sigma.translation_m, 1)} mm")

# %%
figure, axes = plt.subplots(figsize=(6, 4.5), layout="constrained")
for polygon, face in zip(polygons, faces, strict=True):
    axes.fill(*polygon.T, alpha=0.5)
    outline = camera.project(estimate.pose @ face)
    axes.plot(*np.vstack([outline, outline[:1]]).T, color="#ff8c00")
axes.set(xlim=(0, 800), ylim=(600, 0), aspect="equal")
plt.show()
