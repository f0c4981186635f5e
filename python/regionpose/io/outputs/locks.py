"""Locks of open files, which go with the process that holds them, however it ends; and the record by which its end is
detected where the file system knows no locks.
"""

from __future__ import annotations

import errno
import os
import platform
import sys
from collections.abc import Mapping
from pathlib import Path

try:
    import fcntl
except ImportError:
    fcntl = None  # type: ignore[assignment]

NO_LOCKS = {errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.EINVAL, errno.EBADF}
"""Errors of file systems without locks, such as Lustre, FUSE and NFS by their settings; of NFS the last one, too, where
a file is open to be read alone."""

LOCKED_BYTE = 1 << 30
"""The byte that Windows locks, whose locks keep others from reading: beyond what is written."""

BOOT, NAMESPACE = Path("/proc/sys/kernel/random/boot_id"), Path("/proc/self/ns/pid")
"""Where Linux gives the boot id, and the namespace of process numbers."""


def locked(file: int) -> bool | None:
    """Whether a file open under this number is locked by this process from now on, until it is closed.

    False where another one has it locked, None where that can't be known.
    """
    if sys.platform == "win32":
        import msvcrt

        os.lseek(file, LOCKED_BYTE, os.SEEK_SET)
        try:
            msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    if fcntl is None:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno in NO_LOCKS:
            return None
        raise
    return True


def this_process() -> dict[str, str | int]:
    """The identity of this process, unique across machines."""
    try:
        boot, namespace = BOOT.read_text(encoding="utf-8").strip(), os.readlink(NAMESPACE)
    except OSError:
        boot = namespace = ""
    return {"machine": platform.node(), "boot": boot, "namespace": namespace, "process": os.getpid()}


def has_ended(process: Mapping[str, object]) -> bool:
    """Whether a process, identified by `this_process`, has certainly ended."""
    own, number = this_process(), process.get("process")
    if sys.platform == "win32" or not isinstance(number, int) or process.get("machine") != own["machine"]:
        return False
    if process.get("boot") != own["boot"]:
        return True
    if process.get("namespace") != own["namespace"]:
        return False
    try:
        os.kill(number, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False
