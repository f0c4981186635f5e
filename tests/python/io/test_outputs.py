"""Files of a run: all in place or none, whatever comes in between; and runs that share a folder."""

from __future__ import annotations

import errno
import itertools
import json
import os
import signal
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from textwrap import dedent
from types import FrameType
from typing import Any

import numpy as np
import pytest
from regionpose.io.clouds import Cloud, write_ply
from regionpose.io.outputs import claimed, locks, placing, text_writer, write_file, write_files
from regionpose.io.outputs.hidden import CLAIM, HIDDEN

NAMES = ["a", "b", "c", "d"]
NEW = {name: text_writer(f"new {name}") for name in NAMES}

END_S = 60.0
"""Imports on a busy machine."""

forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that fork")


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder with older files: all but one of the names, one of them a link, and one more."""
    folder = tmp_path / "out"
    folder.mkdir()
    for name in ("a", "b", "mine"):
        (folder / name).write_text(f"old {name}", encoding="utf-8")
    (folder / "a").chmod(0o600)
    (folder / "c").symlink_to("mine")
    return folder


def contents(folder: Path) -> dict[str, str]:
    """What the files hold, and where links lead."""
    return {
        path.name: os.readlink(path) if path.is_symlink() else path.read_text(encoding="utf-8")
        for path in folder.iterdir()
        if path.is_file()
    }


def hidden(folder: Path) -> list[Path]:
    """The hidden folders of runs."""
    return list(folder.glob(f"{HIDDEN}*"))


class At:
    """Does something at so manyth a move into a folder, after it or in its place."""

    def __init__(self, folder: Path, count: int, act: Callable[[Path], object], *, instead: bool) -> None:
        self._folder, self._left, self._act, self._instead, self._move = folder, count, act, instead, os.replace

    def __call__(self, source: Path, target: Path) -> None:
        self._left -= Path(target).parent == self._folder
        acts = self._left == 0 and Path(target).parent == self._folder
        if not (acts and self._instead):
            self._move(source, target)
        if acts:
            self._act(source)


def refuse(source: Path) -> None:
    """What the system says of a file that another user has, or that is open on Windows."""
    raise PermissionError(errno.EPERM, "Operation not permitted", str(source))


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_move_that_fails_puts_back_what_was_there(count: int, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = contents(out)
    monkeypatch.setattr(os, "replace", At(out, count, refuse, instead=True))
    with pytest.raises(PermissionError) as told:
        write_files(out, NEW, force=True)
    assert told.value.filename == str(out / NAMES[count - 1])
    assert contents(out) == before and not hidden(out)
    assert stat.S_IMODE((out / "a").stat().st_mode) == 0o600


@pytest.mark.parametrize("count", [1, 2, 3, 4])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_between_moves_puts_back_what_was_there(
    number: signal.Signals, count: int, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Ended(BaseException):
        pass

    def end(*_: object) -> None:
        raise Ended

    before, handler = contents(out), signal.signal(number, end)
    monkeypatch.setattr(os, "replace", At(out, count, lambda _: signal.raise_signal(number), instead=False))
    try:
        with pytest.raises(Ended):
            write_files(out, NEW, force=True)
        assert signal.getsignal(number) is end
    finally:
        signal.signal(number, handler)
    assert contents(out) == before and not hidden(out)


def test_a_signal_at_any_line_leaves_all_old_files_or_all_new_ones_and_nothing_else(tmp_path: Path) -> None:
    class Ended(BaseException):
        pass

    def end(*_: object) -> None:
        raise Ended

    package = str(Path(placing.__file__).parent)
    handler, tracer, states = signal.signal(signal.SIGTERM, end), sys.gettrace(), []
    try:
        for line in itertools.count(1):
            left, folder = line, tmp_path / str(line)
            folder.mkdir()
            (folder / "a").write_text("old a", encoding="utf-8")

            def trace(frame: FrameType, event: str, _: object) -> Any:
                nonlocal left
                if not frame.f_code.co_filename.startswith(package):
                    return None
                left -= event == "line"
                if event == "line" and left == 0:
                    signal.raise_signal(signal.SIGTERM)
                return trace

            sys.settrace(trace)
            with suppress(Ended):
                write_files(folder, NEW, force=True)
            sys.settrace(tracer)
            assert not hidden(folder), line
            states.append(contents(folder))
            if left > 0:
                break
    finally:
        sys.settrace(tracer)
        signal.signal(signal.SIGTERM, handler)
    old, new = {"a": "old a"}, {name: f"new {name}" for name in NAMES}
    assert states[0] == old and states[-1] == new and len(states) > 100
    assert all(state in (old, new) for state in states)


def test_a_signal_whose_handler_raises_nothing_changes_nothing(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    monkeypatch.setattr(os, "replace", At(out, 2, lambda _: signal.raise_signal(signal.SIGINT), instead=False))
    try:
        write_files(out, NEW, force=True)
    finally:
        signal.signal(signal.SIGINT, handler)
    assert came == [signal.SIGINT]
    assert contents(out) == {"mine": "old mine"} | {name: f"new {name}" for name in NAMES}


@contextmanager
def killed_between(out: Path, count: int) -> Iterator[None]:
    """A run was killed after so many of its moves into a folder."""
    process = os.fork()
    if not process:
        os.replace = At(out, count, lambda _: os.kill(os.getpid(), signal.SIGKILL), instead=False)  # type: ignore[assignment]
        write_files(out, NEW, force=True)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == -signal.SIGKILL
    yield


@forks
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_the_next_run_puts_back_what_a_killed_one_replaced(count: int, out: Path) -> None:
    before = contents(out)
    with killed_between(out, count):
        assert contents(out) != before and len(hidden(out)) == 1
    write_files(out, {"next": text_writer("next")}, force=False)
    assert contents(out) == before | {"next": "next"} and not hidden(out)
    assert stat.S_IMODE((out / "a").stat().st_mode) == 0o600


@forks
def test_without_links_files_are_moved_and_put_back(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def link(*_: object, **__: object) -> None:
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", link)
    before = contents(out)
    with killed_between(out, 2):
        assert contents(out) != before
    write_files(out, {"next": text_writer("next")}, force=False)
    assert contents(out) == before | {"next": "next"}
    write_files(out, NEW, force=True)
    assert contents(out)["a"] == "new a" and not hidden(out)


@forks
def test_what_was_written_since_a_kill_stays(out: Path) -> None:
    with killed_between(out, 4):
        (out / "b").write_text("mine now", encoding="utf-8")
        (out / "d").write_text("mine, too", encoding="utf-8")
    write_files(out, {"next": text_writer("next")}, force=False)
    found = contents(out)
    assert (found["a"], found["b"], found["c"], found["d"]) == ("old a", "mine now", "mine", "mine, too")


@forks
def test_files_that_a_killed_run_left_are_not_in_the_way(tmp_path: Path) -> None:
    out = tmp_path / "empty"
    out.mkdir()
    with killed_between(out, 3):
        assert len(contents(out)) == 3
    assert len(write_files(out, NEW, force=False)) == 4


def test_a_journal_that_is_none_is_an_error_that_names_it(out: Path) -> None:
    left = out / f"{HIDDEN}left"
    left.mkdir()
    (left / CLAIM).write_text("{}", encoding="utf-8")
    (left / placing.JOURNAL).write_text("[1]", encoding="utf-8")
    with pytest.raises(ValueError, match=f"{left.name}/placing: found no journal"):
        write_files(out, NEW, force=True)
    assert contents(out)["a"] == "old a" and hidden(out) == [left]


@pytest.mark.skipif(os.name == "nt", reason="needs modes of files")
def test_modes_of_replaced_files_are_kept(out: Path, tmp_path: Path) -> None:
    modes = {"a": 0o600, "b": 0o444, "mine": 0o640}
    for name, mode in modes.items():
        (out / name).chmod(mode)
    write_files(out, NEW, force=True)
    write_file(out / "mine", text_writer("new mine"), force=True)
    assert {name: stat.S_IMODE((out / name).stat().st_mode) for name in modes} == modes
    cloud, umask = tmp_path / "cloud.ply", os.umask(0o022)
    os.umask(umask)
    write_ply(cloud, Cloud(np.zeros((1, 3))))
    assert stat.S_IMODE(cloud.stat().st_mode) == 0o666 & ~umask
    cloud.chmod(0o600)
    write_ply(cloud, Cloud(np.ones((1, 3))), overwrite=True)
    assert stat.S_IMODE(cloud.stat().st_mode) == 0o600


def test_files_that_are_being_made_are_private(out: Path) -> None:
    modes: list[int] = []

    def look(path: Path) -> None:
        path.write_text("new", encoding="utf-8")
        modes.append(stat.S_IMODE(path.parent.stat().st_mode))

    write_files(out, {"a": look}, force=True)
    assert modes == [0o700] or os.name == "nt"


def test_errors_of_writers_name_the_file_and_not_the_hidden_one(out: Path) -> None:
    def fails(path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))

    with pytest.raises(OSError) as told:
        write_files(out, {"a": fails}, force=True)
    assert (told.value.errno, told.value.filename) == (errno.ENOSPC, str(out / "a"))


# Runs that share a folder.

RUN = """
    import os, sys
    from pathlib import Path
    from regionpose.io.outputs import claimed, locks, text_writer

    if {no_locks}:
        locks.locked = lambda file: None
        import regionpose.io.outputs.hidden as hidden
        hidden.locked = locks.locked
    with claimed(Path({out!r}), {names!r}, force=True) as claim:
        print("claimed", flush=True)
        sys.stdin.read()
        claim.write({{name: text_writer("first") for name in {names!r}}})
"""


@contextmanager
def first_run(out: Path, names: list[str], *, no_locks: bool) -> Iterator[subprocess.Popen[str]]:
    """A run that has claimed names in a folder and goes on until its input ends."""
    code = dedent(RUN).format(no_locks=no_locks, out=str(out), names=names)
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", code], text=True, **pipes) as process:
        assert process.stdout is not None and process.stdout.readline() == "claimed\n"
        try:
            yield process
        finally:
            process.kill()


@pytest.fixture(params=[False, True], ids=["locks", "no locks"])
def no_locks(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether the file system knows no locks, as some on networks."""
    if request.param:
        monkeypatch.setattr("regionpose.io.outputs.hidden.locked", lambda _: None)
    return bool(request.param)


def test_a_second_run_is_refused_and_leaves_the_first_one_alone(no_locks: bool, out: Path) -> None:
    with first_run(out, ["a", "b"], no_locks=no_locks) as first:
        with pytest.raises(FileExistsError, match=rf"b: found another run .* \(process {first.pid} on "):
            write_files(out, {"b": text_writer("second")}, force=True)
        write_files(out, {"e": text_writer("second")}, force=True)
        first.communicate(timeout=END_S)
        assert first.returncode == 0
    assert (contents(out)["a"], contents(out)["e"]) == ("first", "second") and not hidden(out)


@pytest.mark.skipif(os.name == "nt", reason="Windows has locks wherever files are")
def test_what_a_killed_run_left_is_removed(no_locks: bool, out: Path) -> None:
    with first_run(out, ["a", "b"], no_locks=no_locks) as first:
        first.kill()
        first.wait(timeout=END_S)
    assert len(hidden(out)) == 1
    write_files(out, {"b": text_writer("second")}, force=True)
    assert contents(out)["b"] == "second" and not hidden(out)


def test_a_run_on_another_machine_goes_on_as_far_as_is_known(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("regionpose.io.outputs.hidden.locked", lambda _: None)
    left = out / f"{HIDDEN}left"
    left.mkdir()
    said = locks.this_process() | {"machine": "another", "process": 2**22 + 1, "names": ["a"]}
    (left / CLAIM).write_text(json.dumps(said), encoding="utf-8")
    with pytest.raises(FileExistsError, match=r"on another, in \.regionpose-left"):
        write_files(out, {"a": text_writer("new")}, force=True)


def test_what_ended_is_told_from_what_goes_on() -> None:
    own = locks.this_process()
    ended = own | {"process": 2**22 + 1}  # Beyond Linux' largest number.
    cases = {False: [own, {}, ended | {"machine": "another"}], True: []}
    if os.name != "nt":
        cases[True] += [ended, own | {"boot": "before"}]
        cases[False].append(ended | {"namespace": "another"})
    for expected, processes in cases.items():
        assert [locks.has_ended(process) for process in processes] == [expected] * len(processes)


@pytest.mark.skipif(os.name == "nt", reason="needs flock")
@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.EBADF])
def test_file_systems_without_locks_are_written_to(number: int, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def flock(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", flock)
    assert len(write_files(out, NEW, force=True)) == 4 and not hidden(out)


def test_systems_without_fcntl_are_written_to(out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(locks, "fcntl", None)
    assert len(write_files(out, NEW, force=True)) == 4 and not hidden(out)


@pytest.fixture
def quick_switches() -> Iterator[None]:
    """Threads that take turns often, so that one looks at what another removes."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


@pytest.mark.slow
@pytest.mark.parametrize(("pause_s", "rounds"), [(0.3, 1), (0.0, 30)])
def test_of_runs_that_begin_at_once_none_loses_its_files(
    pause_s: float, rounds: int, out: Path, quick_switches: None
) -> None:
    ends: list[str] = []

    def run(number: int) -> None:
        try:
            with claimed(out, NAMES, force=True) as claim:
                time.sleep(pause_s)
                claim.write({name: text_writer(f"{number} {name}") for name in NAMES})
            ends.append("written")
        except FileExistsError:
            ends.append("refused")

    for done in range(1, rounds + 1):
        threads = [threading.Thread(target=run, args=(number,)) for number in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(ends) == 6 * done and not hidden(out)
        found = contents(out)
        assert len({found[name].split()[0] for name in NAMES}) == 1


def as_nobody(act: Callable[[], None]) -> int:
    """The exit code of another user's process that does something; 0 where it raises nothing."""
    process = os.fork()
    if not process:
        code = 1
        try:
            os.setgid(65534)
            os.setuid(65534)
            act()
            code = 0
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


@forks
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs to be root to be another user")
@pytest.mark.parametrize("mode", [0o700, 0o755])
def test_another_user_s_dead_run_is_in_nobody_s_way(mode: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    # Not below pytest's own folders, which nobody else may enter.
    import tempfile

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        folder.chmod(0o1777)
        left = folder / f"{HIDDEN}left"
        left.mkdir()
        left.chmod(mode)
        (left / CLAIM).write_text(json.dumps({"names": ["a"], "process": 1}), encoding="utf-8")

        def write() -> None:
            write_files(folder, {"a": text_writer("theirs")}, force=False)

        assert as_nobody(write) == 0
        assert (folder / "a").read_text(encoding="utf-8") == "theirs" and hidden(folder) == [left]


@forks
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs to be root to be another user")
def test_what_another_user_says_was_there_is_not_put_back() -> None:
    import tempfile

    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        folder.chmod(0o1777)

        def bait() -> None:
            left = folder / f"{HIDDEN}left"
            (left / placing.OLD).mkdir(parents=True)
            (left / CLAIM).write_text("{}", encoding="utf-8")
            (left / placing.OLD / "a").write_text("theirs", encoding="utf-8")
            (left / placing.JOURNAL).write_text(json.dumps({"a": [0, 0, True]}), encoding="utf-8")

        assert as_nobody(bait) == 0
        write_files(folder, {"b": text_writer("mine")}, force=False)
        assert contents(folder) == {"b": "mine"}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("kind", ["pipe", "link", "text", "folder"])
def test_a_claim_that_is_none_is_in_nobody_s_way(kind: str, out: Path, tmp_path: Path) -> None:
    left = out / f"{HIDDEN}left"
    left.mkdir()
    mine = tmp_path / "mine"
    mine.write_text("mine", encoding="utf-8")
    if kind == "pipe":
        os.mkfifo(left / CLAIM)
    elif kind == "link":
        (left / CLAIM).symlink_to(mine)
    elif kind == "text":
        (left / CLAIM).write_text("[" * 100_000, encoding="utf-8")
    else:
        (left / CLAIM).mkdir()
    write_files(out, NEW, force=True)
    assert contents(out)["a"] == "new a" and mine.read_text(encoding="utf-8") == "mine"


def test_what_is_left_of_a_removal_is_removed(out: Path) -> None:
    for name in ("empty", "half"):
        (out / f"{HIDDEN}{name}").mkdir()
    (out / f"{HIDDEN}half" / "new").mkdir()
    write_files(out, NEW, force=True)
    assert not hidden(out)
