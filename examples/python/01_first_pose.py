"""
A first pose
============

The demo ships with a photo, a lidar cloud and six flat regions that both show. The masks of the regions in the
photo and the lidar points on them are all that the pose needs: no point correspondences and no initial guess.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

demo = rp.datasets.load_demo()
image_regions = [rp.ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
world_regions = [
    rp.WorldRegion.from_scan(demo.points, region.point_indices, sensor_origin=[0, 0, 0]) for region in demo.regions
]

estimate = rp.estimate_pose(demo.camera, image_regions, world_regions)
print(estimate)

# %%
# The pose takes points of the cloud's frame to the camera's. Its covariance gives standard deviations along the
# camera's axes, and the confidence is the probability that the rotation is within 5 degrees.

print("camera_from_world")
print(np.round(estimate.pose.matrix, 4))
print("confidence        ", f"{100 * estimate.confidence:.1f} %")
print("rotation sigma    ", np.round(estimate.sigma.rotation_deg, 3), "deg")
print("translation sigma ", np.round(1000 * estimate.sigma.translation_m, 1), "mm")
print("warnings          ", [str(warning) for warning in estimate.warnings])

# %%
# The demo knows the true pose.

truth = rp.Pose.from_parts(demo.rotation, demo.translation)
turn = np.degrees((estimate.pose.rotation * truth.rotation.inv()).magnitude())
shift = np.linalg.norm(estimate.pose.camera_center - truth.camera_center)
print(f"off by {turn:.3f} deg and {1000 * shift:.1f} mm")

# %%
# Always look at the overlay. The regions of the cloud, projected with the pose, lie on those of the photo.

names = [region.name for region in demo.regions]
picture = rp.overlay_regions(demo.camera, demo.image, image_regions, world_regions, estimate.pose, names)
plt.figure(figsize=(9, 6), layout="constrained")
plt.imshow(picture)
plt.axis("off")
plt.show()
