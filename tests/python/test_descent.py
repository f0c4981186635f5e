"""Descents of a few variables: as good as scipy's, past kinks, and without a thread besides the caller's."""

from __future__ import annotations

import os
import subprocess
import sys
from textwrap import dedent

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose.alignment.descent import Ends, descended
from scipy.optimize import rosen, rosen_der

Array = NDArray[np.float64]

TIGHT = Ends(flat=1e-8, level=0.0, tries=30)


@pytest.mark.parametrize("count", [1, 2, 6, 7])
def test_the_minimum_of_a_bowl_is_found(count: int) -> None:
    rng = np.random.default_rng(count)
    root, least = rng.normal(size=(count, count)) + 2.0 * np.eye(count), rng.normal(size=count)
    curvature = root @ root.T

    def cost(at: Array) -> tuple[float, Array]:
        off = at - least
        return 0.5 * float(off @ curvature @ off), curvature @ off

    np.testing.assert_allclose(descended(cost, np.zeros(count), TIGHT), least, atol=1e-6)


def test_a_bent_valley_is_followed() -> None:
    calls = []

    def cost(at: Array) -> tuple[float, Array]:
        calls.append(at)
        return float(rosen(at)), np.asarray(rosen_der(at))

    np.testing.assert_allclose(descended(cost, np.array([-1.2, 1.0, -0.5, 1.5]), TIGHT), np.ones(4), atol=1e-6)
    assert len(calls) < 200


def test_kinks_are_no_ends() -> None:
    """The largest of |x| and a tilted plane: a line search for a small slope finds none."""

    def cost(at: Array) -> tuple[float, Array]:
        bowl = 0.05 * at
        return float(np.abs(at[:2]).sum() + 0.025 * at @ at), np.concatenate([np.sign(at[:2]), np.zeros(1)]) + bowl

    at = descended(cost, np.array([3.0, -2.0, 4.0]), Ends(flat=1e-3, level=1e-12, tries=40))
    np.testing.assert_allclose(at, 0.0, atol=2e-2)


def test_what_is_no_number_is_no_minimum() -> None:
    def cost(at: Array) -> tuple[float, Array]:
        inside = float(np.abs(at).max()) < 2.0
        return (float((at - 1.5) @ (at - 1.5)) if inside else np.nan), 2.0 * (at - 1.5)

    np.testing.assert_allclose(descended(cost, np.zeros(2), TIGHT), 1.5, atol=1e-6)


PROCESSOR_TIME = """
    import time
    import numpy as np
    from regionpose.alignment.descent import descended
    from regionpose.alignment.posterior import ENDS

    def cost(at):
        return float(0.5 * at @ at + 0.1 * (at**4).sum()), at + 0.4 * at**3

    begun, before = time.thread_time(), time.process_time()
    for _ in range(300):
        descended(cost, np.full(7, 3.0), ENDS)
    print((time.process_time() - before) / (time.thread_time() - begun))
"""


def test_descents_keep_no_other_thread_busy() -> None:
    if len(os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else range(os.cpu_count() or 1)) < 2:
        pytest.skip("needs two cores: BLAS makes no threads on one")
    unlimited = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    command = [sys.executable, "-c", dedent(PROCESSOR_TIME)]
    told = subprocess.run(command, env=unlimited, capture_output=True, text=True, check=True)
    assert float(told.stdout) < 1.2
