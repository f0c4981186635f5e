"""The pose of a camera from masks of flat regions and the lidar points on them."""

import regionpose as rp

demo = rp.datasets.load_demo()
masks = rp.io.masks_from_file(rp.datasets.demo_folder() / "labels.png")
image_regions = [rp.ImageRegion.from_mask(masks[str(region.label)]) for region in demo.regions]
world_regions = [rp.WorldRegion.from_scan(demo.points, region.point_indices) for region in demo.regions]
estimate = rp.estimate_pose(demo.camera, image_regions, world_regions)
print(estimate)
