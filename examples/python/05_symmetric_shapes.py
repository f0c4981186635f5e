"""
Symmetric shapes and priors
===========================

A rectangle looks the same after half a turn in its plane, so that several poses explain its image. The estimate
returns them all: the best as ``pose``, the others in ``diagnostics.alternatives``, with the warning
``ambiguous-pose``. Resolve it with a prior.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

camera = rp.PinholeCamera(800, 800, 640, 480, width=1280, height=960)
# A door on the wall y = 0 of a world with z up; the camera stands 3 m before it.
door = np.array([[0.0, 0.0, 0.0], [0.9, 0.0, 0.0], [0.9, 0.0, 2.0], [0.0, 0.0, 2.0]])
camera_from_world = rp.Pose.from_parts([[0.96, -0.28, 0], [0, 0, -1], [0.28, 0.96, 0]], [-0.2, 1.1, 3.0])

image_region = rp.ImageRegion.from_polygon(camera.project(camera_from_world @ door))
world_region = rp.WorldRegion.from_polygon(door)
estimate = rp.estimate_pose(camera, [image_region], [world_region])
print(estimate)
for warning in estimate.warnings:
    print(warning)

# %%
# Each answer has its own place of the camera. All project the door onto the same pixels.

answers = [estimate.pose, *(other.pose for other in estimate.diagnostics.alternatives)]
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
left.fill(*image_region.rings[0].T, color="#40b0ff", alpha=0.5, label="observed")
for pose in answers:
    outline = camera.project(pose @ door)
    left.plot(*np.vstack([outline, outline[:1]]).T, linewidth=1, color="#ff8c00")
left.set(xlim=(0, 1280), ylim=(960, 0), aspect="equal", title="all answers, projected")
right.fill(door[[0, 1, 1, 0], 0], [-0.03, -0.03, 0.03, 0.03], color="0.3")
for index, pose in enumerate(answers):
    x, y, z = pose.camera_center
    right.plot(x, y, "o", label=f"answer {index}, {z:.1f} m up")
right.set(xlim=(-4, 5), ylim=(-4, 4), aspect="equal", xlabel="x, m", ylabel="y, m")
right.set_title("places of the camera, from above")
right.legend(fontsize=8, loc="center right")
plt.show()

# %%
# Somebody knows which way is up, to 15 degrees, and on which side of the wall the camera stood.

up = rp.Prior(up=[0, 0, 1])
seen = world_region.with_viewpoint([0.4, -3.0, 1.5])
chosen = rp.estimate_pose(camera, [image_region], [seen], prior=up)
print(chosen)
print("camera at", np.round(chosen.pose.camera_center, 3), "true", np.round(camera_from_world.camera_center, 3))
