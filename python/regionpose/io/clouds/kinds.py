"""Which kind of file a cloud is, by its content first and its name's ending next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from regionpose.io.bags.place import bag_place
from regionpose.io.clouds.arrays import read_npy, read_npz
from regionpose.io.clouds.bare_rows import read_bin
from regionpose.io.clouds.cloud import Cloud
from regionpose.io.clouds.e57 import read_e57
from regionpose.io.clouds.errors import CloudError, cloud_error
from regionpose.io.clouds.las import read_las
from regionpose.io.clouds.meshes import read_mesh
from regionpose.io.clouds.pcd import is_pcd, read_pcd
from regionpose.io.clouds.ply import read_ply
from regionpose.io.clouds.ros import read_bag_cloud
from regionpose.io.clouds.text import read_text
from regionpose.io.reading import BOM, FileError, check_regular
from regionpose.progress import Progress

Reader = Callable[..., Cloud]

START_BYTES = 4096
"""Bytes at the start of a file by which its kind is recognized."""

read_glb: Reader = partial(read_mesh, kind="glb")

BEGINNINGS: tuple[tuple[bytes, Reader], ...] = (
    (b"ply\n", read_ply),
    (b"ply\r", read_ply),
    (b"LASF", read_las),
    (b"ASTM-E57", read_e57),
    (b"\x93NUMPY", read_npy),
    (b"PK\x03\x04", read_npz),
    (b"glTF", read_glb),
)

ENDINGS: dict[str, Reader] = {
    ".ply": read_ply,
    ".pcd": read_pcd,
    ".las": read_las,
    ".laz": read_las,
    ".e57": read_e57,
    ".npy": read_npy,
    ".npz": read_npz,
    ".bin": read_bin,
    ".glb": read_glb,
    ".obj": partial(read_mesh, kind="obj"),
    ".stl": partial(read_mesh, kind="stl"),
    **dict.fromkeys((".xyz", ".txt", ".csv", ".asc", ".pts"), read_text),
}


TABLE_READERS: frozenset[Reader] = frozenset((read_npy, read_npz, read_bin, read_text))
"""Readers of files whose columns may have no names."""

PIECEWISE_READERS: frozenset[Reader] = frozenset((read_ply, read_pcd, read_las, read_e57, read_bin, read_text))
"""Readers that report progress."""


def read_cloud(path: str | Path, *, columns: Sequence[str] | None = None, progress: Progress | None = None) -> Cloud:
    """The cloud in a file: PLY, PCD, LAS/LAZ, E57, .npy, .npz, KITTI .bin, text, a mesh (OBJ, STL, GLB, PLY), or a bag.

    The content decides the kind, or the name's ending where it cannot. Points that are not finite
    are dropped, and those at (0, 0, 0) of files without triangles.

    Parameters
    ----------
    path : str or Path
        Of the file. Of a bag of ROS or an MCAP file as `bag.mcap#/topic@12.5x10`: 10 scans from the one nearest to 12.5
        seconds on, counted from the bag's beginning, or since 1970; the first scan without a time, one without a
        number. They are joined as they are, in the scanner's frame.
    columns : sequence of str, optional
        Names of the columns of files that don't name them (text, .npy, .bin), as in `("x", "y", "z", "intensity",
        "ring")`; "_" leaves one out. A .bin doesn't state their number: it is inferred from the values, or a CloudError
        requests it.
    progress : callable, optional
        Called with the fraction of the file that is read, in [0, 1]; not for meshes of other kinds than PLY, .npy and
        .npz, which are read at once.

    Raises
    ------
    CloudError
        A ValueError, for a file that cannot be used.
    MissingExtraError
        Where its kind needs a package that is not installed.
    FileNotFoundError
        Where it is missing.
    """
    place = bag_place(path)
    if place is not None:
        if columns is not None:
            raise cloud_error(str(place), "columns", "names given", "none, since a bag names its own")
        return read_bag_cloud(place, progress=progress)
    location = Path(path)
    if location.is_dir():
        raise cloud_error(location, "path", "a directory", "a file")
    try:
        check_regular(location)
    except FileError as error:
        raise CloudError(str(error)) from error
    with location.open("rb") as file:
        start = file.read(START_BYTES).removeprefix(BOM)
    if not start:
        raise cloud_error(location, "file", "0 bytes", f"a cloud: {', '.join(ENDINGS)}")
    reader = _reader(location, start)
    keywords = {"progress": progress} if reader in PIECEWISE_READERS else {}
    if reader in TABLE_READERS:
        return reader(location, columns, **keywords)
    if columns is not None:
        raise cloud_error(location, "columns", "names given", "none, since the file names its own")
    return reader(location, **keywords)


def is_cloud(path: Path) -> bool:
    """Whether a file that is there is a cloud or a mesh, by its first bytes or its name; .txt files may be anything."""
    with path.open("rb") as file:
        start = file.read(START_BYTES).removeprefix(BOM)
    if any(start.startswith(beginning) for beginning, _ in BEGINNINGS) or is_pcd(start):
        return True
    return path.suffix.lower() in ENDINGS.keys() - {".txt"}


def file_size(path: Path) -> int:
    """The bytes of a cloud's file, for the progress; 0 of a bag's messages, and where it is missing or misnamed."""
    try:
        # Of a bag only a few messages are read; progress counts these.
        return 0 if bag_place(path) is not None else path.stat().st_size
    except (OSError, FileError):
        return 0


def _reader(path: Path, start: bytes) -> Reader:
    """The reader of a file that starts so."""
    for beginning, reader in BEGINNINGS:
        if start.startswith(beginning):
            return reader
    if is_pcd(start):
        return read_pcd
    try:
        return ENDINGS[path.suffix.lower()]
    except KeyError:
        raise cloud_error(path, "kind", f"ending {path.suffix!r}", f"one of {', '.join(ENDINGS)}") from None
