"""The commands together, and how they end."""

from __future__ import annotations

import signal
import threading
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from regionpose import __version__
from regionpose.cli import calibrate, demo, estimate, export, fuse, info, pick, project, schema, segment
from regionpose.cli.console import BAD_INPUT, error_code, one_line

FINE, INTERRUPTED, TERMINATED = 0, 130, 143

Handler = Callable[..., object]

HAS_TIMER = hasattr(signal, "setitimer")

AGAIN_S = 2.0
"""Seconds after which SIGTERM is handled again if the run still goes on: an exception is lost where it is raised in a
callback, as in that of an import's lock. Longer than what ends a run tidies up: a convention."""

HELP = """Estimate where a camera stood, from flat regions that its photo and a point cloud both show.

\b
Examples:
  regionpose demo --out demo
  regionpose pick --image photo.jpg --camera calib.yaml --cloud scan.ply
  regionpose estimate scene.yaml --out result
  regionpose info camera_info.yaml

\b
Exit codes:
  0  fine
  1  a pose with warnings, under --strict
  2  bad input, or a file that would be overwritten
  3  no pose shows the regions as they were observed, or the pose is doubtful (its files are written)
  130  interrupted (Ctrl-C); nothing was written, or all files were already
  143  terminated (SIGTERM); nothing was written, or all files were already
"""

app = typer.Typer(
    help=HELP,
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("estimate")(estimate.estimate)
app.command("calibrate")(calibrate.calibrate)
app.command("pick")(pick.pick)
app.command("segment")(segment.segment)
app.command("export")(export.export)
app.command("fuse")(fuse.fuse)
app.command("project")(project.project)
app.command("demo")(demo.demo)
app.command("info")(info.info)
app.command("schema")(schema.schema)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"regionpose {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options of every command."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit code of the command line `arguments` (those of the process when None).

    Expected errors (bad input, files, a missing extra) are one line on standard error; others are raised.
    """
    return run_command(app, arguments, "regionpose")


def run_command(app: typer.Typer, arguments: Sequence[str] | None, program: str) -> int:
    """The exit code of a command line of `app`, whose help calls it `program`; errors as `main` has them."""
    if arguments is None:
        # The process is this program's alone. Readers have a limit of their own, with an error where it is exceeded.
        warnings.filterwarnings("ignore", "Image size .* exceeds limit")
    return _ended_by_signals(lambda: _run(app, arguments, program))


def _run(app: typer.Typer, arguments: Sequence[str] | None, program: str) -> int:
    try:
        app(args=None if arguments is None else list(arguments), prog_name=program)
    except SystemExit as end:
        # Typer ends with 1 after Ctrl-C, which is the code of --strict here.
        code = INTERRUPTED if isinstance(end.__context__, typer.Abort) else end.code
        return code if isinstance(code, int) else FINE
    except (ValueError, OSError) as error:
        return _failed(one_line(error), error_code(error))
    except ImportError as error:
        if not _is_missing_extra(error):
            raise
        return _failed(one_line(error), BAD_INPUT)
    return FINE


def _ended_by_signals(run: Callable[[], int]) -> int:
    """The exit code of `run`. SIGTERM ends it as an exception does, so that nothing half made stays; in the main thread
    alone.
    """
    if threading.current_thread() is not threading.main_thread():
        return run()

    is_ended = False

    def end(*_: object) -> None:
        nonlocal is_ended
        is_ended = True
        if HAS_TIMER:
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S)
        raise SystemExit(TERMINATED)

    handlers: dict[int, Handler] = {signal.SIGTERM: end}
    if HAS_TIMER:
        handlers[signal.SIGALRM] = lambda *_: signal.raise_signal(signal.SIGTERM)
    before = {number: signal.getsignal(number) for number in handlers}

    def restore() -> None:
        if HAS_TIMER and is_ended:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)

    try:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        try:
            return run()
        finally:
            restore()
    except (KeyboardInterrupt, SystemExit) as ended:
        # Outside of Typer's care, as when the work is done already; then the handlers may not be back.
        restore()
        return INTERRUPTED if isinstance(ended, KeyboardInterrupt) else TERMINATED


def _is_missing_extra(error: ImportError) -> bool:
    from regionpose.io.clouds import MissingExtraError

    return isinstance(error, MissingExtraError)


def _failed(message: str, code: int) -> int:
    typer.echo(f"error: {message}", err=True)
    return code
