"""Whether a photo and a scan agree at extrinsics from elsewhere."""

import regionpose as rp

demo = rp.datasets.load_demo()
pose = rp.Pose.from_parts(demo.rotation, demo.translation)
frame = rp.Frame(image=demo.image, points=demo.points, intensity=demo.intensities)
for name, given in (("given", pose), ("10 degrees off", pose.retract([0.175, 0, 0, 0, 0, 0]))):
    alignment = rp.check_alignment(demo.camera, frame, given)
    print(name, f"log odds {alignment.log_odds:.1f}")
