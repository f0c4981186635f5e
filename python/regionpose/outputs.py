"""Files that commands write: whole or not at all, and never over others without `--force`."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]

HIDDEN, CLAIMED = ".regionpose-", ".claimed"
"""How the folders begin in which files are made, and the file in them that lists the names."""

Writer = Callable[[Path], object]
"""Writes one file to the path it is given."""


def refuse_existing(paths: list[Path], force: bool) -> None:
    """FileExistsError that names the first path that is there, unless `force`; meant for before the long work."""
    for path in paths:
        if path.is_dir():
            raise FileExistsError(f"{path}: found a directory; needed the path of a file")
        if os.path.lexists(path) and not force:
            raise FileExistsError(f"{path}: the file exists; needed another path, or --force to replace it")
        _refuse_blocked(path)


def _refuse_blocked(path: Path) -> None:
    """FileExistsError where a file stands in the place of a parent folder."""
    for parent in path.parents:
        if parent.exists():
            if not parent.is_dir():
                raise FileExistsError(f"{parent}: found a file; needed a folder to write {path.name} to")
            return


@dataclass(frozen=True)
class Claim:
    """The right to write files of some names to a folder, and the hidden folder in it where they are made."""

    folder: Path
    made: Path
    force: bool

    def write(self, writers: Mapping[str, Writer]) -> list[Path]:
        """The paths of the files written.

        All are written beside their place first and renamed when the last one is whole; an error leaves nothing behind.
        """
        paths = [self.folder / name for name in writers]
        for name, write in writers.items():
            write(self.made / name)
        refuse_existing(paths, self.force)
        for path in paths:
            os.replace(self.made / path.name, path)
        return paths


@contextmanager
def claimed(folder: Path, names: Sequence[str], *, force: bool) -> Iterator[Claim]:
    """The claim of files `names` in a folder, which is made where it is missing; nothing is left where the block fails.

    What a dead run left there is removed. FileExistsError where a file is there, unless `force`, and where another run
    is about to write one of them.
    """
    refuse_existing([folder / name for name in names], force)
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with ExitStack() as held:
            with _locked(folder, wait=True):
                _clear(folder, names)
                made = Path(tempfile.mkdtemp(prefix=HIDDEN, dir=folder))
                held.callback(shutil.rmtree, made, ignore_errors=True)
                held.enter_context(_locked(made, wait=False))
                (made / CLAIMED).write_text(json.dumps(list(names)), encoding="utf-8")
            yield Claim(folder, made, force)
    except BaseException:
        _remove_empty(missing)
        raise


def _clear(folder: Path, names: Sequence[str]) -> None:
    """Remove what dead runs left in a folder; FileExistsError where one that goes on claims one of the names."""
    for other in folder.glob(f"{HIDDEN}*"):
        try:
            with _locked(other, wait=False):
                shutil.rmtree(other, ignore_errors=True)
        except BlockingIOError:
            taken = set(names) & set(json.loads((other / CLAIMED).read_text(encoding="utf-8")))
            if taken:
                found = f"{folder / min(taken)}: found another run that is about to write it"
                raise FileExistsError(f"{found}; needed another path, or its end") from None


@contextmanager
def _locked(folder: Path, *, wait: bool) -> Iterator[None]:
    """A folder that no other process has locked; the lock goes with the process, however it ends.

    BlockingIOError where it is another's, unless `wait`. Where the system knows no such locks, none is held.
    """
    if fcntl is None or folder.is_symlink() or not folder.is_dir():
        yield
        return
    place = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(place, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        yield
    finally:
        os.close(place)


def write_files(folder: Path, writers: Mapping[str, Writer], *, force: bool) -> list[Path]:
    """The paths of the files written to `folder`, all or none; errors as of `claimed`."""
    with claimed(folder, list(writers), force=force) as claim:
        return claim.write(writers)


def _remove_empty(folders: list[Path]) -> None:
    """Remove the folders, innermost first, that nothing was put into."""
    for folder in folders:
        try:
            folder.rmdir()
        except OSError:
            return


def write_file(path: Path, write: Writer, *, force: bool) -> Path:
    """The path of one file written whole."""
    return write_files(path.parent, {path.name: write}, force=force)[0]


def text_writer(text: str) -> Writer:
    """A writer of a text in UTF-8."""
    return lambda path: path.write_text(text, encoding="utf-8")
