"""
A depth camera
==============

A depth image is a cloud. This example makes one of a room corner, finds its planes, and estimates where a second,
color camera stands.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

depth_camera = rp.PinholeCamera(400, 400, 319.5, 239.5, width=640, height=480)
color_camera = rp.PinholeCamera(900, 900, 640, 360, width=1280, height=720)
color_from_depth = rp.Pose.from_quat([0.02, -0.04, 0.01, np.sqrt(1 - 0.0021)], [-0.06, 0.01, 0.02])

# Three boards: a corner, an edge vector to the right and one down, meters, frame of the depth camera.
boards = [
    (np.array([-0.9, -0.5, 2.2]), np.array([0.7, 0.0, -0.3]), np.array([0.0, 0.6, 0.1])),
    (np.array([0.2, -0.6, 2.0]), np.array([0.6, 0.0, 0.4]), np.array([0.05, 0.7, 0.0])),
    (np.array([-0.3, 0.4, 1.8]), np.array([0.8, 0.05, 0.1]), np.array([0.0, 0.25, 0.45])),
]
rows, columns = np.mgrid[:480, :640]
rays = depth_camera.bearings(np.column_stack([columns.ravel(), rows.ravel()]))
depth = np.full(len(rays), 3.5) / rays[:, 2]
for corner, right, down in boards:
    normal = np.cross(right, down)
    distance = (normal @ corner) / (rays @ normal)
    inside = np.linalg.lstsq(np.stack([right, down], axis=1), (rays * distance[:, None] - corner).T, rcond=None)[0]
    hit = (inside > 0).all(axis=0) & (inside < 1).all(axis=0) & (distance > 0) & (distance < depth)
    depth[hit] = distance[hit]
points = rays * (depth + np.random.default_rng(0).normal(scale=0.002, size=depth.shape))[:, None]

# %%
# Each board is found from one point on it. The depth camera's own place is the scanner's: zero.

world_regions = []
for corner, right, down in boards:
    members = rp.segment.grow_plane(points, corner + 0.5 * right + 0.5 * down)
    world_regions.append(rp.WorldRegion.from_scan(points, members, sensor_origin=[0, 0, 0]))
    print(world_regions[-1])

# %%
# The color image shows the boards as polygons, drawn to half a pixel.

rings = [np.array([c, c + r, c + r + d, c + d]) for c, r, d in boards]
noise = np.random.default_rng(1)
polygons = [color_camera.project(color_from_depth @ ring) + noise.normal(scale=0.5, size=(4, 2)) for ring in rings]
image_regions = [rp.ImageRegion.from_polygon(polygon) for polygon in polygons]
near = rp.Prior(camera_near=[0, 0, 0], camera_near_sigma_m=0.2)
estimate = rp.estimate_pose(color_camera, image_regions, world_regions, prior=near)
turn = np.degrees((estimate.pose.rotation * color_from_depth.rotation.inv()).magnitude())
shift = 1000 * np.linalg.norm(estimate.pose.camera_center - color_from_depth.camera_center)
print(f"confidence {100 * estimate.confidence:.1f} %, off by {turn:.2f} deg and {shift:.1f} mm")

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
left.imshow((depth * rays[:, 2]).reshape(480, 640), cmap="viridis_r")
left.set(title="depth image")
left.set_axis_off()
for polygon, region in zip(polygons, world_regions, strict=True):
    right.fill(*polygon.T, color="#40b0ff", alpha=0.5)
    outline = color_camera.project(estimate.pose @ region.rings[0])
    right.plot(*np.vstack([outline, outline[:1]]).T, color="#ff8c00")
right.set(xlim=(0, 1280), ylim=(720, 0), aspect="equal", title="color image: observed and projected")
plt.show()
