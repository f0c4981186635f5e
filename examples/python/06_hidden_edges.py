"""
Something stands before the region
==================================

Where a car hides a part of a wall, the mask ends at the car. That edge is not the wall's. Mark it, and it carries
no weight.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

camera = rp.PinholeCamera(900, 900, 640, 480, width=1280, height=960)
# A gable on the plane z = 0: a shape without symmetry, which one region alone needs.
gable = np.array([[0, 0, 0], [3, 0, 0], [3, -2, 0], [1, -3.2, 0], [0, -2, 0]], dtype=float)
camera_from_world = rp.Pose.from_quat([0.03, 0.25, 0.0, np.sqrt(1 - 0.03**2 - 0.25**2)], [-1.4, 1.4, 7.0])

rows, columns = np.mgrid[:960, :1280]
pixels = np.column_stack([columns.ravel(), rows.ravel()])
outline = camera.project(camera_from_world @ gable)
wall = plt.matplotlib.path.Path(outline).contains_points(pixels).reshape(960, 1280)
car = ((columns - 640) / 230) ** 2 + ((rows - 620) / 150) ** 2 < 1

naive = rp.ImageRegion.from_mask(wall & ~car)
marked = rp.ImageRegion.from_mask(wall & ~car, unknown=car)
world = rp.WorldRegion.from_polygon(gable)

# %%
# The mask of the car is given as ``unknown``: pixels that may be the region's or not.

for name, region in (("car's edge taken for the wall's", naive), ("car's edge marked as hidden", marked)):
    estimate = rp.estimate_pose(camera, [region], [world])
    turn = np.degrees((estimate.pose.rotation * camera_from_world.rotation.inv()).magnitude())
    shift = 1000 * np.linalg.norm(estimate.pose.camera_center - camera_from_world.camera_center)
    codes = [warning.code for warning in estimate.warnings]
    print(f"{name}: {turn:.3f} deg, {shift:.1f} mm, confidence {100 * estimate.confidence:.0f} %, warnings {codes}")

# %%
# Hidden edges are drawn dotted. Of a polygon, ``hidden_edges=[...]`` names them by their numbers.

figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
sky, stone, paint = [0.6, 0.75, 0.9], [0.85, 0.82, 0.75], [0.55, 0.35, 0.3]
axes.imshow(np.where(car[..., None], paint, np.where(wall[..., None], stone, sky)))
for ring, hidden in zip(marked.rings, marked.hidden, strict=True):
    for start, stop, is_hidden in zip(ring, np.roll(ring, -1, axis=0), hidden, strict=True):
        axes.plot(*np.stack([start, stop]).T, ":" if is_hidden else "-", color="#ff8c00", linewidth=2)
axes.set_axis_off()
plt.show()
