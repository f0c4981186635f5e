"""A pose for ROS and for COLMAP."""

import regionpose as rp

demo = rp.datasets.load_demo()
pose = rp.Pose.from_parts(demo.rotation, demo.translation)
rp.io.write_pose("ros", pose, "tf2", world_frame="velodyne", camera_frame="camera_optical")
rp.io.write_pose("colmap", pose, "colmap", camera=demo.camera, image="photo.jpg")
