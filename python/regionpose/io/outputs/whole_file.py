"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def whole_file(path: Path, *, overwrite: bool) -> Iterator[BinaryIO]:
    """A binary file to write that becomes `path` when the block ends, and is removed when it raises.

    It is written beside `path` and renamed, with the mode of a file that it replaces. FileExistsError where `path`
    exists, unless `overwrite`.
    """
    _refuse_existing(path, overwrite)
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with part.open("xb") as file:
            keep_mode(part, path)
            yield file
            file.flush()
            os.fsync(file.fileno())
        _refuse_existing(path, overwrite)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _refuse_existing(path: Path, overwrite: bool) -> None:
    """FileExistsError where something is at `path` that may not be replaced."""
    if path.exists() and not overwrite:
        raise FileExistsError(f"{path} exists; needed a new path, or overwrite=True")


def keep_mode(made: Path, replaced: Path) -> None:
    """Give a file the mode of the one that it is to replace, if there is one."""
    try:
        before = replaced.lstat()
    except FileNotFoundError:
        return
    if stat.S_ISREG(before.st_mode):
        made.chmod(stat.S_IMODE(before.st_mode))
