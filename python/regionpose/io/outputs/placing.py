"""Files put in place together: an error or an interrupt in between puts back what was there, and so does the next run
after a kill.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from regionpose.io.outputs.signals import deferred_signals
from regionpose.io.outputs.whole_file import keep_mode

NEW, OLD, JOURNAL = "new", "old", "placing"
"""In a run's hidden folder: its files, those that they replace, and the journal of both while they change places."""

Writer = Callable[[Path], object]
"""Writes one file to the path it is given."""


class _Entry(NamedTuple):
    """A file that is put in place: its size and when it was written, which moves don't change, and whether it replaces
    another one.
    """

    size: int
    written_ns: int
    replaces: bool


def write_new(folder: Path, hidden: Path, writers: Mapping[str, Writer]) -> None:
    """Write files into a hidden folder; errors name the places in `folder` that they are meant for."""
    (hidden / NEW).mkdir(mode=0o700, exist_ok=True)
    for name, write in writers.items():
        made = hidden / NEW / name
        with _renamed_errors(folder / name, hidden):
            write(made)
            _flush(made)
            keep_mode(made, folder / name)


def place(folder: Path, hidden: Path, names: list[str]) -> None:
    """Move files that `write_new` wrote to `folder`: all of them, or none and an error."""
    if len(names) == 1:
        # One move is whole by itself.
        with _renamed_errors(folder / names[0], hidden):
            os.replace(hidden / NEW / names[0], folder / names[0])
        return
    with deferred_signals() as deliver:
        try:
            _begin(folder, hidden, names)
            for name in names:
                with _renamed_errors(folder / name, hidden):
                    _exchange(folder / name, hidden / OLD / name, hidden / NEW / name)
            deliver()
            _flush_folder(folder)
            (hidden / JOURNAL).unlink()
        except BaseException:
            put_back(folder, hidden)
            raise


def put_back(folder: Path, hidden: Path) -> None:
    """Undo moves that have not come to their end, by the journal of them; what others wrote since then stays.

    ValueError for a journal that is none: nothing is moved then.
    """
    if not is_unfinished(hidden):
        return
    for name, entry in _entries(hidden / JOURNAL).items():
        at, old = folder / name, hidden / OLD / name
        # A file has moved if it isn't where it was made; elsewhere others may have written since.
        has_moved = not os.path.lexists(hidden / NEW / name) and _is(at, entry)
        if os.path.lexists(old):
            if has_moved or not os.path.lexists(at):
                os.replace(old, at)
        elif has_moved and not entry.replaces:
            at.unlink()
    _flush_folder(folder)
    (hidden / JOURNAL).unlink()


def is_unfinished(hidden: Path) -> bool:
    """Whether files of a hidden folder have begun to change places and not come to their end."""
    return os.path.lexists(hidden / JOURNAL)


def _entries(journal: Path) -> dict[str, _Entry]:
    try:
        return {name: _Entry(*values) for name, values in json.loads(journal.read_text(encoding="utf-8")).items()}
    except (ValueError, TypeError, AttributeError) as error:
        needed = f"needed that of a run that was killed while it put files in place: what they replaced is in {OLD}"
        raise ValueError(f"{journal}: found no journal ({error}); {needed} beside it") from error


def _begin(folder: Path, hidden: Path, names: list[str]) -> None:
    """Write the journal, whole, before anything moves."""
    (hidden / OLD).mkdir(mode=0o700, exist_ok=True)
    entries = {}
    for name in names:
        new = (hidden / NEW / name).lstat()
        entries[name] = _Entry(new.st_size, new.st_mtime_ns, os.path.lexists(folder / name))
    part = hidden / f"{JOURNAL}.part"
    part.write_text(json.dumps(entries), encoding="utf-8")
    _flush(part)
    os.replace(part, hidden / JOURNAL)
    _flush_folder(hidden)


def _is(path: Path, entry: _Entry) -> bool:
    """Whether the file at a path is the one of an entry."""
    if not os.path.lexists(path):
        return False
    found = path.lstat()
    return (found.st_size, found.st_mtime_ns) == (entry.size, entry.written_ns)


def _exchange(at: Path, old: Path, new: Path) -> None:
    """Keep what is at a path, if anything, as `old`, and put `new` there.

    A second link keeps it in its place until the new one has it; file systems without links do without it in between.
    """
    if os.path.lexists(at):
        try:
            os.link(at, old, follow_symlinks=False)
        except (OSError, NotImplementedError):
            os.rename(at, old)
    os.replace(new, at)


@contextmanager
def _renamed_errors(place: Path, hidden: Path) -> Iterator[None]:
    """Errors of the system about files in a hidden folder name the place that these are meant for."""
    try:
        yield
    except OSError as error:
        if hidden not in Path(str(error.filename or "")).parents:
            raise
        raise OSError(error.errno, error.strerror, str(place)) from error


def _flush(path: Path) -> None:
    """Have the disk hold a file before it takes another one's place."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _flush_folder(folder: Path) -> None:
    """Have the disk hold which files are in a folder, where the system supports it."""
    try:
        file = os.open(folder, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(file)
    except OSError:
        pass
    finally:
        os.close(file)
