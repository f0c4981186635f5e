"""Files read within a budget: what a header promises is compared with the file before memory is taken for it.

Errors of the libraries become `FileError`s that name the file.
"""

from __future__ import annotations

import math
import os
import stat
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import IO, Any, NamedTuple
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageOps

from regionpose.io.json_text import json_value
from regionpose.io.text_error import TextError
from regionpose.validation.arrays import eight_bits

FREE_BYTES = 10**8
"""Bytes to which any file may unfold, however small: a mask of 100 megapixels. With what is made of them in
between, pictures at this limit take 280 to 440 MB."""

MOST_RATIO = 100
"""Bytes to which each byte of a larger file may unfold. Photos, clouds and archives of numbers stay below 20, but empty
masks and constant columns unfold a thousandfold."""

IMAGE_SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp"}
"""Endings of the names of pictures, in lower case."""

PICTURE_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "WEBP", "PPM", "GIF", "JPEG2000")
"""Pillow's names of the formats that are read. It knows more, of which EPS starts another program, Ghostscript. JPEG
stands for MPO, too, which phones write: a JPEG that holds further ones."""

BOM = b"\xef\xbb\xbf"
"""The byte order mark that some editors put before UTF-8."""

MOST_DIGITS = 18
"""Digits of a whole number in a header: what 64 bits hold."""

ARRAY_HEADERS: dict[tuple[int, int], Callable[[IO[bytes]], tuple[Any, ...]]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class FileError(ValueError):
    """A file that cannot be used: names the file, what was found and what is needed."""


NO_FILES = {stat.S_IFIFO: "a pipe", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket"}
"""What isn't read, by its type: it may never come, or never end."""


def check_regular(path: Path) -> None:
    """FileError for a pipe, a device or a socket, behind a link or not; a missing file is the reader's error."""
    try:
        kind = stat.S_IFMT(os.stat(path).st_mode)
    except (OSError, ValueError):
        return
    if kind in NO_FILES:
        raise FileError(f"{path}: found {NO_FILES[kind]}; needed a file")


class Pixels(NamedTuple):
    """A picture's pixels (h, w) or (h, w, channels) as viewers show them, Pillow's mode of the file, and its format."""

    values: NDArray[Any]
    mode: str
    format: str | None


def most_bytes(path: Path) -> int:
    """Bytes to which a file may unfold in memory."""
    return max(FREE_BYTES, MOST_RATIO * path.stat().st_size)


def unfolding_error(path: Path, bytes_promised: int) -> str | None:
    """What is wrong with a file that promises so many bytes, as `found ...; needed ...`; None where nothing is."""
    most = most_bytes(path)
    if bytes_promised <= most:
        return None
    return f"found {bytes_promised} bytes in a file of {path.stat().st_size}; needed at most {most}"


def is_picture(path: Path) -> bool:
    """Whether a file is a picture that Pillow knows, by its first bytes."""
    try:
        with Image.open(path, formats=PICTURE_FORMATS) as picture:
            return bool(picture.format)
    except Exception:
        return False


def read_pixels(path: Path, mode: str | None = None, per_pixel: int = 1, *, content: IO[bytes] | None = None) -> Pixels:
    """The first picture of an image file, turned by its EXIF data, as viewers and OpenCV do, and converted to
    Pillow's `mode` where one is given; gray of more than 8 bits stays as it is.

    `per_pixel`: a quarter of the bytes that the caller makes of each pixel, where that is more than it has in the file.
    `content`: the picture's own bytes, where the file holds more than it.
    FileError where it is damaged, none, or larger than twice `PIL.Image.MAX_IMAGE_PIXELS`, which raises the limit, or
    than its file makes likely. FileNotFoundError.
    """
    check_regular(path)
    try:
        # The open file: of a path, Pillow 13 maps the rows of a turned TIFF into memory by the width that is shown.
        with (
            path.open("rb") if content is None else content as file,
            Image.open(file, formats=PICTURE_FORMATS) as picture,
        ):
            _check_pixels(path, picture, per_pixel)
            ImageOps.exif_transpose(picture, in_place=True)
            is_kept = mode is None or _depth(picture) > 1
            return Pixels(np.array(picture if is_kept else picture.convert(mode)), picture.mode, picture.format)
    except (FileNotFoundError, FileError):
        raise
    # Damage shows as errors of every type, and without the file's name.
    except Exception as error:
        needed = "a whole PNG, JPEG, TIFF or the like"
        raise FileError(f"{path}: found no picture ({_described(error)}); needed {needed}") from error


def read_colors(path: Path, *, content: IO[bytes] | None = None) -> NDArray[np.uint8]:
    """The first picture (h, w, 3) of an image file in 8 bits, deeper gray as of `eight_bits`; else as of `read_pixels`.

    FileError also for levels that are not finite.
    """
    values = read_pixels(path, "RGB", per_pixel=3, content=content).values
    try:
        levels = eight_bits(values)
    except ValueError as error:
        raise FileError(f"{path}: {error}") from error
    return levels if levels.ndim == 3 else np.repeat(levels[..., None], 3, axis=2)


def read_turn(path: Path) -> int | None:
    """The orientation by which the EXIF data of an image file turn it by a quarter, 5 to 8; None where they do not, and
    for a file that is none.
    """
    try:
        with Image.open(path, formats=PICTURE_FORMATS) as picture:
            turn = picture.getexif().get(ExifTags.Base.Orientation)
    except Exception:  # Damage shows as errors of every type.
        return None
    return turn if turn in {5, 6, 7, 8} else None


def _depth(picture: Image.Image) -> int:
    """Bytes of each number of a picture."""
    return 4 if picture.mode in {"I", "F"} else 2 if picture.mode.startswith("I;16") else 1


def _check_pixels(path: Path, picture: Image.Image, per_pixel: int) -> None:
    pixel_bytes = max(len(picture.getbands()) * _depth(picture), per_pixel)
    wrong = unfolding_error(path, picture.width * picture.height * pixel_bytes)
    if wrong is not None:
        raise FileError(f"{path}: {picture.width} x {picture.height} pixels: {wrong}")


def read_array(path: Path) -> NDArray[Any]:
    """The array of a .npy file, or the only one of an .npz archive, of numbers or text.

    FileError where it is damaged, holds objects, or promises more than the file holds. FileNotFoundError.
    """
    check_regular(path)
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            file.seek(0)
            return _array(path, "array", file, path.stat().st_size)
    arrays = read_archive(path)
    if len(arrays) != 1:
        raise FileError(f"{path}: found {len(arrays)} arrays; needed one")
    return next(iter(arrays.values()))


def read_archive(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an .npz archive by name; errors as of `read_array`."""
    check_regular(path)
    try:
        with zipfile.ZipFile(path) as archive:
            wrong = unfolding_error(path, sum(member.file_size for member in archive.infolist()))
            if wrong is not None:
                raise FileError(f"{path}: archive: {wrong}")
            return {
                member.filename.removesuffix(".npy"): _member(path, archive, member) for member in archive.infolist()
            }
    except (FileNotFoundError, FileError):
        raise
    # Damaged archives fail in zipfile, zlib and struct alike.
    except Exception as error:
        raise FileError(f"{path}: archive: found damage ({_described(error)}); needed a whole .npz") from error


def _member(path: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    # The directory's size bounds what is unpacked, whatever the stream holds.
    with archive.open(member) as file:
        content = file.read(member.file_size)
    return _array(path, member.filename, BytesIO(content), len(content))


def _array(path: Path, item: str, file: IO[bytes], size: int) -> NDArray[Any]:
    """The array at the start of a file of `size` bytes."""
    try:
        shape, _, kind = ARRAY_HEADERS[np.lib.format.read_magic(file)](file)
        promised, available = math.prod(shape) * kind.itemsize, size - file.tell()
        if kind.hasobject or not kind.itemsize:
            raise FileError(f"{path}: {item}: found {kind} values; needed numbers")
        if promised > available:
            raise FileError(f"{path}: {item}: found {available} bytes; needed {promised} for {kind} of shape {shape}")
        file.seek(0)
        return np.lib.format.read_array(file, allow_pickle=False)
    except FileError:
        raise
    # Damaged headers fail in numpy and in Python's tokenizer alike.
    except Exception as error:
        raise FileError(f"{path}: {item}: found damage ({_described(error)}); needed a whole .npy") from error


def read_json(path: Path) -> Any:
    """The value of a JSON file in UTF-8; FileError that names the place where it is none. FileNotFoundError."""
    check_regular(path)
    try:
        return json_value(path.read_bytes().decode("utf-8-sig"))
    except TextError as error:
        raise FileError(f"{path}: {error.place}{error}") from error
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: found a binary file; needed JSON in UTF-8") from error


def read_xml(path: Path) -> Element:
    """The root of an XML file in UTF-8; FileError for other files, and for one that declares entities, which may unfold
    without limit. FileNotFoundError.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
        if "<!DOCTYPE" in text:
            raise FileError(f"{path}: found a document type; needed XML without one")
        return fromstring(text)
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: found a binary file; needed XML in UTF-8") from error
    except ParseError as error:
        raise FileError(f"{path}: found no XML ({error}); needed whole XML") from error


def whole_number(word: str) -> int | None:
    """The whole number of at least 0 that a word of a header is; None for any other word, and for too many digits."""
    return int(word) if word.isascii() and word.isdecimal() and len(word) <= MOST_DIGITS else None


def _described(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text[:120]}"
