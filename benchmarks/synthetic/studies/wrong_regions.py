"""One region of a scene that is simply wrong: another shape, or in another place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.synthetic.masks import Array, ProjectionError, image_size, project_region
from benchmarks.synthetic.noise import another_shape, elsewhere
from benchmarks.synthetic.scenes import ScenePlacementError, SyntheticScene
from benchmarks.synthetic.studies.conditions import Condition, Wrong
from benchmarks.synthetic.templates import all_templates

TRIES = 200
"""Times that a wrong region is drawn until the image holds it."""


def with_wrong_region(
    scene: SyntheticScene, condition: Condition, rng: np.random.Generator
) -> tuple[int | None, SyntheticScene]:
    """Index of the region that is wrong, and the scene with it; None and the same scene where the condition has none.

    On side "2d" the wrong region lies in the image as a whole, or ScenePlacementError.
    """
    if condition.wrong == "none":
        return None, scene
    index = int(rng.integers(len(scene.regions)))
    for _ in range(TRIES):
        rings = wrong_rings(scene, index, condition.wrong, rng)
        if condition.side == "3d" or _in_image(scene, rings):
            regions = [rings if place == index else region for place, region in enumerate(scene.regions)]
            return index, replace(scene, regions=regions)
    raise ScenePlacementError(
        f"the wrong region {index} left the image in each of {TRIES} places; a wider one is needed"
    )


def wrong_rings(scene: SyntheticScene, index: int, wrong: Wrong, rng: np.random.Generator) -> list[Array]:
    """(n, 3) rings in place of one region's: another template's of its area and centroid, or its own elsewhere."""
    rings = scene.regions[index]
    if wrong == "place":
        return elsewhere(rings, rng)
    others = [template for template in all_templates() if template.name != scene.names[index]]
    return another_shape(rings, others[int(rng.integers(len(others)))].region(), rng)


def _in_image(scene: SyntheticScene, rings: list[Array]) -> bool:
    try:
        pixels = np.concatenate(project_region(scene.camera, scene.rotation, scene.translation, rings))
    except ProjectionError:
        return False
    return bool((pixels > 0.0).all() and (pixels < np.array(image_size(scene.camera)) - 1.0).all())
