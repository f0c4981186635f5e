"""Problems whose disturbance is named but not how strong it is: the seed draws that, and all else of the condition."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.synthetic.scenes import problem_generator
from benchmarks.synthetic.setups import Setup
from benchmarks.synthetic.studies.conditions import Condition, NoiseModel
from benchmarks.synthetic.studies.problems import StudyProblem, draw_problem

DRAWN = (
    "planes",
    "templates",
    "disturbance",
    "side",
    "noise",
    "masks",
    "lidar_beams",
    "range_noise_m",
    "scan",
    "focal_error",
    "center_error_px",
    "wrong",
)
"""Fields of the condition that the seed and its noise model decide."""

PLANES = (1, 1, 2, 2, 3, 3, 4, 5)
PLANES_WITH_WRONG = (2, 3, 4, 5)
"""A single region that lies elsewhere is a region seen from elsewhere: no error that anyone could tell."""

MOST_SQUARES, MOST_HIDDEN, MOST_COMBINED = 0.2, 0.4, 0.1
MOST_RANGE_NOISE_M = 0.03
MOST_FOCAL_ERROR, MOST_CENTER_ERROR_PX = 0.01, 3.0
LIDAR_BEAMS = (16, 32, 64, 128)

SCENE_TRIES = 50
"""Scenes that are drawn at the most until one can be given to an estimate."""


def draw_mixed_problem(setup: Setup, condition: Condition, seed: int) -> StudyProblem:
    """The problem of a seed under the condition's noise model; no two models or cameras have a scene in common.

    The scene is drawn again where the disturbance leaves nothing to solve, as of a region that the lidar's fan misses.
    """
    rng = problem_generator(seed, f"{condition.camera} {condition.model}")
    drawn = drawn_condition(condition, rng)
    for left in reversed(range(SCENE_TRIES)):
        try:
            problem = draw_problem(setup, drawn, int(rng.integers(2**62)))
            break
        except ValueError:
            if not left:
                raise
    return replace(problem, drawn={name: getattr(drawn, name) for name in DRAWN})


def drawn_condition(condition: Condition, rng: np.random.Generator) -> Condition:
    """The condition with every field of `DRAWN` set: shapes, planes, masks; strengths uniform within their ranges."""
    planes = PLANES_WITH_WRONG if condition.model == "wrong-region" else PLANES
    held: dict[str, Any] = {
        "planes": int(rng.choice(planes)),
        "templates": str(rng.choice(("asymmetric", "symmetric", "all"))),
        "masks": str(rng.choice(("binary", "coverage"))),
    }
    return replace(condition, **held, **_disturbance(condition.model, rng))


def _disturbance(model: NoiseModel, rng: np.random.Generator) -> dict[str, Any]:
    """Fields of the condition that a noise model sets."""
    side = str(rng.choice(("2d", "3d")))
    beams, range_noise = int(rng.choice(LIDAR_BEAMS)), rng.uniform(0.0, MOST_RANGE_NOISE_M)
    # As scene files and commands take a scan.
    lidar = {"lidar_beams": beams, "range_noise_m": range_noise, "scan": "samples"}
    calibration = {
        "focal_error": rng.uniform(0.0, MOST_FOCAL_ERROR),
        "center_error_px": rng.uniform(0.0, MOST_CENTER_ERROR_PX),
    }
    squares, hidden = rng.uniform(0.0, MOST_SQUARES), rng.uniform(0.0, MOST_HIDDEN)
    combined = {"noise": rng.uniform(0.0, MOST_COMBINED), **lidar, **calibration}
    fields: dict[NoiseModel, dict[str, Any]] = {
        "exact": {},
        "squares-2d": {"noise": squares},
        "squares-3d": {"side": "3d", "noise": squares},
        "occlusion": {"disturbance": "occlusion", "side": side, "noise": hidden},
        "truncation": {"disturbance": "truncation", "noise": hidden},
        "lidar": lidar,
        "calibration": calibration,
        "wrong-region": {"wrong": str(rng.choice(("shape", "place"))), "side": side},
        "combined": combined,
    }
    return fields[model]
