"""
A wrong region
==============

With three regions or more, one that does not belong is found, named and left out of the fit.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

demo = rp.datasets.load_demo()
names = [region.name for region in demo.regions]
image_regions = [rp.ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
outlines = [[np.array(ring) for ring in region.rings] for region in demo.regions]
# One outline of the cloud is moved by half a meter, as a slip of the hand may do.
wrong = 1
outlines[wrong] = [ring + np.array([0.0, 0.0, 0.5]) for ring in outlines[wrong]]
world_regions = [rp.WorldRegion.from_polygon(rings) for rings in outlines]

estimate = rp.estimate_pose(demo.camera, image_regions, world_regions)
for warning in estimate.warnings:
    print(warning.code, "-", warning.text_with(names))
truth = rp.Pose.from_parts(demo.rotation, demo.translation)
turn = np.degrees((estimate.pose.rotation * truth.rotation.inv()).magnitude())
print(f"the pose is off by {turn:.3f} deg all the same")

# %%
# The overlap error of each region shows which one it is.

figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), width_ratios=[3, 2], layout="constrained")
left.imshow(rp.overlay_regions(demo.camera, demo.image, image_regions, world_regions, estimate.pose, names))
left.set_axis_off()
colors = ["#ff8c00" if k == wrong else "#0b5fa5" for k in range(len(names))]
right.barh(names, 100 * estimate.diagnostics.region_overlap_errors, color=colors)
right.set(xlabel="overlap error, %")
right.invert_yaxis()
plt.show()
