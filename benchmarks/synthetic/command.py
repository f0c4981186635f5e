"""`python -m benchmarks`: a study of the synthetic benchmark, to rows, a table and plots."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer
from regionpose.cli.app import run_command
from regionpose.cli.console import Progress, at_terminal
from regionpose.cli.options import Force, Quiet
from regionpose.io.outputs import Writer, refuse_existing, text_writer, write_files

if TYPE_CHECKING:
    from benchmarks.synthetic.studies import Results, Study, StudyConfig

STOPPED = 130
"""Exit code of a command that Ctrl-C ended, as shells have it."""

TOLD_PERCENT = 10
"""Where there is no terminal, progress is a line each time that so much more is done."""


Name = Annotated[
    str,
    typer.Argument(
        help="perspective, omnidirectional, integration, regions, degeneracy, initialization, occlusion, truncation,"
        " lidar, calibration, outlier, trust, mistakes or priors."
    ),
]
Scenes = Annotated[int, typer.Option("--scenes", help="Scenes of each condition.")]
Planes = Annotated[str | None, typer.Option("--planes", help="Numbers of planes, as 1,2,3.")]
Noise = Annotated[str | None, typer.Option("--noise", help="Per cent of a region's area that is wrong, as 0,5,20.")]
Side = Annotated[str | None, typer.Option("--side", help="What is wrong: 2d (the mask), 3d, or 2d,3d.")]
Masks = Annotated[str | None, typer.Option("--masks", help="binary, coverage, or both as binary,coverage.")]
Templates = Annotated[str | None, typer.Option("--templates", help="all, asymmetric or symmetric.")]
System = Annotated[str | None, typer.Option("--system", help="plane, sphere, or plane,sphere.")]
Solver = Annotated[
    list[str] | None,
    typer.Option(
        "--solver", help="Options of estimate_pose, as 'driver=native' or 'refine=null'; repeat it to compare several."
    ),
]
Only = Annotated[
    list[str] | None,
    typer.Option("--only", help="The value of one column that alone is run, as 'model=lidar'; repeat it for others."),
]
Bounds = Annotated[
    bool, typer.Option("--bounds", help="Compare errors with the least that the undisturbed boundary allows.")
]
OwnCamera = Annotated[
    Path | None, typer.Option("--camera", help="Calibration of a camera of your own, in place of the study's.")
]
Depth = Annotated[str, typer.Option("--depth-m", help="Meters before a camera of your own.")]
Lateral = Annotated[str, typer.Option("--lateral-m", help="Meters sideways and up, of a camera of your own.")]
Seed = Annotated[int, typer.Option("--seed", help="Seed of the first scene.")]
Workers = Annotated[int, typer.Option("--workers", "-j", help="Processes.")]
Dask = Annotated[str | None, typer.Option("--dask", help="Address of a dask scheduler, in place of them.")]
Out = Annotated[
    Path | None, typer.Option("--out", "-o", help="File of the rows, .csv or .parquet.  [default: NAME.csv]")
]
Plots = Annotated[bool, typer.Option("--plots/--no-plots", help="Draw the plots (matplotlib).")]


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit code of a study with these `arguments` (those of the process when None)."""
    app = typer.Typer(
        add_completion=False,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.command()(run_study)
    return run_command(app, arguments, "python -m benchmarks")


def run_study(
    name: Name,
    scenes: Scenes = 100,
    planes: Planes = None,
    noise: Noise = None,
    side: Side = None,
    masks: Masks = None,
    templates: Templates = None,
    system: System = None,
    solver: Solver = None,
    only: Only = None,
    bounds: Bounds = False,
    camera: OwnCamera = None,
    depth: Depth = "4,6",
    lateral: Lateral = "0,1",
    seed: Seed = 0,
    workers: Workers = 1,
    dask: Dask = None,
    out: Out = None,
    plots: Plots = True,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Run a study of the synthetic benchmark.

    Prints a table and writes the rows, the table (.md), the settings (.json) and plots (.png) beside one another.
    Ctrl-C stops it; the same command continues where it stopped. The rows do not depend on the number of workers.

    \b
    Examples:
      python -m benchmarks perspective --scenes 40 --workers 4
      python -m benchmarks perspective --planes 3 --noise 5 --seed 17 --scenes 1 --out one.csv
      python -m benchmarks occlusion --solver driver=scipy --solver driver=native
      python -m benchmarks regions --camera calib.yaml --depth-m 3,5 --noise 0,5
    """
    from benchmarks.synthetic.studies import StudyConfig

    lists = {"planes": planes, "noise": noise, "side": side, "masks": masks, "templates": templates}
    config = StudyConfig(
        name=name,
        values={key: _values(key, text) for key, text in lists.items() if text is not None},
        solver=solver or (),
        system=[value.strip() for value in system.split(",")] if system else (),
        only=dict(_pair(text) for text in only or []),
        bounds=bounds,
        camera=camera,
        depth_m=_range("--depth-m", depth),
        lateral_m=_range("--lateral-m", lateral),
        scenes=scenes,
        seed=seed,
        workers=workers,
        dask=dask,
    )
    files = _Files(out or Path(f"{name}.csv"), plots=plots, force=force)
    files.check()
    files.write(config.study, _run(config, files, quiet))


def _values(name: str, text: str) -> list[str | int | float]:
    """The values of an option that takes several."""
    words = [word.strip() for word in text.split(",")]
    if name not in ("planes", "noise"):
        return [*words]
    try:
        return [int(word) for word in words] if name == "planes" else [float(word) / 100.0 for word in words]
    except ValueError as error:
        raise ValueError(f"--{name}: found {text!r}; needed numbers with commas between") from error


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise ValueError(f"--only: found {text!r}; needed NAME=VALUE, as model=lidar")
    return name, value


def _range(option: str, text: str) -> tuple[float, float]:
    try:
        low, high = (float(word) for word in text.split(","))
    except ValueError as error:
        raise ValueError(f"{option}: found {text!r}; needed two numbers of meters, as 4,6") from error
    return low, high


class _Files(NamedTuple):
    """The files of a study: its rows, and the others beside them."""

    rows: Path
    plots: bool
    force: bool

    @property
    def journal(self) -> Path:
        """Where what is done is kept until all is."""
        return self.rows.with_name(f"{self.rows.name}.partial")

    def check(self) -> None:
        """Refuse before the long work what could not be written after it."""
        from benchmarks.synthetic.studies.plots import check_plots
        from benchmarks.synthetic.studies.storage import check_rows_path

        check_rows_path(self.rows)
        refuse_existing([self.rows, *(self.rows.with_suffix(ending) for ending in (".md", ".json"))], self.force)
        if self.plots:
            try:
                check_plots()
            except ImportError as error:
                raise ImportError(f"{error}, or --no-plots") from error

    def write(self, study: Study, results: Results) -> None:
        """Write the files whole, print the table, and take the journal away."""
        from benchmarks.synthetic.studies import results_table

        table = results_table(results, f"{study.name}: {study.description}")
        written = write_files(self.rows.parent, self._writers(study, results, table), force=self.force)
        self.journal.unlink(missing_ok=True)
        typer.echo(table)
        typer.echo(f"written: {', '.join(str(path) for path in written)}")

    def _writers(self, study: Study, results: Results, table: str) -> dict[str, Writer]:
        from benchmarks.synthetic.studies import write_rows

        writers: dict[str, Writer] = {
            self.rows.name: lambda path: write_rows(path, results),
            f"{self.rows.stem}.md": text_writer(table),
            f"{self.rows.stem}.json": text_writer(json.dumps(results.settings, indent=2) + "\n"),
        }
        if self.plots:
            from benchmarks.synthetic.studies.plots import drawn_charts

            for name, figure in drawn_charts(results, study.charts).items():
                writers[f"{self.rows.stem}-{name}.png"] = partial(_save, figure)
        return writers


def _run(config: StudyConfig, files: _Files, quiet: bool) -> Results:
    """The rows; what is done when Ctrl-C comes stays in the journal."""
    with _bar(config.name, quiet) as progress:
        try:
            return config.run(files.journal, progress, force=files.force)
        except KeyboardInterrupt:
            message = f"stopped; what is done is kept in {files.journal}, and the same command goes on there"
            typer.echo(message, err=True)
            raise typer.Exit(STOPPED) from None


@contextmanager
def _bar(name: str, quiet: bool) -> Iterator[Callable[[int, int], None]]:
    """What is told of the progress: a bar with the time left at a terminal, a line now and then elsewhere."""
    if not quiet and not at_terminal():
        yield _Lines(name).tell
        return
    with Progress(quiet) as bar:
        bar.begin(name)
        yield bar.count


class _Lines:
    """Progress as lines on standard error."""

    def __init__(self, name: str) -> None:
        self._name, self._told = name, 0

    def tell(self, done: int, total: int) -> None:
        """Say how much is done when it is enough more than the last time."""
        percent = 100 * done // total
        if percent >= self._told + TOLD_PERCENT or done == total:
            self._told = percent
            typer.echo(f"{self._name}: {done} of {total} ({percent} %)", err=True)


def _save(figure: object, path: Path) -> None:
    figure.savefig(path)  # type: ignore[attr-defined]
