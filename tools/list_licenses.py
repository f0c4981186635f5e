"""Write docs/reference/licenses.md: the licenses of all dependencies, from their own metadata.

`python tools/list_licenses.py` in an environment with the package and its extras, with cargo at hand.
"""

from __future__ import annotations

import json
import re
import subprocess
import tomllib
from importlib import metadata
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "licenses.md"
EXTRAS = ("clouds", "pick", "ros", "studies")

HEAD = """# Licenses of dependencies

regionpose is licensed under MIT or Apache-2.0, at your choice. It is compiled together with the crates below. The
Python packages are installed beside it and not distributed with it. This page is written by
`python tools/list_licenses.py` from `cargo metadata` and the metadata of the installed packages.

All of them are permissive: they ask that their license texts are kept.
"""


def crates() -> list[tuple[str, str, str]]:
    """Name, version and license of each crate that the extension is compiled from."""
    found = json.loads(_cargo("metadata", "--format-version", "1"))
    tree = _cargo("tree", "--package", "regionpose-python", "--edges", "normal", "--prefix", "none", "--format", "{p}")
    used = {tuple(line.split()[:2]) for line in tree.splitlines() if line.strip()}
    packages = [(each["name"], each["version"], each["license"] or "not stated") for each in found["packages"]]
    own = {"regionpose", "regionpose-python"}
    return sorted(row for row in packages if (row[0], f"v{row[1]}") in used and row[0] not in own)


def _cargo(*arguments: str) -> str:
    command = ["cargo", *arguments, "--locked"]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def packages() -> list[tuple[str, str, str]]:
    """Name, license and what asks for it, of each Python package that the package and its extras require."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    rows = [_row(each, "always") for each in project["dependencies"]]
    for extra in EXTRAS:
        for each in project["optional-dependencies"][extra]:
            rows += [_row(part, extra) for part in _parts(project["optional-dependencies"], each)]
    return sorted(rows, key=lambda row: (row[2] != "always", row[2], row[0].lower()))


def _parts(extras: dict[str, list[str]], requirement: str) -> list[str]:
    """A requirement, or those of the package's own extras that it names."""
    own = re.fullmatch(r"regionpose\[(.*)\]", requirement)
    return [requirement] if own is None else [part for name in own[1].split(",") for part in extras[name]]


def _row(requirement: str, asked_by: str) -> tuple[str, str, str]:
    name = re.match(r"[\w.-]+", requirement)
    assert name is not None
    return name[0], license_of(metadata.metadata(name[0])), asked_by


def license_of(held: Any) -> str:
    """The license of a package's metadata: its expression, its classifiers, or the first line of its text."""
    if held.get("License-Expression"):
        return str(held["License-Expression"])
    told = [each.split(" :: ")[-1] for each in held.get_all("Classifier") or [] if each.startswith("License ::")]
    told = [each for each in told if each != "OSI Approved"]
    text = (held.get("License") or "").strip().split("\n")[0]
    return ", ".join(told) or text or "not stated"


def table(head: tuple[str, ...], rows: list[tuple[str, str, str]]) -> str:
    """A table in Markdown."""
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ("---",) * len(head), *rows])


def main() -> None:
    """Write the page."""
    parts = [
        HEAD,
        "## Crates\n",
        table(("crate", "version", "license"), crates()) + "\n",
        "## Python packages\n",
        table(("package", "license", "needed for"), packages()),
    ]
    PAGE.write_text("\n".join(parts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
