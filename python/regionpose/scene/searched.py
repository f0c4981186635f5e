"""What a search by edges covered and found, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from regionpose.geometry.pose import Pose

DEFAULT_UP_SIGMA_DEG = 15.0
"""Standard deviation of a direction up where none is given, as of `Prior`."""


def searched_text(found: Mapping[str, Any]) -> str:
    """The poses that were searched; `found`: `edges` of a result's diagnostics."""
    prior = found["prior"]
    initial, sigma_m, place = prior["initial_camera_from_world"], prior["camera_near_sigma_m"], prior["camera_near_m"]
    if place is None:
        sigma_m, place = prior["initial_center_sigma_m"], Pose.from_matrix(initial["matrix"]).camera_center
    near = f"within {sigma_m:g} m (1 sigma) of {vector_text(place, 2)} m"
    turns = "every rotation"
    if prior["initial_rotation_sigma_deg"] is not None:
        turns = f"rotations within {prior['initial_rotation_sigma_deg']:g} deg (1 sigma) of the initial one"
    elif prior["up"] is not None:
        sigma_deg = prior["up_sigma_deg"] or DEFAULT_UP_SIGMA_DEG
        turns = f"every heading, {vector_text(prior['up'], 1)} being up to {sigma_deg:g} deg (1 sigma)"
    return f"{near}{' (assumed)' * bool(found['assumed'])}; {turns}"


def odds_text(found: Mapping[str, Any]) -> str:
    """The odds of the pose over chance and over the next one; `found` as above."""
    margin = found["log_odds_over_next"]
    # No number of JSON is infinite.
    is_alone = margin is None or not np.isfinite(margin)
    others = "no other pose" if is_alone else f"e^{margin:.1f} over the likeliest other pose"
    return f"{found['count']} edges; odds e^{found['log_odds']:.1f} over chance, {others}"


def vector_text(values: object, digits: int) -> str:
    """Numbers (n,) as a list, to so many digits."""
    # Without the sign of what is rounded to nothing.
    rounded = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return "[" + ", ".join(f"{value:.{digits}f}" for value in rounded) + "]"
