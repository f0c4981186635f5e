"""Seconds from the start of Python to the first pose, in new processes: numpy, the package, regions, the pose.

Three outlines seen by a pinhole camera; medians of some runs, by each driver of `Solver`.

    python -m benchmarks.first_pose [--runs 5]
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
from typing import get_args

from regionpose.solve.options import Driver

STAGES = ("numpy", "regionpose", "regions", "pose", "all")

SCRIPT = """
import json, sys, time
times = [time.perf_counter()]
import numpy as np
times.append(time.perf_counter())
import regionpose as rp
times.append(time.perf_counter())
camera = rp.PinholeCamera(800.0, 800.0, 640.0, 480.0, width=1280, height=960)
corners = np.array([[0, 0, 5], [1, 0, 5], [1, 0.4, 5.2], [0.4, 0.4, 5.2], [0.4, 1, 5.5], [0, 1, 5.5]], dtype=float)
outlines = [corners + [x, 0, z] for x, z in ((-2.0, 0.0), (0.0, 0.5), (1.5, 1.0))]
seen = [rp.ImageRegion.from_polygon(camera.project(outline)) for outline in outlines]
worlds = [rp.WorldRegion.from_polygon(outline) for outline in outlines]
times.append(time.perf_counter())
rp.estimate_pose(camera, seen, worlds, solver=rp.Solver(driver=sys.argv[1]))
times.append(time.perf_counter())
print(json.dumps([*np.diff(times), times[-1] - times[0]]))
"""


def main() -> int:
    """Print a row for each driver."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    print(f"| driver | {' | '.join(STAGES)} |\n|{'---|' * (len(STAGES) + 1)}")
    for driver in get_args(Driver):
        command = [sys.executable, "-c", SCRIPT, driver]
        runs = [
            json.loads(subprocess.run(command, capture_output=True, check=True).stdout) for _ in range(arguments.runs)
        ]
        print(f"| {driver} | {' | '.join(f'{statistics.median(each):.2f}' for each in zip(*runs, strict=True))} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
