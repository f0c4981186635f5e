"""What is large takes little room: memory by how much a process held at the most."""

from __future__ import annotations

import subprocess
import sys

MOST_MB = 100
"""Half the room that the pairs of 2,000 lines beside each other took, each with what it shares with the others."""

COMB = """
import resource
import numpy as np
import regionpose as rp

teeth = 3_000
tooth = np.array([[0.02, 0.0], [1.0, 0.1], [1.0, 0.4], [0.02, 0.5]])
places = tooth * [1.0, 1.0 / teeth] + np.c_[np.zeros(teeth), np.arange(teeth) / teeth][:, None]
flat = np.vstack([places.reshape(-1, 2), [[0.02, 1.0], [0.0, 1.0], [0.0, 0.0]]])
comb = np.c_[flat, 0.2 * flat[:, 1]]
shift = np.array([-0.5, -0.5, 3.0])
world = rp._core.WorldRegion.from_rings([comb])
observed = rp._core.ObservedRegion([comb + shift], 40_000.0)
problem = rp._core.Problem([observed], [world], system="plane", integration="boundary")
held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
error, _ = problem.overlap_errors(np.eye(3), shift)
print(error, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held) // 1000)
"""


def test_the_overlap_of_a_comb_takes_little_memory() -> None:
    """12,000 vertices, with 6,000 lines beside each other: their pairs would take gigabytes."""
    said = subprocess.run([sys.executable, "-c", COMB], capture_output=True, text=True, timeout=100, check=True).stdout
    error, megabytes = said.split()
    assert float(error) < 1e-10
    assert int(megabytes) < MOST_MB
