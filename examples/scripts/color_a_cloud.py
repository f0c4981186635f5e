"""A cloud with the colors of a photo, at a pose that is known."""

import regionpose as rp

demo = rp.datasets.load_demo()
pose = rp.Pose.from_parts(demo.rotation, demo.translation)
cloud = rp.Cloud.from_points(demo.points)
colored, visible = rp.fusion.colored_cloud([(demo.camera, demo.image, pose)], cloud)
rp.io.write_ply("colored.ply", colored)
print(f"{visible.sum()} of {len(colored)} points colored")
