"""`regionpose segment`: regions grown from seeds, in an image, in a cloud, or all those of a scene."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionpose.cli.console import Progress, print_json, print_rows
from regionpose.cli.options import AsJson, Columns, Force, Quiet, SegmenterName, names_of, numbers_of, scene_with
from regionpose.io.outputs import claimed, refuse_existing, text_writer, write_file

if TYPE_CHECKING:
    from regionpose.regions.image import ImageRegion
    from regionpose.scene.exposure import SceneData
    from regionpose.scene.loading import Scene
    from regionpose.scene.region_sides import WorldSide

SCENE_SUFFIXES = {".yaml", ".yml", ".json"}
SCENE_FILE = "scene.yaml"

Grower = Callable[[Any, tuple[float, ...]], Any]
"""Makes a mask (h, w) of an image and a pixel."""

MASK_LEVEL = 0.5
"""Fraction of a pixel from which it is in the mask that is written."""


def segment(
    source: Annotated[Path, typer.Argument(help="Scene file, image, or point cloud.")],
    seed: Annotated[
        str | None,
        typer.Option("--seed", help="x,y (pixels) in an image; x,y,z (meters) in a cloud.", show_default=False),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="A folder for a scene; .png for an image; .npy (indices) or .ply (points) for a cloud."
        ),
    ] = None,
    tolerance: Annotated[
        float | None, typer.Option("--tolerance", help="In an image: how far the color may differ.")
    ] = None,
    columns: Columns = None,
    segmenter: SegmenterName = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Grow regions from seeds without estimating a pose.

    For a scene file, writes a folder with the mask and the cloud indices of each region and a scene.yaml that names
    them, so that masks can be mended by hand before `regionpose estimate`.

    \b
    Examples:
      regionpose segment scene.yaml --out segmented
      regionpose segment image.jpg --seed 463,498 --out door.png
      regionpose segment cloud.ply --seed 4.63,5.13,0.97 --out door.npy
    """
    from regionpose.io.reading import IMAGE_SUFFIXES

    suffix = source.suffix.lower()
    if suffix in SCENE_SUFFIXES:
        facts = _segment_scene(source, seed, segmenter, out or Path(f"{source.stem}-regions"), force, quiet)
    elif suffix in IMAGE_SUFFIXES or _is_picture(source):
        grow = _grower(tolerance, segmenter)
        facts = _segment_image(
            source, numbers_of("--seed", seed, 2, "x,y"), out or Path("mask.png"), grow, force, quiet
        )
    else:
        facts = _segment_cloud(
            source, names_of(columns), numbers_of("--seed", seed, 3, "x,y,z"), out or Path("region.npy"), force, quiet
        )
    if as_json:
        print_json(facts)
    else:
        rows = [(key.replace("_", " "), str(value)) for key, value in facts.items() if not isinstance(value, list)]
        print_rows(rows, indent="")
        print_rows([(region["name"], _size(region)) for region in facts.get("regions", [])])
        print_rows([("warning:", warning) for warning in facts.get("warnings", [])])


def _is_picture(path: Path) -> bool:
    """Whether a path names a picture in a bag."""
    from regionpose.io.bags.place import bag_place

    place = bag_place(path)
    if place is None:
        return False
    from regionpose.io.bags.messages import kind_of
    from regionpose.io.bags.pictures import KINDS

    return kind_of(place) in KINDS


def _grower(tolerance: float | None, segmenter: str | None) -> Grower:
    """What makes a mask (h, w) of an image and a pixel: growing, or the best one of a segmenter."""
    if segmenter is None:
        from regionpose.segment.image import grow_image_region

        return lambda image, seed: grow_image_region(image, seed, tolerance=tolerance)
    if tolerance is not None:
        raise ValueError("--tolerance: found it beside --segmenter; needed one of them")
    from regionpose.segment.segmenters import load_segmenter, segmented

    predictor = load_segmenter(segmenter)
    return lambda image, seed: segmented(predictor, image, [seed], [1])[0] >= MASK_LEVEL


def _segment_image(
    path: Path,
    seed: tuple[float, ...],
    out: Path,
    grow: Grower,
    force: bool,
    quiet: bool,
) -> dict[str, Any]:
    _check_ending(out, {".png"})
    refuse_existing([out], force)
    import numpy as np
    from PIL import Image

    from regionpose.scene.sensors import read_picture

    with Progress(quiet) as progress:
        progress.begin("image region")
        mask = grow(read_picture(path), seed)
    picture = Image.fromarray(np.where(mask, 255, 0).astype(np.uint8))
    write_file(out, lambda place: picture.save(place, format="PNG"), force=force)
    return {"written": str(out), "pixels": int(np.count_nonzero(mask))}


def _segment_cloud(
    path: Path, columns: list[str] | None, seed: tuple[float, ...], out: Path, force: bool, quiet: bool
) -> dict[str, Any]:
    _check_ending(out, {".npy", ".ply"})
    refuse_existing([out], force)
    import numpy as np

    from regionpose.io.clouds import Cloud, write_ply
    from regionpose.segment.cloud import grow_plane

    with Progress(quiet) as progress:
        cloud = progress.read_cloud(path, columns)
        progress.begin("world region")
        start = np.asarray(seed) - cloud.origin
        indices = np.asarray(grow_plane(cloud.local_points, start, progress=progress.fraction))
    if out.suffix.lower() == ".npy":
        write_file(out, lambda place: np.save(place, cloud.to_file_indices(indices)), force=force)
    else:
        colors = None if cloud.colors is None else cloud.colors[indices]
        part = Cloud(cloud.local_points[indices], colors=colors, origin=cloud.origin)
        write_file(out, lambda place: write_ply(place, part), force=force)
    return {"written": str(out), "points": len(indices)}


def _check_ending(out: Path, endings: set[str]) -> None:
    if out.suffix.lower() not in endings:
        raise ValueError(f"{out}: found the ending {out.suffix!r}; needed {' or '.join(sorted(endings))}")


def _segment_scene(
    path: Path, seed: str | None, segmenter: str | None, out: Path, force: bool, quiet: bool
) -> dict[str, Any]:
    if seed is not None:
        raise ValueError(f"--seed: found {seed!r} with a scene file; needed none, its regions have their own")
    from regionpose.scene.exposure import scene_sides
    from regionpose.scene.loading import named_regions

    scene = scene_with(path, segmenter)
    names = [name(index, region.name) for index, region in enumerate(named_regions(scene)) for name in NAMES]
    names.append(SCENE_FILE)
    with claimed(out, names, force=force) as claim, Progress(quiet) as progress:
        sides = scene_sides(scene, progress.stages)
        claim.write(_scene_writers(scene, sides, out))
    remarks = [f"{warning.code}: {warning.text_with(sides.names)}" for warning in sides.warnings]
    return {"written": str(out), "regions": _sizes(sides), "warnings": remarks}


def _scene_writers(scene: Scene, sides: SceneData, out: Path) -> dict[str, Any]:
    """Writers of the masks, the indices, and a scene file that names them."""
    import numpy as np
    from PIL import Image

    from regionpose.io.yaml_text import to_yaml
    from regionpose.scene.paths import rebased

    writers: dict[str, Any] = {}
    values: Any = rebased(scene.document.value, scene.path.parent, out)
    for index, (region, observed, world) in enumerate(_with_sides(values, sides)):
        if observed is not None and observed.mask is not None:
            picture = Image.fromarray(np.where(observed.mask.full() > MASK_LEVEL, 255, 0).astype(np.uint8))
            region["image"] = _kept(region["image"], "unknown", "unknown_label")
            region["image"]["mask"] = _mask_name(index, region["name"])
            writers[region["image"]["mask"]] = partial(picture.save, format="PNG")
        if world is not None and world.indices is not None and sides.cloud is not None:
            region["world"] = _kept(region["world"], "viewpoint", "radius_m", "extends")
            region["world"]["points"] = _points_name(index, region["name"])
            writers[region["world"]["points"]] = partial(np.save, arr=sides.cloud.to_file_indices(world.indices))
    writers[SCENE_FILE] = text_writer(to_yaml(values))
    return writers


def _with_sides(
    values: dict[str, Any], sides: SceneData
) -> Iterator[tuple[dict[str, Any], ImageRegion | None, WorldSide | None]]:
    """The regions that a scene's values write out, as `named_regions` orders them, and the sides that each has."""
    loose, worlds = sides.unpaired, values.get("world_regions", [])
    yield from zip(values.get("regions", []), sides.image_regions, sides.world_sides, strict=True)
    for written, region in zip(values.get("image_regions", []), loose.image_regions, strict=True):
        yield written, region, None
    if isinstance(worlds, list):
        for written, side in zip(worlds, loose.world_sides, strict=True):
            yield written, None, side


def _kept(side: dict[str, Any], *keys: str) -> dict[str, Any]:
    """Those keys of a region's side that hold however it was found."""
    return {key: side[key] for key in keys if key in side}


def _slug(index: int, name: str) -> str:
    return f"{index + 1:02d}-{re.sub(r'[^A-Za-z0-9]+', '-', name).strip('-').lower() or 'region'}"


def _mask_name(index: int, name: str) -> str:
    return f"{_slug(index, name)}.png"


def _points_name(index: int, name: str) -> str:
    return f"{_slug(index, name)}.npy"


NAMES = (_mask_name, _points_name)
"""Names of the files that may be written of a region."""


def _sizes(sides: SceneData) -> list[dict[str, Any]]:
    """Sizes of the pairs, and of each region of one side."""
    from regionpose.scene.result import plain, region_sizes, world_sizes

    loose = sides.unpaired
    images = zip(loose.image_names, loose.image_regions, strict=True)
    worlds = zip(loose.world_names, loose.world_sides, strict=True)
    sizes = [
        *region_sizes(sides),
        *({"name": name, "image_area_px": region.area} for name, region in images),
        *({"name": name, **world_sizes(side)} for name, side in worlds),
    ]
    return [plain(size) for size in sizes]


def _size(region: dict[str, Any]) -> str:
    parts = [f"{region['image_area_px']:.0f} px"] if "image_area_px" in region else []
    if "world_area_m2" in region:
        points = [] if region["cloud_points"] is None else [f"{region['cloud_points']} points"]
        parts += [f"{region['world_area_m2']:.3f} m2", *points, region["boundary_source"]]
    return ", ".join(parts)
