"""What users read is plain: phrases that have to be read twice stay out of it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

# Each phrase with what to write instead.
PHRASES = {
    r"\bserves every\b": "works with any",
    r"what to be warned of": "warns when ...",
    r"\b(is|are|be) warned of\b": "warns of ..., is reported",
    r"\bis said in\b": "is reported in",
    r"\bfits? from several poses, of which\b.*\bof which\b": "two sentences",
    r"(has|have) an? `\w+` in (its|their) place": "returns a ...",
    r"\bnone asks anything\b": "never prompts",
    r"\bwhat is known settles\b": "resolve the ambiguity with a prior",
    r"\bend(s|ed)? (its|their) worker\b": "crashes a worker",
    r"\bto one pose, leaves\b": "estimates one pose from ...",
    r"\bbears? \d|\bborne by\b": "tolerates",
    r"\bhow sure (it|that) is\b": "how certain it is",
    r"\bis said for each\b": "is reported for each",
    r"\bno(thing|body|ne) \w+ anything\b": "active voice without a double negative",
    r"\bas it may be\b": "may be",
    r"\bwhat is said above\b": "see above",
    r"\bsays yes\b|\bsays no\b": "agrees, disagrees",
}

FOR_DEVELOPERS = {"math.md", "measurements.md", "architecture.md"}

PAGES = [
    *ROOT.glob("*.md"),
    *(page for page in (ROOT / "docs").glob("**/*.md") if page.name not in FOR_DEVELOPERS),
]


def relative(path: Path) -> str:
    """A path for a test's name."""
    return path.relative_to(ROOT).as_posix()


def found_phrases(text: str) -> list[str]:
    """Phrases to avoid in a text, with what to write instead."""
    joined = re.sub(r"\s+", " ", text)
    return [
        f"{hit[0]!r}: {better}"
        for phrase, better in PHRASES.items()
        for hit in re.finditer(phrase, joined, re.IGNORECASE)
    ]


def public_strings(file: Path) -> Iterator[str]:
    """Docstrings and messages of a module: all its strings."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


@pytest.mark.parametrize("page", PAGES, ids=relative)
def test_pages_are_plain(page: Path) -> None:
    assert found_phrases(page.read_text(encoding="utf-8")) == []


def test_docstrings_messages_and_help_are_plain() -> None:
    files = sorted((ROOT / "python").glob("**/*.py"))
    found = {(relative(file), hit) for file in files for text in public_strings(file) for hit in found_phrases(text)}
    assert not found


def test_messages_of_the_crate_are_plain() -> None:
    files = sorted((ROOT / "rust").glob("*src/**/*.rs"))
    texts = {file: re.findall(r'#\[error\("(.*?)"', file.read_text(encoding="utf-8"), re.DOTALL) for file in files}
    assert not {(relative(file), hit) for file, told in texts.items() for text in told for hit in found_phrases(text)}
