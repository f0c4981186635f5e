"""Files that commands write: whole or not at all, and never over others without `--force`."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

Writer = Callable[[Path], object]
"""Writes one file to the path it is given."""


def refuse_existing(paths: list[Path], force: bool) -> None:
    """FileExistsError that names the first path that is there, unless `force`; meant for before the long work."""
    for path in paths:
        if path.is_dir():
            raise FileExistsError(f"{path}: found a directory; needed the path of a file")
        if path.exists() and not force:
            raise FileExistsError(f"{path}: the file exists; needed another path, or --force to replace it")
        _refuse_blocked(path)


def _refuse_blocked(path: Path) -> None:
    """FileExistsError where a file stands in the place of a parent folder."""
    for parent in path.parents:
        if parent.exists():
            if not parent.is_dir():
                raise FileExistsError(f"{parent}: found a file; needed a folder to write {path.name} to")
            return


def write_files(folder: Path, writers: Mapping[str, Writer], *, force: bool) -> list[Path]:
    """The paths of the files written to `folder`, which is made where it is missing.

    All are written beside their place first and renamed when the last one is whole; an error leaves nothing behind.
    """
    paths = [folder / name for name in writers]
    refuse_existing(paths, force)
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(prefix=".regionpose-", dir=folder))
    try:
        for name, write in writers.items():
            write(made / name)
        refuse_existing(paths, force)
        for path in paths:
            os.replace(made / path.name, path)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        _remove_empty(missing)
        raise
    made.rmdir()
    return paths


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
