"""The pose from masks of Segment Anything; any model's output goes through `masks_from_segmenter`."""

import regionpose as rp

demo = rp.datasets.load_demo()
# In place of SamAutomaticMaskGenerator(model).generate(photo), which returns such a list.
output = [{"segmentation": demo.labels == region.label} for region in demo.regions]
image_regions = [rp.ImageRegion.from_mask(mask) for mask in rp.io.masks_from_segmenter(output)]
world_regions = [rp.WorldRegion.from_scan(demo.points, region.point_indices) for region in demo.regions]
print(rp.estimate_pose(demo.camera, image_regions, world_regions))
