"""A thousand poses on all cores; a problem without a pose holds a `PoseError` in its place."""

import numpy as np
import regionpose as rp

demo, generator = rp.datasets.load_demo(), np.random.default_rng(1)
truth = rp.Pose.from_parts(demo.rotation, demo.translation)
rings = [region.rings[0] for region in demo.regions[:3]]
world_regions = [rp.WorldRegion.from_polygon(ring) for ring in rings]
corners = [demo.camera.project(truth.transform(ring)) for ring in rings]
problems = [
    (
        demo.camera,
        [rp.ImageRegion.from_polygon(each + generator.normal(0, 0.5, each.shape)) for each in corners],
        world_regions,
    )
    for _ in range(1000)
]
poses = rp.estimate_poses(problems)
print(sum(not isinstance(pose, rp.PoseError) for pose in poses), "poses")
