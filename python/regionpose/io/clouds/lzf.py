"""LZF, the compression of PCD files."""

from __future__ import annotations

import importlib
from types import ModuleType

LITERAL_CODES = 32
"""Control bytes below this start a run of as many literal bytes plus one; others a reference back into the output."""

LONG_REFERENCE = 7
"""The three-bit length of a reference whose length goes on in the next byte."""

SHORTEST_REFERENCE = 2
"""Added to the length that a reference spells."""

MOST_RATIO = 88
"""Bytes that a compressed one stands for at the most: the longest reference is 264 bytes by 3."""


def decompress(compressed: bytes, size: int) -> bytes | bytearray:
    """The `size` bytes that `compressed` stands for; ValueError when it is damaged or stands for another number.

    By the C module `lzf` (extra `pcd`) where it is installed, some thirty times as fast as the Python below.
    """
    try:
        native: ModuleType = importlib.import_module("lzf")
    except ModuleNotFoundError:
        return decompress_in_python(compressed, size)
    plain: bytes | None = native.decompress(compressed, size) if compressed else b""
    if plain is None or len(plain) != size:
        raise ValueError(f"{'more' if plain is None else len(plain)} bytes instead of {size}")
    return plain


def decompress_in_python(compressed: bytes, size: int) -> bytearray:
    """What `decompress` gives, without the C module: runs and references are copied as slices."""
    plain = bytearray()
    done = at = 0
    try:
        while at < len(compressed):
            code = compressed[at]
            if code < LITERAL_CODES:
                start, at = at + 1, at + code + 2
                plain += compressed[start:at]
                done += code + 1
                continue
            length = code >> 5
            if length == LONG_REFERENCE:
                at += 1
                length += compressed[at]
            start = done - ((code & 31) << 8) - compressed[at + 1] - 1
            at += 2
            length += SHORTEST_REFERENCE
            if start < 0:
                raise ValueError(f"a reference before the start at byte {at}")
            if start + length <= done:
                plain += plain[start : start + length]
            else:
                plain += _repeated(plain[start:], length)
            done += length
            if done > size:
                break
    except IndexError:
        raise ValueError("a reference cut short at the end") from None
    if len(plain) != size or done != size:
        raise ValueError(f"{len(plain)} bytes{' and more' if done > size else ''} instead of {size}")
    return plain


def _repeated(pattern: bytearray, length: int) -> bytearray:
    """`pattern` over and over, `length` bytes: what a reference that overlaps its own output copies."""
    return (pattern * (length // len(pattern) + 1))[:length]
