"""OCamCalib's calib_results.txt."""

from __future__ import annotations

from regionpose.cameras import Camera, OcamCamera
from regionpose.io.calibrations.text import CalibrationText

HEADERS = {
    "polynomial": ("polynomial", "direct"),
    "center": ("center",),
    "affine parameters": ("affine",),
    "image size": ("image size",),
}
"""Words, in lower case, of the comment above each section that is read; other sections are passed over."""

Section = tuple[int, list[str]]


def describes(source: CalibrationText) -> bool:
    """Whether a comment announces the direct polynomial."""
    return any(_section_named(line) == "polynomial" for line in source.lines)


def read_camera(source: CalibrationText, name: str | None) -> Camera:
    """The camera of the file, called `ocam`."""
    return source.camera({"ocam": lambda: _camera(source)}, name)


def _camera(source: CalibrationText) -> OcamCamera:
    sections = _sections(source)
    row, column = _numbers(source, sections, "center", 2)
    c, d, e = _numbers(source, sections, "affine parameters", 3)
    line, words = sections["image size"]
    _numbers(source, sections, "image size", 2)
    height, width = (source.whole_number("image size", word, line) for word in words)
    polynomial = _polynomial(source, *sections["polynomial"])
    return OcamCamera.from_ocamcalib(polynomial, (row, column), (c, d, e), width=width, height=height)


def _sections(source: CalibrationText) -> dict[str, Section]:
    """First line (from 1) and words of each section; CalibrationError when one is missing, empty or double."""
    sections: dict[str, Section] = {}
    current: str | None = None
    for line, text in enumerate(source.lines, start=1):
        if text.lstrip().startswith("#"):
            current = _section_named(text)
            if current in sections:
                raise source.error(current, "a second section", "one", line)
        elif current is not None and text.split():
            start, words = sections.get(current, (line, []))
            sections[current] = (start, words + text.split())
    for section in HEADERS:
        if section not in sections:
            raise source.error(section, "no section with numbers", "one under a comment that names it")
    return sections


def _section_named(line: str) -> str | None:
    """The section that a comment announces."""
    comment = line.strip().lower()
    if not comment.startswith("#"):
        return None
    return next((name for name, words in HEADERS.items() if all(word in comment for word in words)), None)


def _numbers(source: CalibrationText, sections: dict[str, Section], section: str, count: int) -> list[float]:
    line, words = sections[section]
    return source.numbers(section, words, count, line)


def _polynomial(source: CalibrationText, line: int, words: list[str]) -> tuple[float, ...]:
    """The coefficients, whose count comes first."""
    count = source.whole_number("polynomial count", words[0], line)
    ss = source.numbers("polynomial", words[1:], count, line)
    if not ss or ss[0] >= 0.0:
        raise source.error("polynomial", ss[0] if ss else "no coefficients", "a first coefficient below 0", line)
    return tuple(ss)
