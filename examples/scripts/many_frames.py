"""One pose from regions of several frames of a rig."""

import regionpose as rp

demo = rp.datasets.load_demo()
image_regions = [rp.ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
world_regions = [rp.WorldRegion.from_scan(demo.points, region.point_indices) for region in demo.regions]
# Each frame has regions of its own.
frames = [rp.Frame(image_regions[i : i + 2], world_regions[i : i + 2]) for i in (0, 2, 4)]
print(rp.estimate_rig(demo.camera, frames))
