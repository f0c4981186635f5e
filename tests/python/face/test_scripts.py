"""The scripts in `examples/scripts`: each runs, is short, and uses public names alone."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

import pytest
from public_names import PUBLIC

pytestmark = pytest.mark.slow

SCRIPTS = sorted((Path(__file__).resolve().parents[3] / "examples" / "scripts").glob("*.py"))

MOST_LINES = 20


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_runs(script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(script), run_name="__main__")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_is_short_and_uses_public_names(script: Path) -> None:
    text = script.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    used = {ast.unparse(node).removeprefix("rp.") for node in ast.walk(ast.parse(text)) if is_public_use(node)}
    assert used and all(is_public(name) for name in used)


def is_public_use(node: ast.AST) -> bool:
    """Whether a node is a dotted name of the package."""
    return isinstance(node, ast.Attribute) and ast.unparse(node).startswith("rp.") and "(" not in ast.unparse(node)


def is_public(name: str) -> bool:
    """Whether a dotted name is public, a module of public names, or an attribute of a public object."""
    return any(name == each or each.startswith(f"{name}.") or name.startswith(f"{each}.") for each in PUBLIC)
