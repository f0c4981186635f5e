"""
Color the cloud
===============

With the pose, the photo's colors go to the points that the camera sees. Hidden points are left out.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

demo = rp.datasets.load_demo()
image_regions = [rp.ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
world_regions = [
    rp.WorldRegion.from_scan(demo.points, region.point_indices, sensor_origin=[0, 0, 0]) for region in demo.regions
]
pose = rp.estimate_pose(demo.camera, image_regions, world_regions).pose

colors, visible = rp.colorize(demo.camera, demo.image, demo.points, pose)
print(f"{np.mean(visible):.0%} of {len(demo.points)} points are seen")

# %%
# The cloud from above, as it was scanned and with the photo's colors.

seen = demo.points[visible]
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.5), sharex=True, sharey=True, layout="constrained")
left.scatter(*seen[:, :2].T, c=seen[:, 2], s=0.3, cmap="viridis")
left.set(title="by height", xlabel="x, m", ylabel="y, m", aspect="equal", xlim=(0, 8), ylim=(-1, 7.5))
right.scatter(*seen[:, :2].T, c=colors[visible] / 255, s=0.3)
right.set(title="by the photo", xlabel="x, m", aspect="equal")
plt.show()

# %%
# The other way round: the cloud over the photo, by distance. Depth steps should lie on edges of the photo.

plt.figure(figsize=(9, 6), layout="constrained")
plt.imshow(rp.overlay_depth(demo.camera, demo.image, demo.points, pose))
plt.axis("off")
plt.show()
