"""Masks that one click proposes on the labeled faces of real photos, against the faces as they were drawn.

The scenes are folders with image.png and regions.json below --data. The click is the pixel deepest inside the drawn
face; of the masks that `regionpose pick` proposes there the best one counts. A line each, then the share of faces with
an overlap (IoU) of 0.9, and the median. A drawn face holds its windows, and a mask by color doesn't; the inner
rectangle of a chessboard has no edge of its own: the corners of its squares determine it.

With --elsewhere the click is some other pixel inside, at random but the same in each run of the same faces.

    python -m benchmarks.click_masks [--data ../shared/data] [--only natural kitti] [--elsewhere]
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from regionpose.app.parts import ImagePart
from regionpose.app.proposals import mask_choices
from scipy.ndimage import distance_transform_edt

from benchmarks.image_segmentation import FAILED_IOU, deepest

Mask = NDArray[np.bool_]
INSIDE = 0.4
"""Depth of a random click over the greatest: people click off the outline. A convention."""

DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


class Face(NamedTuple):
    """A drawn face of a photo (h, w, 3), by its scene's and its own name."""

    scene: str
    name: str
    image: NDArray[np.uint8]
    mask: Mask


def faces(data: Path, kinds: list[str] | None) -> Iterator[Face]:
    """The drawn faces of the scenes of some kinds, of all without a choice."""
    for path in sorted(data.glob("*/*/regions.json")):
        if kinds and path.parent.parent.name not in kinds:
            continue
        image = np.asarray(Image.open(path.parent / "image.png").convert("RGB"))
        held = json.loads(path.read_text(encoding="utf-8"))
        for region in held["regions"] if isinstance(held, dict) else held:
            scene = "/".join(path.parts[-3:-1])
            yield Face(scene, region["name"], image, filled(region["image_polygon"], image.shape))


def pixels_of(part: ImagePart, shape: tuple[int, ...]) -> Mask:
    """The pixels (h, w) of a proposal."""
    return filled(part.rings[0], shape) if part.is_polygon else part.levels > 127


def filled(polygon: list[list[float]], shape: tuple[int, ...]) -> Mask:
    """The pixels (h, w) of a polygon."""
    canvas = Image.new("L", (shape[1], shape[0]))
    ImageDraw.Draw(canvas).polygon([tuple(vertex) for vertex in polygon], fill=1)
    return np.asarray(canvas) > 0


def elsewhere(mask: Mask, rng: np.random.Generator) -> tuple[int, int]:
    """A random pixel (x, y) of a mask, at least `INSIDE` as far from its outline as the deepest one."""
    depth = distance_transform_edt(mask)
    rows, columns = np.nonzero(depth >= INSIDE * depth.max())
    chosen = rng.integers(len(rows))
    return int(columns[chosen]), int(rows[chosen])


def overlaps(face: Face, click: tuple[int, int]) -> list[float]:
    """The IoU of each mask that a click proposes; none where nothing grows."""
    try:
        choices = mask_choices(face.image, click)
    except ValueError:
        return []
    masks = [pixels_of(choices.at(index).chosen, face.image.shape) for index in range(len(choices))]
    return [float((mask & face.mask).sum() / (mask | face.mask).sum()) for mask in masks]


def main() -> None:
    """Print the overlaps of all faces and their summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--only", nargs="+", help="kinds of scenes, the folders below --data")
    parser.add_argument("--elsewhere", action="store_true", help="click at a random place inside")
    options = parser.parse_args()
    best, seconds, rng = [], [], np.random.default_rng(1)
    for face in faces(options.data, options.only):
        click, start = elsewhere(face.mask, rng) if options.elsewhere else deepest(face.mask), time.process_time()
        found = overlaps(face, click)
        seconds.append(time.process_time() - start)
        best.append(max(found, default=0.0))
        print(f"{face.scene:28} {face.name:28} " + " ".join(f"{value:.2f}" for value in found), flush=True)
    if not best:
        print(f"no scenes below {options.data}")
        return
    share = 100.0 * float(np.mean(np.array(best) >= FAILED_IOU))
    print(f"{len(best)} faces: {share:.0f} % reach an IoU of {FAILED_IOU}; median {np.median(best):.2f}")
    print(f"processor time with all masks of a click: median {np.median(seconds):.1f} s")


if __name__ == "__main__":
    main()
