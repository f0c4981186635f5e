"""`regionpose demo`: the whole pipeline on the scene that ships with the package."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from regionpose.cli.estimate import run_scene
from regionpose.cli.options import AsJson, Force, Quiet


class Source(StrEnum):
    """Where the demo's regions come from."""

    seeds = "seeds"
    masks = "masks"


SCENES = {Source.seeds: "scene.yaml", Source.masks: "scene_masks.yaml"}


def demo(
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the files.")] = Path("regionpose-demo"),
    source: Annotated[
        Source, typer.Option("--from", help="Grow the regions from one click each, or read their masks.")
    ] = Source.seeds,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Run everything on the scene that ships with the package.

    Segmentation, pose, colored cloud, pictures and report; compares the pose with the truth. Takes some seconds.

    \b
    Examples:
      regionpose demo --out demo
      regionpose demo --out demo --from masks --force
      regionpose demo --json --quiet | jq .truth_errors
    """
    from regionpose.datasets.demo import demo_folder
    from regionpose.scene.bundle import read_truth
    from regionpose.scene.loading import load_scene

    files = demo_folder()
    truth = read_truth(files / "truth.json")
    scene = load_scene(files / SCENES[source])
    run_scene(scene, out, force=force, as_json=as_json, quiet=quiet, truth=truth)
