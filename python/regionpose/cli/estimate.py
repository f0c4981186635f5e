"""`regionpose estimate`: from a scene file to a pose and its pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from regionpose.cli.console import Progress, print_json, print_rows
from regionpose.cli.options import AsJson, Force, Quiet, SegmenterName, Strict, scene_with
from regionpose.geometry.units import angle_text, length_text
from regionpose.io.outputs import Writer, claimed

if TYPE_CHECKING:
    from regionpose.scene.bundle import Truth
    from regionpose.scene.estimate import SceneEstimate
    from regionpose.scene.loading import Scene
    from regionpose.scene.stages import Stages

WARNED, DOUBTED = 1, 3
"""Exit codes of a pose with warnings, under --strict, and of one that is doubtful."""


def estimate(
    scene: Annotated[Path, typer.Argument(help="Scene file, YAML or JSON; as docs/scene-file.md describes it.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the files.  [default: SCENE-result, beside it]"),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    strict: Strict = False,
    segmenter: SegmenterName = None,
    quiet: Quiet = False,
) -> None:
    """Estimate the pose of a scene's camera.

    Writes result.json, report.html, overlay.png and, where the scene has a cloud, depth.png, edges.png and cloud.ply
    (colored). Where the scene gives an initial pose, overlay_before.png shows the regions projected with that.

    \b
    Examples:
      regionpose estimate scene.yaml
      regionpose estimate scene.yaml --out result --force
      regionpose estimate scene.yaml --json --quiet | jq .camera_from_world.matrix
      regionpose estimate scene.yaml --segmenter my_sam:predictor
      regionpose estimate scene.yaml --strict && echo "no warnings"
    """
    result = out or scene.with_name(f"{scene.stem}-result")
    run_scene(scene_with(scene, segmenter), result, force=force, as_json=as_json, quiet=quiet, strict=strict)


def run_scene(
    scene: Scene,
    out: Path,
    *,
    force: bool,
    as_json: bool,
    quiet: bool,
    strict: bool = False,
    truth: Truth | None = None,
    extra: Mapping[str, Writer] | None = None,
) -> None:
    """Estimate a checked scene, print the result as soon as it is there, and write its files and `extra` ones to the
    folder `out`.
    """
    with Progress(quiet) as progress:

        def found(run: SceneEstimate, result: dict[str, Any]) -> None:
            if as_json:
                return
            # Whoever reads no more of this may still want the files.
            with suppress(BrokenPipeError), progress.aside():
                _print_result(run, result)

        outcome = scene_outcome(scene, out, progress.stages, force=force, truth=truth, extra=extra, found=found)
    if as_json:
        print_json(outcome.result)
    else:
        typer.echo(f"written: {', '.join(str(path) for path in outcome.written)}")
    code = exit_code(outcome.run, strict=strict)
    if code:
        raise typer.Exit(code)


class Outcome(NamedTuple):
    """The run of a scene, its result as in result.json, and the files that were written."""

    run: SceneEstimate
    result: dict[str, Any]
    written: list[Path]


def scene_outcome(
    scene: Scene,
    out: Path,
    stages: Stages,
    *,
    force: bool,
    truth: Truth | None = None,
    extra: Mapping[str, Writer] | None = None,
    found: Callable[[SceneEstimate, dict[str, Any]], object] = lambda run, result: None,
) -> Outcome:
    """Estimate a checked scene and write its files and `extra` ones to the folder `out`; `found` is called with the
    estimate and its result before anything is drawn.
    """
    from regionpose.scene.bundle import bundle, file_names
    from regionpose.scene.estimate import estimate_scene

    more = dict(extra or {})
    with claimed(out, [*more, *file_names(scene)], force=force) as claim:
        run = estimate_scene(scene, stages)
        files = bundle(run, stages, truth, out, partial(found, run))
        return Outcome(run, files.result, claim.write({**more, **files.writers}))


def exit_code(run: SceneEstimate, *, strict: bool) -> int:
    """The exit code of a pose, 0 of one without a warning that counts."""
    from regionpose.solve.status import PoseStatus

    if run.estimate.status == PoseStatus.DOUBTFUL:
        return DOUBTED
    return WARNED if strict and run.estimate.warnings else 0


def _print_result(run: SceneEstimate, result: dict[str, Any]) -> None:
    _print_pose(run)
    found = result["diagnostics"]
    _print_matching(found)
    if found["regions"]:
        typer.echo("overlap error by region")
        print_rows([(region["name"], _errors(region)) for region in found["regions"]])
        typer.echo("boundary of each 3D region")
        print_rows([(region["name"], _samples_text(region)) for region in found["regions"]])
        _print_frames(found)
    _print_search(found)
    _print_planes(found)
    _print_known(found)
    _print_truth(result)
    typer.echo(f"{result['status']}: {result['headline']}")
    for warning in result["warnings"]:
        typer.echo(f"  warning: {warning['text']}. {warning['advice']}")


def _print_pose(run: SceneEstimate) -> None:
    from regionpose.scene.fit import scene_fit
    from regionpose.scene.searched import vector_text

    estimate, fit = run.estimate, scene_fit(run)
    quaternion = ", ".join(f"{value:.9f}" for value in estimate.pose.rotation.as_quat(canonical=True))
    typer.echo("camera_from_world (x_camera = R x_world + t)")
    print_rows(
        [
            ("quat_xyzw", f"[{quaternion}]"),
            ("translation_m", vector_text(estimate.pose.translation, 6)),
            ("camera center in world, m", vector_text(estimate.pose.camera_center, 6)),
            ("rotation sigma, deg", vector_text(estimate.sigma.rotation_deg, 4)),
            ("translation sigma, m", vector_text(estimate.sigma.translation_m, 5)),
            ("confidence", f"{100.0 * estimate.confidence:.1f} %"),
            *([] if fit.on_their_side is None else [(fit.measure, fit.value)]),
            *_overlap(run),
        ]
    )


def _overlap(run: SceneEstimate) -> list[tuple[str, str]]:
    """The overlap error of all regions, where there are some."""
    from regionpose.scene.fit import scene_fit

    if not run.names:
        return []
    error, less = run.estimate.diagnostics.overlap_error, _counts_less(scene_fit(run).on_their_side)
    return [("overlap error", f"{100.0 * error:.2f} %{less}")]


def _counts_less(on_their_side: float | None) -> str:
    """The text of an overlap error, after the fraction of samples on their side if there is one."""
    return "" if on_their_side is None else " (of outlines that the scan doesn't know; its samples count)"


def _errors(region: dict[str, Any]) -> str:
    """A region's overlap error, after that of the initial pose where there is one."""
    after = f"{100.0 * region['overlap_error']:.2f} %{_counts_less(region['consistent_sample_fraction'])}"
    if "overlap_error_before" not in region:
        return after
    before = region["overlap_error_before"]
    return f"{after}, before: " + ("unknown" if before is None else f"{100.0 * before:.2f} %")


def _samples_text(region: dict[str, Any]) -> str:
    """The source of a region's 3D boundary, and how its samples fit."""
    fraction = region["consistent_sample_fraction"]
    return f"{region['boundary_source']}" + (
        "" if fraction is None else f"; {100.0 * fraction:.1f} % on their side of the outline"
    )


def _print_matching(found: dict[str, Any]) -> None:
    """Which unpaired regions were found to be which."""
    for frame_pairs in found["matching"] or ():
        typer.echo("pairs found" + (f" in {frame_pairs['frame']}" if "frame" in frame_pairs else ""))
        print_rows([(image, world) for image, world in frame_pairs["pairs"]])
        left = [*frame_pairs["unmatched_image_regions"], *frame_pairs["unmatched_world_regions"]]
        if left:
            typer.echo(f"without a partner: {', '.join(left)}")


def _print_frames(found: dict[str, Any]) -> None:
    """How each of several frames fits."""
    rig = found["rig"]
    if rig is not None:
        typer.echo("frames: contours at the pose, and at the pose of the others, px")
        print_rows([(frame["name"], _frame_fit(frame)) for frame in rig["frames"]])
        sigma = rig["between_frame_sigma"]
        if sigma is not None:
            turn, shift = angle_text(sigma["rotation_sigma_deg"]), length_text(sigma["center_sigma_m"])
            typer.echo(f"a frame is off as a whole by {turn} and {shift}; the pose allows for that")


def _frame_fit(frame: dict[str, Any]) -> str:
    own, other = frame["residual_px"], frame["leave_one_out"]
    values = ["unknown" if value is None else f"{value:.2f}" for value in (own, other["residual_px"])]
    return f"{values[0]}, {values[1]}" + (", disagrees with the others" if other["is_outlier"] else "")


def _print_search(found: dict[str, Any]) -> None:
    """What was searched for a pose by edges alone, and the odds of the pose."""
    edges = found["edges"]
    if edges is None:
        return
    from regionpose.scene.searched import odds_text, searched_text

    if edges["regions_only"] is None:
        typer.echo(f"searched: {searched_text(edges)}")
    typer.echo(odds_text(edges))


def _print_planes(found: dict[str, Any]) -> None:
    """Which planes photos confirm at a pose by edges, and how far the pose by these alone is."""
    confirmed = found["confirmed_regions"]
    if confirmed is None:
        return
    for frame in confirmed["frames"]:
        where = f" in {frame['frame']}" if "frame" in frame else ""
        count = f"{len(frame['regions'])} of {frame['compared']}"
        typer.echo(f"planes confirmed{where}: {count}; odds of all borders e^{frame['log_odds']:.1f} over chance")
    pose = confirmed["pose"]
    if pose is not None and pose["distance_sigmas"] is not None:
        turn, shift = max(pose["sigma"]["rotation_deg"]), max(pose["sigma"]["translation_m"])
        known = f"1 sigma {angle_text(turn)} and {length_text(shift)}"
        typer.echo(f"pose by these planes alone ({known}): {pose['distance_sigmas']:.1f} standard deviations away")


def _print_known(found: dict[str, Any]) -> None:
    """Where the scanner stood, and what was made of it."""
    from regionpose.scene.searched import vector_text

    scanner, near = found["sensor_origin"], found["camera_near"]
    if scanner is not None:
        typer.echo(f"scanner at {vector_text(scanner['place_in_world_m'], 3)} m, by {scanner['source']}")
    if near is not None:
        hint = "; prior.camera_near: null if it doesn't" if near["source"] == "sensor_origin" else ""
        place = vector_text(near["place_in_world_m"], 3)
        typer.echo(f"the camera stands near {place} m, to {near['sigma_m']:g} m, by {near['source']}{hint}")


def _print_truth(result: dict[str, Any]) -> None:
    errors = result.get("truth_errors")
    if isinstance(errors, dict):
        turn, shift = angle_text(errors["rotation_deg"]), length_text(errors["camera_center_m"])
        typer.echo(f"error against the truth: {turn}, {shift} (camera center)")
