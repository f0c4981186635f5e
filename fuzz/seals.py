"""Checksums put right again, so that damage gets past them to what reads the content."""

from __future__ import annotations

import io
import zipfile
import zlib

PNG_START = 8
E57_PAGE, E57_CHECKSUM = 1024, 4

CASTAGNOLI = 0x82F63B78
"""Polynomial of CRC-32C, reversed."""


def as_given(content: bytes) -> bytes:
    """The content of a file without checksums."""
    return content


def png(content: bytes) -> bytes:
    """A PNG with the checksum of each chunk, up to the first one that doesn't fit."""
    data, at = bytearray(content), PNG_START
    while at + 12 <= len(data):
        end = at + 8 + int.from_bytes(data[at : at + 4], "big")
        if end + 4 > len(data):
            break
        data[end : end + 4] = zlib.crc32(data[at + 4 : end]).to_bytes(4, "big")
        at = end + 4
    return bytes(data)


def zipped(content: bytes) -> bytes:
    """An archive of one array."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("points.npy", content)
    return buffer.getvalue()


def e57(content: bytes) -> bytes:
    """An E57 file with the checksum of each whole page."""
    data = bytearray(content)
    for start in range(0, len(data) - E57_PAGE + 1, E57_PAGE):
        end = start + E57_PAGE - E57_CHECKSUM
        data[end : end + E57_CHECKSUM] = _crc32c(data[start:end]).to_bytes(E57_CHECKSUM, "big")
    return bytes(data)


def _crc32c(data: bytes | bytearray) -> int:
    checksum = 0xFFFFFFFF
    for byte in data:
        checksum = TABLE[(checksum ^ byte) & 0xFF] ^ (checksum >> 8)
    return checksum ^ 0xFFFFFFFF


def _table_entry(value: int) -> int:
    for _ in range(8):
        value = (value >> 1) ^ (CASTAGNOLI if value & 1 else 0)
    return value


TABLE = [_table_entry(value) for value in range(256)]
