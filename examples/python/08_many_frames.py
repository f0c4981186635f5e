"""
One pose from many frames
=========================

A camera and a lidar on one vehicle keep their pose while they drive. ``estimate_rig`` estimates one pose from all
frames, leaves each out in turn, and names frames that disagree with the others. It can refine the camera as well.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

generator = np.random.default_rng(5)
true_camera = rp.PinholeCamera(1010, 1010, 645, 355, width=1280, height=720)
assumed = rp.PinholeCamera(1000, 1000, 640, 360, width=1280, height=720)
# The lidar's frame: x forward, y left, z up. The camera looks along x.
camera_from_lidar = rp.Pose.from_parts([[0, -1, 0], [0, 0, -1], [1, 0, 0]], [0.1, -0.3, -0.2])


def frame(name, mistake=0.0):
    """Three house faces at random places; corners off by half a pixel. `mistake` moves them in the cloud."""
    images, worlds = [], []
    for side in (-1, 0, 1):
        center = np.array([generator.uniform(7, 12), 3 * side + generator.uniform(-0.5, 0.5), generator.uniform(0, 1)])
        angle = generator.uniform(-0.7, 0.7)
        across, up = np.array([np.sin(angle), np.cos(angle), 0]), np.array([0, 0, 1])
        shape = [(-1, -1), (1, -1), (1, 0.4), (0.3, 1.2), (-1, 0.8)]
        ring = np.array([center + x * across + y * up for x, y in shape])
        pixels = true_camera.project(camera_from_lidar @ ring)
        images.append(rp.ImageRegion.from_polygon(pixels + generator.normal(scale=0.5, size=pixels.shape)))
        worlds.append(rp.WorldRegion.from_polygon(ring + mistake * up))
    return rp.Frame(images, worlds, name)


frames = [frame(f"frame {k}", mistake=0.3 if k == 4 else 0.0) for k in range(8)]
rig = rp.estimate_rig(assumed, frames)
for warning in rig.warnings:
    print(warning)

# %%
# The scan of frame 4 lies 30 cm from its place, as one does that was taken while the vehicle bounced. The picture
# shows, for each frame, how far its contours lie from where the other frames put them.

figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
places, without = np.arange(len(frames)), rig.diagnostics.rig.leave_one_out
axes.bar(places - 0.2, [one.residual_px for one in without], 0.4, label="found", color="#ff8c00")
axes.bar(places + 0.2, [one.expected_px for one in without], 0.4, label="expected", color="#0b5fa5")
axes.set(xlabel="frame left out", ylabel="distance of its contours, px", xticks=places)
axes.legend()
plt.show()

# %%
# Without it, and with focal length and center estimated together with the pose:

kept = [each for each, fit in zip(frames, without, strict=True) if not fit.is_outlier]
given = rp.estimate_rig(assumed, kept)
refined = rp.estimate_rig(assumed, kept, refine_camera=["focal", "center"])
for name, result in (("camera as given", given), ("camera refined", refined)):
    shift = 1000 * np.linalg.norm(result.pose.camera_center - camera_from_lidar.camera_center)
    camera = result.diagnostics.rig.camera
    print(f"{name}: camera center off by {shift:.0f} mm; fx {camera.fx:.1f}, cx {camera.cx:.1f}, cy {camera.cy:.1f}")
