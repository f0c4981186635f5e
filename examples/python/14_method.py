"""
The method in pictures
======================

How a pose comes out of regions, step by step, on the demo.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

demo = rp.datasets.load_demo()
image_regions = [rp.ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
world_regions = [rp.WorldRegion.from_polygon(region.rings) for region in demo.regions]
estimate = rp.estimate_pose(demo.camera, image_regions, world_regions)
pose = estimate.pose

# %%
# **1. Contours.** The mask's contour runs where the coverage is one half, between pixel centers. The world side is
# an outline on its plane.

board = demo.region("notice-board")
contour = image_regions[demo.regions.index(board)].rings[0]
corner = contour[contour.sum(axis=1).argmin()]
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
axes[0].imshow(demo.labels == board.label, cmap="gray", alpha=0.6)
axes[0].plot(*np.vstack([contour, contour[:1]]).T, ".-", color="#ff8c00")
axes[0].set(xlim=corner[0] + [-6, 14], ylim=corner[1] + [14, -6], title="contour between pixel centers")
world = board.rings[0]
across = (world[:, :2] - world[0, :2]) @ np.array([-world[0, 1], world[0, 0]]) / np.hypot(*world[0, :2])
axes[1].fill(across, world[:, 2], color="#ff8c00", alpha=0.6)
axes[1].set(aspect="equal", title="outline of the world region, m")
plt.show()

# %%
# **2. Moments.** At a pose, each world region predicts integrals over its image: area, center, spread. They are
# compared with those of the observed region. Here the pose is moved along one axis; the true place is where the
# moments agree.

steps = np.linspace(-0.3, 0.3, 41)
shown = demo.regions[:3]
areas = np.empty((len(steps), len(shown)))
for row, step in enumerate(steps):
    moved = rp.Pose(pose.rotation, pose.translation + np.array([0, 0, step]))
    for column, region in enumerate(shown):
        areas[row, column] = rp.ImageRegion.from_polygon(demo.camera.project(moved @ region.rings[0])).area
observed = np.array([image.area for image in image_regions[:3]])
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(1000 * steps, 100 * (areas / observed - 1), label=[region.name for region in shown])
axes.axhline(0, color="0.6", linewidth=1)
axes.set(xlabel="camera moved along its optical axis, mm", ylabel="predicted over observed area, %")
axes.legend()
plt.show()

# %%
# **3. Search.** Closed-form poses of single regions are the starts; the best ones are refined. Those that project
# every region onto its contour remain. The overlap error measures how far a pose is from that.

distances = np.linspace(0, 10, 21)
turned = []
for degrees in distances:
    increment = np.radians([0, degrees, 0])
    rotation = type(pose.rotation).from_rotvec(increment) * pose.rotation
    turned.append(
        rp.solve.overlap_errors(demo.camera, image_regions, world_regions, rp.Pose(rotation, pose.translation))[1]
    )
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.plot(distances, 100 * np.array(turned), label=[region.name for region in demo.regions])
axes.set(xlabel="camera turned by, deg", ylabel="overlap error, %")
axes.legend(fontsize=8)
plt.show()

# %%
# **4. Contour fit.** The best poses are refined on the parts of the contours that are clean. What remains gives the
# noise, the covariance and the confidence.

print(f"boundary noise {estimate.diagnostics.boundary_noise_px:.2f} px")
print(f"rotation sigma {np.round(estimate.sigma.rotation_deg, 4)} deg")
print(f"confidence {100 * estimate.confidence:.2f} %")
plt.figure(figsize=(9, 6), layout="constrained")
plt.imshow(rp.overlay_regions(demo.camera, demo.image, image_regions, world_regions, pose))
plt.axis("off")
plt.show()
