"""`regionpose pick`: regions clicked in the browser."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionpose.cli.console import Progress
from regionpose.cli.options import CAMERA_HELP, Columns, Quiet, SegmenterName, names_of
from regionpose.cli.prior_options import Mounts, Near, PriorOptions, Up

if TYPE_CHECKING:
    from regionpose.app.session import Session
    from regionpose.scene.stages import Stages


def pick(
    scene: Annotated[
        Path, typer.Argument(help="Scene file to read, and to save to, or a folder of photos and clouds of one rig.")
    ] = Path("scene.yaml"),
    image: Annotated[Path | None, typer.Option("--image", help="Photo of a new scene.", show_default=False)] = None,
    camera: Annotated[Path | None, typer.Option("--camera", help=f"{CAMERA_HELP}", show_default=False)] = None,
    cloud: Annotated[Path | None, typer.Option("--cloud", help="Cloud of a new scene.", show_default=False)] = None,
    columns: Columns = None,
    near: Near = None,
    up: Up = None,
    mount: Mounts = None,
    demo: Annotated[bool, typer.Option("--demo", help="A new scene of the demo's photo and cloud.")] = False,
    segmenter: SegmenterName = None,
    port: Annotated[int, typer.Option("--port", help="Port of this computer; 0 for any that is free.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    quiet: Quiet = False,
) -> None:
    """Look at the pose of a photo and a cloud; where it is not trusted, click regions, and it follows every click.

    The page opens with the pose by the edges of photo and cloud, as of `regionpose calibrate`. --near, --up and --mount
    narrow its search, in the place of SCENE's prior. Save writes SCENE and its masks, and `regionpose
    estimate SCENE` then gives the same pose. The page is served to this computer only. Ctrl-C ends it. A folder holds
    pairs such as 0001.png and 0001.pcd of one pose: they are looked at one after the other, and saved as one scene
    file, FOLDER/scene.yaml.

    \b
    Examples:
      regionpose pick --demo
      regionpose pick --image photo.jpg --camera calib.yaml --cloud scan.ply --up z
      regionpose pick scene.yaml
      regionpose pick drive --camera calib.yaml --up z --mount front
      regionpose pick scene.yaml --segmenter my_sam:predictor
    """
    from regionpose.app.server import serve
    from regionpose.app.shared_session import SharedSession
    from regionpose.segment.segmenters import load_segmenter

    prior_options = PriorOptions.of(near, up, mount or (), None)
    prior_options.check([])
    prior = prior_options.prior()
    with Progress(quiet) as progress:
        session = _session(
            scene, {"--image": image, "--camera": camera, "--cloud": cloud}, names_of(columns), demo, progress.stages
        )
        if prior:
            _narrow(session, prior)
        if segmenter is not None:
            session.segmenter = load_segmenter(segmenter)
        progress.begin(f"pictures of {len(session.cloud)} points")
        shared = SharedSession(session)
    try:
        serve(shared, port=port, browser=browser, show_address=lambda address: typer.echo(f"pick at {address}"))
    finally:
        # Pages are thousands of objects in circles each, which Python looks through at its end: minutes for many pages.
        gc.freeze()


def _narrow(session: Session, prior: dict[str, Any]) -> None:
    """Set a session's prior from options; ValueError that names them."""
    if prior.get("camera_near_sigma_m") is not None and "camera_near" not in prior and session.scanner is None:
        found = "found a deviation, but the scanner's place is not known"
        raise ValueError(f"--near: {found}; needed x,y,z,sigma, or the key sensor_origin in the scene")
    try:
        session.set_prior(prior)
    except ValueError as error:
        message = str(error).removeprefix(f"{session.path}: ")
        raise ValueError(f"--near, --up or --mount: {message}") from error


def _session(
    scene: Path, files: dict[str, Path | None], columns: list[str] | None, demo: bool, stages: Stages
) -> Session:
    """The session of a scene file, or of the files of a new one."""
    from regionpose.app.session import Session

    if columns is not None and files["--cloud"] is None:
        raise ValueError("--columns: found names of columns without --cloud; needed it beside")
    if scene.is_dir() or (scene.exists() and _has_frames(scene)):
        return _frame(scene, files, demo, stages)
    given = [*(name for name, path in files.items() if path is not None), *(["--demo"] if demo else [])]
    if given and scene.exists():
        raise FileExistsError(f"{scene}: the file exists; needed no {given[0]} to open it, or the name of a new one")
    if demo:
        from regionpose.datasets.demo import demo_folder

        folder = demo_folder()
        return Session.create(
            scene,
            image=folder / "image.jpg",
            camera=folder / "camera_info.yaml",
            cloud=folder / "cloud.ply",
            stages=stages,
            sensor_origin=[0, 0, 0],
        )
    if not given:
        if not scene.exists():
            raise FileNotFoundError(f"{scene}: no such file; needed a scene file, or --image, --camera and --cloud")
        return Session.open(scene, stages=stages)
    paths = {name.removeprefix("--"): path for name, path in files.items() if path is not None}
    if len(paths) < len(files):
        missing = next(name for name, path in files.items() if path is None)
        raise ValueError(f"{missing}: found nothing; needed --image, --camera and --cloud for a new scene")
    image, camera, cloud = (paths[name] for name in ("image", "camera", "cloud"))
    return Session.create(scene, image=image, camera=camera, cloud=cloud, columns=columns, stages=stages)


def _has_frames(scene: Path) -> bool:
    """Whether a scene file holds several frames."""
    from regionpose.scene.document import read_document

    value = read_document(scene).value
    return isinstance(value, dict) and isinstance(value.get("frames"), list)


def _frame(scene: Path, files: dict[str, Path | None], demo: bool, stages: Stages) -> Session:
    """The session of the first frame of a folder, or of a scene file with frames."""
    from regionpose.app.frames import Frames

    taken = {"--camera"} if scene.is_dir() else set()
    odd = [name for name, path in files.items() if path is not None and name not in taken]
    if odd or demo:
        what = "a folder of frames" if scene.is_dir() else "a scene of frames"
        raise ValueError(f"{(odd or ['--demo'])[0]}: found it beside {scene}, {what}; needed none")
    frames = Frames.of_folder(scene, files["--camera"]) if scene.is_dir() else Frames.of_scene(scene)
    return frames.session_at(0, stages)
