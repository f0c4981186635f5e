"""Several cameras of one rig in a run of `regionpose calibrate`: their scenes, results and exit code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

from regionpose.cli.console import BAD_INPUT, Progress, error_code, one_line, print_json, print_remarks
from regionpose.cli.estimate import DOUBTED, WARNED, Outcome, exit_code, scene_outcome
from regionpose.io.outputs import refuse_existing, text_writer

if TYPE_CHECKING:
    from regionpose.scene.folder import FolderOptions
    from regionpose.scene.loading import Scene

SCENE_FILE = "scene.yaml"

BY_SEVERITY = (0, WARNED, DOUBTED, BAD_INPUT)
"""Exit codes of cameras, the worst last."""


def unpaired_photos(photos: Sequence[Path]) -> list[str]:
    """The remark about photos without a cloud, where there are some."""
    return [f"left out, no cloud of the name: {', '.join(photo.name for photo in photos)}"] if photos else []


def camera_scenes(
    rig: Path,
    folders: Sequence[Path],
    out: Path,
    options: FolderOptions,
    priors: Mapping[str, dict[str, Any]],
    *,
    quiet: bool,
) -> dict[str, Scene]:
    """The scene of each camera's folder, to be written to a folder of its name in `out`."""
    from regionpose.scene.folder import CLOUDS, folder_scene

    scenes: dict[str, Scene] = {}
    with Progress(quiet) as progress:
        progress.begin("pairs of the folders")
        remarks: list[str] = []
        for folder in folders:
            camera = options.camera
            if isinstance(camera, dict):
                camera = {"name": folder.name, **camera}
            elif camera is not None:
                camera = {"file": camera, "name": folder.name}
            own = replace(options, camera=camera, prior=priors[folder.name])
            path = out / folder.name / SCENE_FILE
            scenes[folder.name], alone = folder_scene(folder, path, own, (rig / CLOUDS, rig))
            remarks += [f"{folder.name}: {remark}" for remark in unpaired_photos(alone)]
    print_remarks(remarks, quiet)
    return scenes


class Failed(NamedTuple):
    """Why a camera has no result, and the exit code for that."""

    message: str
    code: int


def run_cameras(
    scenes: Mapping[str, Scene], out: Path, *, force: bool, as_json: bool, quiet: bool, strict: bool
) -> None:
    """Estimate each camera, write its files to the folder of its name in `out`, and print all results."""
    from regionpose.scene.bundle import file_names

    for name, scene in scenes.items():
        refuse_existing([out / name / file for file in (SCENE_FILE, *file_names(scene))], force)
    outcomes: dict[str, Outcome | Failed] = {}
    with Progress(quiet) as progress:
        for number, (name, scene) in enumerate(scenes.items(), start=1):
            stages = progress.stages
            with stages.within(f"camera {number} of {len(scenes)}, {name}"):
                extra = {SCENE_FILE: text_writer(scene.document.content.decode())}
                try:
                    outcomes[name] = scene_outcome(scene, out / name, stages, force=force, extra=extra)
                except (ValueError, OSError) as error:
                    outcomes[name] = Failed(one_line(error), error_code(error))
    if as_json:
        print_json({"cameras": {name: _values(outcome) for name, outcome in outcomes.items()}})
    else:
        _print_result(outcomes, out)
    for name, outcome in outcomes.items():
        if isinstance(outcome, Failed):
            typer.echo(f"error: {name}: {outcome.message}", err=True)
    codes = [one.code if isinstance(one, Failed) else exit_code(one.run, strict=strict) for one in outcomes.values()]
    worst = max(codes, key=BY_SEVERITY.index)
    if worst:
        raise typer.Exit(worst)


def _values(outcome: Outcome | Failed) -> dict[str, Any]:
    return {"error": outcome.message} if isinstance(outcome, Failed) else outcome.result


HEADINGS = ("camera", "status", "quat_xyzw", "translation, m", "sigma, deg", "sigma, m")


def _print_result(outcomes: Mapping[str, Outcome | Failed], out: Path) -> None:
    """A table of all cameras (camera_from_world, the largest standard deviations), and their warnings."""
    from regionpose.scene.searched import vector_text

    rows, remarks = [HEADINGS], list[str]()
    for name, outcome in outcomes.items():
        if isinstance(outcome, Failed):
            rows.append((name, "no pose", "", "", "", ""))
            continue
        estimate = outcome.run.estimate
        rows.append(
            (
                name,
                estimate.status.value,
                vector_text(estimate.pose.rotation.as_quat(canonical=True), 6),
                vector_text(estimate.pose.translation, 4),
                f"{estimate.sigma.rotation_deg.max():.3f}",
                f"{estimate.sigma.translation_m.max():.4f}",
            )
        )
        warnings = outcome.result["warnings"]
        remarks += [f"{name}: warning: {warning['text']}. {warning['advice']}" for warning in warnings]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        typer.echo("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    for remark in remarks:
        typer.echo(remark)
    folders = [str(out / name) for name, outcome in outcomes.items() if isinstance(outcome, Outcome)]
    if folders:
        typer.echo(f"written: {', '.join(folders)}")
