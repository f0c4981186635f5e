"""Confirmed regions as plain values for JSON, as a scene file has them."""

from __future__ import annotations

from typing import Any

import numpy as np

from regionpose.scene.confirmed import ConfirmedRegion
from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.values import pose_values, sigma_values, warning_values

REGION_POINTS = "regions.npy"
"""Labels (n,) of a cloud's points, as its file has them: of the confirmed regions from 1, 0 of the rest."""


def confirmed_values(run: SceneEstimate) -> dict[str, Any] | None:
    """The planes that photos confirm at a pose by edges, and the pose by them alone; None of scenes with regions."""
    check = run.regions_found
    if check is None:
        return None
    own = check.estimate
    pairs = [(index, found) for index, found in enumerate(check.frames) if found is not None]
    return {
        "frames": [
            {
                **({"frame": run.frames[index].scene.name} if run.frames[index].scene.name else {}),
                "compared": found.compared,
                "log_odds": found.log_odds,
                "regions": [
                    _confirmed_region(region, label, numbered(REGION_POINTS, index, len(run.frames)))
                    for label, region in enumerate(found.regions, start=1)
                ],
            }
            for index, found in pairs
        ],
        "pose": own
        and {
            "camera_from_world": pose_values(own.pose.rebase(-run.sides.origin)),
            "sigma": sigma_values(own),
            "status": own.status.value,
            "confidence": own.confidence,
            "warnings": [warning_values(warning, check.names) for warning in own.warnings],
            "distance_sigmas": check.distance,
        },
    }


def _confirmed_region(region: ConfirmedRegion, label: int, points: str) -> dict[str, Any]:
    """A confirmed region, its sides as a scene file has them; `points`: the file of the points' labels."""
    rings, hidden = region.image.rings, region.image.hidden
    return {
        "name": region.name,
        "image": {
            "polygon": rings[0],
            "hidden_edges": [] if hidden is None else np.flatnonzero(hidden[0]),
        },
        "world": {"points": points, "label": label},
        "log_odds": region.log_odds,
        "edge_fraction": region.edge_fraction,
        "image_area_px": region.image.area,
        "world_area_m2": region.world.area,
        "cloud_points": len(region.indices),
    }


def numbered(name: str, index: int, count: int) -> str:
    """A file's name with the number of its frame, from 1, where there are several: frames' names may hold anything."""
    stem, dot, ending = name.rpartition(".")
    return name if count == 1 else f"{stem}_{index + 1}{dot}{ending}"
