"""
Thousands of problems
=====================

``estimate_poses`` solves many problems on all cores. A problem that is refused or has no pose returns a
``PoseError`` at its place, so that one bad row does not stop the rest.
"""

import time

import matplotlib.pyplot as plt
import numpy as np
import regionpose as rp
from scipy.spatial.transform import Rotation

generator = np.random.default_rng(11)
camera = rp.PinholeCamera(800, 800, 640, 480, width=1280, height=960)
sign = np.array([[0, 0, 0], [0.6, 0, 0], [0.6, 0.3, 0], [0.3, 0.3, 0], [0.3, 1, 0], [0, 1, 0]]) - [0.3, 0.5, 0]
world = rp.WorldRegion.from_polygon(sign)

problems, truths = [], []
for _ in range(300):
    rotation = Rotation.from_euler("xyz", generator.uniform(-40, 40, size=3), degrees=True)
    pose = rp.Pose(rotation, np.array([*generator.uniform(-0.5, 0.5, size=2), generator.uniform(2, 5)]))
    corners = camera.project(pose @ sign) + generator.normal(scale=0.3, size=(6, 2))
    problems.append((camera, [rp.ImageRegion.from_polygon(corners)], [world]))
    truths.append(pose)
# A problem that is refused: a world region is missing.
problems[17] = (camera, problems[17][1], [])

start = time.perf_counter()
answers = rp.estimate_poses(problems)
print(f"{1000 * (time.perf_counter() - start) / len(problems):.1f} ms a problem")
print("17:", answers[17])

# %%
errors, sigmas = [], []
for answer, truth in zip(answers, truths, strict=True):
    if isinstance(answer, rp.PoseEstimate) and answer.confidence > 0.9:
        errors.append(np.degrees((answer.pose.rotation * truth.rotation.inv()).magnitude()))
        sigmas.append(np.linalg.norm(answer.sigma.rotation_deg))
figure, axes = plt.subplots(figsize=(5.5, 4), layout="constrained")
axes.loglog(sigmas, errors, ".", alpha=0.6)
axes.axline((0.1, 0.1), (1, 1), color="0.5", linewidth=1)
axes.set(xlabel="stated rotation sigma, deg", ylabel="rotation error, deg")
plt.show()
