"""Claims of files: the right to write them, refused where they are there or another run is about to write them."""

from __future__ import annotations

import os
import random
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from regionpose.io.outputs.hidden import HiddenFolder
from regionpose.io.outputs.placing import Writer, place, write_new
from regionpose.io.outputs.signals import deferred_signals

PAUSES_S = (0.01, 0.03, 0.1)
"""Longest waits before another look at runs that claim the same names: two that begin at once both step back, and take
other times to come again. A convention."""


def refuse_existing(paths: list[Path], force: bool) -> None:
    """FileExistsError that names the first path that is there, unless `force`; meant for before the long work."""
    for path in paths:
        if path.is_dir():
            raise FileExistsError(f"{path}: found a directory; needed the path of a file")
        if os.path.lexists(path) and not force:
            raise FileExistsError(f"{path}: the file exists; needed another path, or force to replace it")
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
    hidden: Path
    force: bool

    def write(self, writers: Mapping[str, Writer]) -> list[Path]:
        """The paths of the files written.

        All are written to the hidden folder first and put in place together when the last one is whole; an error or an
        interrupt leaves what was there.
        """
        paths = [self.folder / name for name in writers]
        write_new(self.folder, self.hidden, writers)
        refuse_existing(paths, self.force)
        place(self.folder, self.hidden, list(writers))
        return paths


@contextmanager
def claimed(folder: Path, names: Sequence[str], *, force: bool) -> Iterator[Claim]:
    """The claim of files `names` in a folder, which is made where it is missing; nothing is left where the block fails.

    What a dead run of the same user left there is put back and removed. FileExistsError where a file is there, unless
    `force`, and where another run is about to write one of them.
    """
    places = [folder / name for name in names]
    refuse_existing(places, force=True)
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    hidden = None
    try:
        with deferred_signals():
            folder.mkdir(parents=True, exist_ok=True)
            hidden = _hidden(folder, names)
        refuse_existing(places, force)
        yield Claim(folder, hidden.path, force)
        # A signal just before this is handled as one in the block.
        with deferred_signals():
            hidden.remove()
            hidden = None
    except BaseException:
        with deferred_signals():
            if hidden is not None:
                hidden.remove()
            _remove_empty(missing)
        raise


def _hidden(folder: Path, names: Sequence[str]) -> HiddenFolder:
    """A hidden folder for these names, none of which another run claims.

    Each run writes its claims before it reads those of other runs, so that of two at least one sees the other.
    """
    for longest in (*PAUSES_S, None):
        hidden = HiddenFolder.create(folder, names)
        try:
            taken = [(name, other) for other in hidden.other_runs() for name in other.names if name in names]
            if not taken:
                return hidden
        except BaseException:
            hidden.remove()
            raise
        hidden.remove()
        if longest is not None:
            time.sleep(random.uniform(0.0, longest))
    name, other = taken[0]
    found = f"{folder / name}: found another run that is about to write it ({other.where})"
    raise FileExistsError(f"{found}; needed another path, or its end")


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
