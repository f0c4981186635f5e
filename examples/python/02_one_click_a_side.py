"""
Regions from one click a side
=============================

A region takes one pixel in the photo and one point in the cloud. ``grow_image_region`` finds the surface around
the pixel, ``grow_plane`` the plane around the point. Where a sign hangs flat on a wall, the intensity tells them
apart.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

demo = rp.datasets.load_demo()
chosen = [demo.region(name) for name in ("door", "notice-board", "chalkboard")]
masks = [rp.segment.grow_image_region(demo.image, region.seed_pixel, coverage=True) for region in chosen]
members = []
for region in chosen:
    level = demo.intensities[np.argmin(np.linalg.norm(demo.points - region.seed_point, axis=1))]
    alike = np.flatnonzero(np.abs(demo.intensities.astype(int) - level) <= 30)
    members.append(alike[rp.segment.grow_plane(demo.points[alike], region.seed_point)])

for region, mask, found in zip(chosen, masks, members, strict=True):
    print(f"{region.name}: {np.sum(mask):.0f} pixels, {len(found)} points")

# %%
# The picture shows what the clicks grew. Look at it before you estimate: a mask that leaks over its edge spoils
# the pose.

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
left.imshow(demo.image)
for region, mask in zip(chosen, masks, strict=True):
    left.contour(mask, levels=[0.5], colors=["#40b0ff"], linewidths=1.5)
    left.plot(*region.seed_pixel, "o", color="#ff8c00", markersize=5)
left.set_axis_off()
bearing = np.degrees(np.arctan2(demo.points[:, 1], demo.points[:, 0]))
height = demo.points[:, 2]
right.plot(bearing, height, ",", color="0.7")
for region, found in zip(chosen, members, strict=True):
    right.plot(bearing[found], height[found], ".", markersize=1.5, label=region.name)
right.set(xlabel="azimuth, deg", ylabel="height, m", xlim=(right.get_xlim()[::-1]))
right.legend(markerscale=6)
plt.show()

# %%
# Coverage masks hold the share of each pixel that the region covers, so that the contour is known to a tenth of a
# pixel.

image_regions = [rp.ImageRegion.from_mask(mask) for mask in masks]
world_regions = [rp.WorldRegion.from_scan(demo.points, found, sensor_origin=[0, 0, 0]) for found in members]
estimate = rp.estimate_pose(demo.camera, image_regions, world_regions)
truth = rp.Pose.from_parts(demo.rotation, demo.translation)
turn = np.degrees((estimate.pose.rotation * truth.rotation.inv()).magnitude())
print(f"confidence {100 * estimate.confidence:.1f} %, off by {turn:.3f} deg")
