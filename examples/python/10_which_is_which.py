"""
Which region is which
=====================

``match_regions`` needs no pairs: it finds those that one pose explains, and lists the regions that are left over.
"""

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp

demo = rp.datasets.load_demo()
order = np.random.default_rng(7).permutation(len(demo.regions))
image_regions = [rp.ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
world_regions = [rp.WorldRegion.from_polygon(demo.regions[k].rings) for k in order]

matches = rp.match_regions(demo.camera, image_regions, world_regions)
print("pairs", matches.pairs)
print("left over", matches.unmatched_image, matches.unmatched_world)
print("right", all(order[world] == image for image, world in matches.pairs))
print(matches.estimate)

# %%
plt.figure(figsize=(9, 6), layout="constrained")
paired = [world_regions[world] for _, world in matches.pairs]
observed = [image_regions[image] for image, _ in matches.pairs]
names = [demo.regions[order[world]].name for _, world in matches.pairs]
plt.imshow(rp.overlay_regions(demo.camera, demo.image, observed, paired, matches.estimate.pose, names))
plt.axis("off")
plt.show()
