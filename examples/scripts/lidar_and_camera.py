"""The pose of a camera beside a lidar from one photo and one scan, without regions."""

import regionpose as rp

folder = rp.datasets.demo_folder()
camera = rp.load_camera(folder / "camera_info.yaml")
cloud = rp.read_cloud(folder / "cloud.ply")
photo = rp.datasets.load_demo().image
prior = rp.Prior(camera_near=[0, 0, 0], camera_near_sigma_m=0.5, up=[0, 0, 1], up_sigma_deg=3)
print(rp.calibrate(camera, [rp.Frame(image=photo, points=cloud)], prior=prior))
