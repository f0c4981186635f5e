"""The crate's constants, read from its sources; `tests/rust/constants.txt` holds the kind of each.

    python tools/crate_constants.py

prints those that the list lacks, those that are gone, and how many there are of each kind. The numbers of the model are
in the table of `docs/math.md`, section 21, as well.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CRATE = ROOT / "rust" / "src"
LIST = ROOT / "tests" / "rust" / "constants.txt"
DOCUMENT = ROOT / "docs" / "math.md"

KINDS = {
    "exact": "follows from mathematics, from the paper, from other constants or from the number format",
    "layout": "how work is grouped and charged: costs time, changes no answer",
    "numerics": "ends of iterations and orders of rules: changes answers by less than their stated tolerance",
    "limit": "what is refused, or read as nothing",
    "effort": "how much is searched: more finds no less, if the work budget grows as much (docs/math.md, section 21)",
    "model": "a number that answers depend on",
}

ITEM = re.compile(r"^ *(?:pub(?:\([a-z]+\))? )?const (\w+): [^=\n]+=\s*((?:[^;\"]|;(?! *\n))*);", re.MULTILINE)
ROW = re.compile(r"^\| `([\w/]+)::(\w+)` \| ([^|]+?) \|", re.MULTILINE)


def constants() -> dict[str, str]:
    """The value of each constant, as it is written, by `file::NAME`; those of unit tests are left out."""
    found = {}
    for file in sorted(CRATE.glob("**/*.rs")):
        code = file.read_text(encoding="utf-8").partition("#[cfg(test)]\nmod tests")[0]
        path = file.relative_to(CRATE).with_suffix("").as_posix().removesuffix("/mod")
        for name, value in ITEM.findall(code):
            if name != "_":
                found[f"{path}::{name}"] = " ".join(value.split())
    return found


def kinds() -> dict[str, str]:
    """The kind of each constant that the list holds."""
    lines = LIST.read_text(encoding="utf-8").splitlines()
    return {name: kind for kind, name in (line.split() for line in lines if line and not line.startswith("#"))}


def table() -> dict[str, str]:
    """The value of each number of the model, as the document gives it."""
    return {f"{path}::{name}": value for path, name, value in ROW.findall(DOCUMENT.read_text(encoding="utf-8"))}


def main() -> None:
    """Run from the command line."""
    found, listed = constants(), kinds()
    for name in sorted(found.keys() - listed.keys()):
        print("not in the list:", name, "=", found[name])
    for name in sorted(listed.keys() - found.keys()):
        print("gone:", name)
    counts = Counter(listed.values())
    for kind, meaning in KINDS.items():
        print(f"{counts[kind]:4} {kind}: {meaning}")


if __name__ == "__main__":
    main()
