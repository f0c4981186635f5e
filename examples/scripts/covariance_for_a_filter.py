"""The camera's place in the lidar's frame with its covariance, as a filter or ROS takes it."""

import regionpose as rp

demo = rp.datasets.load_demo()
image_regions = [rp.ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
world_regions = [rp.WorldRegion.from_scan(demo.points, region.point_indices) for region in demo.regions]
estimate = rp.estimate_pose(demo.camera, image_regions, world_regions)
if estimate.status == "trusted":
    print(estimate.pose.inverse())
    print(estimate.covariance_in_ros_order(of_inverse=True))
