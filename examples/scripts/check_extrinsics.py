"""Whether a photo and a scan agree at extrinsics that somebody else found."""

import regionpose as rp

demo = rp.datasets.load_demo()
pose = rp.Pose.from_parts(demo.rotation, demo.translation)
for name, given in (("given", pose), ("2 degrees off", pose.retract([0.035, 0, 0, 0, 0, 0]))):
    alignment = rp.check_alignment(demo.camera, demo.image, demo.points, given)
    print(name, f"log odds {alignment.log_odds:.1f}")
