"""What is run of a study, as data: the one object behind the command and scripts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from regionpose.io.calibrations import load_camera

from benchmarks.synthetic.masks import image_size
from benchmarks.synthetic.setups import PoseRange, Setup
from benchmarks.synthetic.studies.catalog import study_named
from benchmarks.synthetic.studies.conditions import Grid
from benchmarks.synthetic.studies.dispatch import dask_executor
from benchmarks.synthetic.studies.rows import Results
from benchmarks.synthetic.studies.runner import Progress, run_study
from benchmarks.synthetic.studies.storage import OtherSettingsError
from benchmarks.synthetic.studies.study import Study

if TYPE_CHECKING:
    from concurrent.futures import Executor


@dataclass(frozen=True, kw_only=True)
class StudyConfig:
    """A study of the catalog, what is changed of it, and how it is run.

    `values`: other values of the condition's fields. `solver`: options of estimate_pose, each as text, that are
    compared; `system`: systems of equations, each with all of them. `only`: the values, as text, of the fields that
    alone are run. `bounds`: whether rows hold the bound of their errors. `camera`: a calibration in place of the
    study's; `depth_m` and `lateral_m` are the least and the most before it and beside its axis. `scenes` of each
    condition are run, with seeds from `seed` on, on so many processes (`workers`) or those of a scheduler (`dask`, its
    address).
    """

    name: str
    values: Grid = field(default_factory=dict)
    solver: Sequence[str] = ()
    system: Sequence[str] = ()
    only: Mapping[str, str] = field(default_factory=dict)
    bounds: bool = False
    camera: Path | None = None
    depth_m: tuple[float, float] = (4.0, 6.0)
    lateral_m: tuple[float, float] = (0.0, 1.0)
    scenes: int = 100
    seed: int = 0
    workers: int = 1
    dask: str | None = None

    @property
    def study(self) -> Study:
        """The study with its changes; ValueError for names and values that there are not."""
        study = replace(study_named(self.name).with_values(self.values, self.solver), bounds=self.bounds)
        if self.system:
            study = study.with_values({}, [f"system={name}" for name in self.system])
        if self.only:
            study = study.only(self.only)
        if self.camera is None:
            return study
        camera = load_camera(self.camera)
        image_size(camera)
        poses = PoseRange(lateral=self.lateral_m, depth=self.depth_m)
        return study.with_setup(self.camera.stem, Setup(camera, poses))

    def run(self, journal: Path, progress: Progress | None = None, *, force: bool = False) -> Results:
        """The rows; what is done stays in the journal, which `force` replaces where other settings made it."""
        with self._executor() as executor:
            run = partial(run_study, self.study, self.scenes, seed=self.seed, workers=self.workers, journal=journal)
            try:
                return run(executor=executor, progress=progress)
            except OtherSettingsError:
                if not force:
                    raise
                journal.unlink()
                return run(executor=executor, progress=progress)

    @contextmanager
    def _executor(self) -> Iterator[Executor | None]:
        if self.dask is None:
            yield None
            return
        with dask_executor(self.dask) as executor:
            yield executor
