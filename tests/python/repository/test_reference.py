"""The reference pages are complete: every warning, command, result key, export and dependency has its line."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest
import regionpose as rp
import typer
from regionpose.cli.app import app
from regionpose.io.exports import FORMATS
from regionpose.scene.verdict import DOUBTS

ROOT = Path(__file__).resolve().parents[3]
REFERENCE = ROOT / "docs" / "reference"

RUST_CODE = re.compile(r'Self::\w+(?: \{ \.\. \})? => "([a-z-]+)"')
PYTHON_CODE = re.compile(r'PoseWarning\(\s*"([a-z-]+)"')


def first_cells(page: Path) -> set[str]:
    """What stands in backticks in the first column of a page's tables, up to the first space."""
    return set(re.findall(r"^\| `([\w-]+)`", page.read_text(encoding="utf-8"), re.MULTILINE))


def codes_in_the_sources() -> set[str]:
    """Codes of all warnings that the crate and the package make, but for those of doctests."""
    rust = (ROOT / "rust" / "src" / "verdict" / "warning.rs").read_text(encoding="utf-8")
    python = [file.read_text(encoding="utf-8") for file in (ROOT / "python").glob("**/*.py")]
    code = "\n".join(re.sub(r"^\s*(>>>|\.\.\.).*$", "", text, flags=re.MULTILINE) for text in python)
    return {*RUST_CODE.findall(rust), *PYTHON_CODE.findall(code)}


def test_every_warning_has_a_cause_and_a_cure() -> None:
    codes = codes_in_the_sources()
    assert {"ambiguous", "sparse-sampling", "outlier-frame"} <= codes, "the sources were not found"
    assert first_cells(REFERENCE / "warnings.md") == codes
    rows = re.findall(r"^\| `[a-z-]+` \|(.*)\|$", (REFERENCE / "warnings.md").read_text("utf-8"), re.MULTILINE)
    assert all(all(cell.strip() for cell in row.split("|")) for row in rows)


def test_what_makes_a_pose_doubtful_is_said() -> None:
    text = (REFERENCE / "warnings.md").read_text(encoding="utf-8")
    said = re.search(r"A pose is \*\*doubtful\*\* with (.*?):", text, re.DOTALL)
    assert said is not None and "any of the\nfive contradictions" in said[1]
    contradictions = {code for code in DOUBTS if code.endswith("-contradicted")}
    assert len(contradictions) == 5
    assert set(re.findall(r"`([a-z-]+)`", said[1])) == DOUBTS - contradictions


def test_every_command_is_listed() -> None:
    text = (REFERENCE / "commands.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `regionpose (\w+)", text, re.MULTILINE)
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    assert sorted(listed) == sorted(commands)


@pytest.mark.parametrize("page", [ROOT / "docs" / "how-to" / "exports.md", REFERENCE / "result.md"])
def test_every_export_is_listed(page: Path) -> None:
    assert set(FORMATS) <= first_cells(page)


def test_every_dependency_has_its_license() -> None:
    text = (REFERENCE / "licenses.md").read_text(encoding="utf-8")
    listed = {name.lower() for name in re.findall(r"^\| ([\w.-]+) \|", text, re.MULTILINE)}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    crates = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["dependencies"]
    packages = [re.split(r"[<>=\[ ]", each)[0].lower() for each in project["dependencies"]]
    assert {*packages, *crates} <= listed
    assert "not stated" not in text


def test_the_citation_names_the_version() -> None:
    version = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 120


def test_keys_of_a_result_are_described(tmp_path: Path) -> None:
    from regionpose.cli import main

    scene = rp.datasets.demo_folder() / "scene_masks.yaml"
    assert main(["estimate", str(scene), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    keys = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    text = (REFERENCE / "result.md").read_text(encoding="utf-8")
    assert [key for key in keys if f"`{key}`" not in text] == []
