"""The pose of a camera before a CAD model, from outlines of its faces clicked in the photo."""

import regionpose as rp
import trimesh

model = trimesh.creation.box((0.4, 0.3, 0.2))  # or trimesh.load("part.stl"), meters
faces = rp.segment.regions_from_mesh(model)
camera = rp.PinholeCamera(1000, 1000, 400, 300, width=800, height=600)
top = rp.ImageRegion.from_polygon([[441, 352], [725, 213], [377, 97], [107, 168]])
front = rp.ImageRegion.from_polygon([[441, 352], [107, 168], [137, 370], [435, 606]])
side = rp.ImageRegion.from_polygon([[725, 213], [441, 352], [435, 606], [689, 430]])
estimate = rp.estimate_pose(camera, [top, front, side], [faces[1], faces[3], faces[5]])
print(estimate.pose.camera_center)  # about (0.55, -0.5, 0.4)
