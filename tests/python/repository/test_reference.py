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
from regionpose.solve.status import DOUBTFUL_CODES
from regionpose.solve.warning_code import WarningCode
from regionpose.solve.warning_texts import TEXTS

ROOT = Path(__file__).resolve().parents[3]
REFERENCE = ROOT / "docs" / "reference"

RUST_CODE = re.compile(r'Self::\w+(?: \{ \.\. \})? => "([a-z-]+)"')


def first_cells(page: Path) -> set[str]:
    """What stands in backticks in the first column of a page's tables, up to the first space."""
    return set(re.findall(r"^\| `([\w-]+)`", page.read_text(encoding="utf-8"), re.MULTILINE))


def test_every_warning_has_a_cause_and_the_advice_of_the_package() -> None:
    text = (REFERENCE / "warnings.md").read_text(encoding="utf-8")
    assert first_cells(REFERENCE / "warnings.md") == {code.value for code in WarningCode}
    rows = re.findall(r"^\| `([a-z-]+)` \| ([^|]+) \| ([^|]+) \|$", text, re.MULTILINE)
    assert {code: advice for code, _, advice in rows} == {code.value: TEXTS[code].advice for code in WarningCode}
    assert all(cause.strip() for _, cause, _ in rows)


def test_the_crates_warnings_have_their_texts_in_the_package() -> None:
    codes = RUST_CODE.findall((ROOT / "rust" / "src" / "verdict" / "warning.rs").read_text(encoding="utf-8"))
    assert len(codes) >= 12, "the sources were not found"
    assert set(codes) <= {code.value for code in WarningCode} and set(TEXTS) == set(WarningCode)


def test_what_makes_a_pose_doubtful_is_said() -> None:
    text = (REFERENCE / "warnings.md").read_text(encoding="utf-8")
    said = re.search(r"A pose is \*\*doubtful\*\* with (.*?):", text, re.DOTALL)
    assert said is not None and set(re.findall(r"`([a-z-]+)`", said[1])) == {code.value for code in DOUBTFUL_CODES}


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
    manifest = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
    chosen = {part for feature in manifest["features"]["default"] for part in manifest["features"][feature]}
    # The extension has the default features.
    crates = {
        name for name, found in manifest["dependencies"].items() if "optional" not in found or f"dep:{name}" in chosen
    }
    packages = [re.split(r"[<>=\[ ]", each)[0].lower() for each in project["dependencies"]]
    assert {*packages, *crates} <= listed
    assert "not stated" not in text


def test_the_citation_names_the_version() -> None:
    version = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]["package"]["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) < 120


@pytest.mark.slow
def test_keys_of_a_result_are_described(tmp_path: Path) -> None:
    from regionpose.cli import main

    scene = rp.datasets.demo_folder() / "scene_masks.yaml"
    assert main(["estimate", str(scene), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    keys = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    text = (REFERENCE / "result.md").read_text(encoding="utf-8")
    assert [key for key in keys if f"`{key}`" not in text] == []
