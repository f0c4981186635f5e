"""Hidden folders in which runs make their files. A file in each lists the names that its run claims, locked while that
goes on.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from regionpose.io.outputs.locks import has_ended, locked, this_process
from regionpose.io.outputs.placing import is_unfinished, put_back

HIDDEN, CLAIM = ".regionpose-", "claim"
"""How the folders begin, and the file in them."""

LONGEST_CLAIM = 1 << 20
"""Bytes of a claim that are looked at: any user can write one to a folder that all share."""

PLAINLY = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
"""To open a file and nothing else: no link, and no pipe to wait at."""


class OtherRun(NamedTuple):
    """Another run that goes on: the names it claims, and the process and machine where these are given."""

    names: list[str]
    where: str


class HiddenFolder(NamedTuple):
    """A run's own hidden folder, and its open claim."""

    folder: Path
    path: Path
    claim: int

    @classmethod
    def create(cls, folder: Path, names: Sequence[str]) -> HiddenFolder:
        """A new one in a folder, with a claim of these names."""
        while True:
            path = folder / f"{HIDDEN}{secrets.token_hex(6)}"
            path.mkdir()
            try:
                claim = os.open(path / CLAIM, os.O_RDWR | os.O_CREAT | os.O_EXCL | PLAINLY, 0o644)
            except FileNotFoundError:
                continue  # Before it had a claim, another run took it for one that was left behind: so below.
            hidden = cls(folder, path, claim)
            try:
                if locked(claim) is not False and _is_at(claim, path / CLAIM):
                    os.lseek(claim, 0, os.SEEK_SET)
                    os.write(claim, json.dumps({"names": list(names), **this_process()}).encode())
                    return hidden
            except BaseException:
                hidden.remove()
                raise
            hidden.remove()

    def other_runs(self) -> list[OtherRun]:
        """The other runs that go on in the folder; what ended ones of this user left there is put back and removed."""
        runs = [_inspected(self.folder, path) for path in self.folder.glob(f"{HIDDEN}*") if path != self.path]
        return [other for other in runs if other is not None]

    def remove(self) -> None:
        """Remove it and all that is in it, but for files that could not be put back."""
        unfinished = is_unfinished(self.path)
        if not unfinished:
            # While it is locked, so that no other run removes it at the same time.
            shutil.rmtree(self.path, ignore_errors=True)
        os.close(self.claim)
        if not unfinished:
            shutil.rmtree(self.path, ignore_errors=True)  # On Windows, which removes no open file.


def _inspected(folder: Path, path: Path) -> OtherRun | None:
    """The run of a hidden folder if it goes on; what it left is put back and removed if it is this user's."""
    if path.is_symlink() or not path.is_dir():
        return None
    try:
        claim = _opened(path / CLAIM)
    except FileNotFoundError:
        _remove_remains(path)
        return None
    except OSError:
        return None  # Another user's, without permission to read it.
    try:
        is_locked, claim_values = locked(claim), _read(claim)
        if is_locked is False or (is_locked is None and not has_ended(claim_values)):
            return _other_run(claim_values, path)
        if not (_is_at(claim, path / CLAIM) and _is_own(path)):
            return None
        put_back(folder, path)
        shutil.rmtree(path, ignore_errors=True)
    finally:
        os.close(claim)
    shutil.rmtree(path, ignore_errors=True)  # On Windows, which removes no open file.
    return None


def _other_run(claim_values: dict[str, object], path: Path) -> OtherRun:
    names = claim_values.get("names")
    where = f"process {claim_values.get('process')} on {claim_values.get('machine')}, in {path.name}"
    return OtherRun([name for name in names if isinstance(name, str)] if isinstance(names, list) else [], where)


def _opened(claim: Path) -> int:
    """A claim, to write if that is allowed: locks of some file systems need it."""
    try:
        return os.open(claim, os.O_RDWR | PLAINLY)
    except PermissionError:
        return os.open(claim, os.O_RDONLY | PLAINLY)


def _read(claim: int) -> dict[str, object]:
    """The values of a claim; empty where it is none."""
    if not stat.S_ISREG(os.fstat(claim).st_mode):
        return {}
    os.lseek(claim, 0, os.SEEK_SET)
    try:
        claim_values = json.loads(os.read(claim, LONGEST_CLAIM))
    except (ValueError, RecursionError):
        return {}
    return claim_values if isinstance(claim_values, dict) else {}


def _is_at(claim: int, path: Path) -> bool:
    """Whether an open file is still the one at a path."""
    try:
        return os.path.samestat(os.fstat(claim), path.lstat())
    except FileNotFoundError:
        return False


def _is_own(path: Path) -> bool:
    """Whether a folder is there and this user's: only what such a one holds may be put back."""
    try:
        return not hasattr(os, "geteuid") or path.lstat().st_uid == os.geteuid()
    except FileNotFoundError:
        return False  # Without locks, another run may remove it meanwhile.


def _remove_remains(path: Path) -> None:
    """Remove a folder without a claim: one that was just made, whose run makes another, or one half removed: all
    others have their claim before anything else.
    """
    try:
        if not os.listdir(path):
            path.rmdir()
        elif not os.path.lexists(path / CLAIM):
            shutil.rmtree(path, ignore_errors=True)
    except OSError:
        return
