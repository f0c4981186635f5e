"""Damage to files: what a disk, a network, a text editor and an attacker do to them."""

from __future__ import annotations

import re
from random import Random

NUMBERS = (
    b"0",
    b"-1",
    b"1",
    b"nan",
    b"-inf",
    b"1e999",
    b"1e-320",
    b"0.5",
    b"255",
    b"65536",
    b"2147483647",
    b"4294967296",
    b"9223372036854775807",
    b"9" * 40,
    b"9" * 5000,
    b"1_0",
    b"0x10",
)
"""Numbers put in the place of others: limits of types, and what is no number to some."""

WORDS = (b"", b"null", b"true", b"[]", b"{}", b'""', b"[[1, 2], [3]]", b'{"a": 1}', b'"\\ud800"', b"*a", b"&a", b"!!x")
"""Values put in the place of others."""

SIZES = (0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
"""Whole numbers written over bytes."""

NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
VALUE = re.compile(rb"\"[^\"\n]*\"|[A-Za-z_]+|[-+]?\d+(?:\.\d*)?|\[[^\[\]]*\]|\{[^{}]*\}")


def mutated(content: bytes, random: Random) -> bytes:
    """The content with one to four kinds of damage."""
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        content = random.choice(KINDS)(content, random)
    return content


def _replaced(content: bytes, random: Random, pattern: re.Pattern[bytes], others: tuple[bytes, ...]) -> bytes:
    found = list(pattern.finditer(content))
    if not found:
        return content
    at = random.choice(found)
    return content[: at.start()] + random.choice(others) + content[at.end() :]


def _number(content: bytes, random: Random) -> bytes:
    """A number is another."""
    return _replaced(content, random, NUMBER, NUMBERS)


def _value(content: bytes, random: Random) -> bytes:
    """A value of a text is of another kind."""
    return _replaced(content, random, VALUE, WORDS + NUMBERS)


def _swapped(content: bytes, random: Random) -> bytes:
    """A value of a text stands in the place of another."""
    found = [match.group() for match in VALUE.finditer(content)]
    return _replaced(content, random, VALUE, tuple(found)) if found else content


def _bits(content: bytes, random: Random) -> bytes:
    """Some bits are turned, mostly near the start, where headers are."""
    data = bytearray(content)
    for _ in range(random.choice((1, 2, 8)) if data else 0):
        span = len(data) if random.random() < 0.4 else min(len(data), 256)
        data[random.randrange(span)] ^= 1 << random.randrange(8)
    return bytes(data)


def _size(content: bytes, random: Random) -> bytes:
    """A whole number of 1 to 8 bytes is another."""
    width = random.choice((1, 2, 4, 8))
    if len(content) < width:
        return content
    span = len(content) - width + 1
    at = random.randrange(span if random.random() < 0.4 else min(span, 512))
    value = random.choice(SIZES) & ((1 << 8 * width) - 1)
    return content[:at] + value.to_bytes(width, random.choice(("little", "big"))) + content[at + width :]


def _cut(content: bytes, random: Random) -> bytes:
    """The end is missing."""
    return content[: random.randrange(len(content) + 1)]


def _gap(content: bytes, random: Random) -> bytes:
    """A part is missing, or there twice."""
    first, last = sorted(random.randrange(len(content) + 1) for _ in range(2))
    return content[:first] + content[last:] if random.random() < 0.5 else content[:last] + content[first:]


def _noise(content: bytes, random: Random) -> bytes:
    """Any bytes are put in."""
    at = random.randrange(len(content) + 1)
    return content[:at] + random.randbytes(random.choice((1, 4, 64))) + content[at:]


KINDS = (_number, _number, _value, _swapped, _bits, _bits, _size, _size, _cut, _gap, _noise)
