"""Builds what is released and tries each from where its user gets it.

`python tools/check_packages.py [wheel] [sdist] [crate]`; all three without a name. The wheel and the source
distribution are installed into an empty environment, the wheel without a Rust compiler, and the tests of the unpacked
source distribution run there. The crate is packed, unpacked, and tested there.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KINDS = ("wheel", "sdist", "crate")
RUST_TOOLS = ("cargo", "rustc")


def main() -> None:
    """Check the kinds that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    # With choices, argparse refuses that none is named.
    parser.add_argument("kinds", nargs="*", metavar=f"{{{','.join(KINDS)}}}", help="what is tried; all by default")
    parser.add_argument("--dist", type=Path, help="a folder that holds the wheel and the sdist already")
    parser.add_argument("--jobs", type=int, default=2, help="processes of the tests")
    parser.add_argument("--tests", nargs="*", default=[], help="files of tests to run; all by default")
    given = parser.parse_args()
    unknown = [kind for kind in given.kinds if kind not in KINDS]
    if unknown:
        parser.error(f"found {unknown[0]!r}; needed {', '.join(KINDS)}")
    with tempfile.TemporaryDirectory() as held:
        work = Path(held)
        kinds = given.kinds or KINDS
        dist = given.dist or work / "dist"
        if given.dist is None and set(kinds) & {"wheel", "sdist"}:
            build(dist)
        for kind in kinds:
            if kind == "crate":
                check_crate(work)
            else:
                check_package(kind, dist.resolve(), work, ["-n", str(given.jobs), "--dist", "loadfile", *given.tests])
            print(f"{kind}: passed", flush=True)


def build(dist: Path) -> None:
    """The wheel and the source distribution."""
    run(["maturin", "build", "--release", "--locked", "--out", str(dist)], ROOT)
    run(["maturin", "sdist", "--out", str(dist)], ROOT)


def check_package(kind: str, dist: Path, work: Path, tests: list[str]) -> None:
    """Install a wheel or an sdist into an empty environment; run the demo and the tests from there."""
    source = unpacked(only(dist, "*.tar.gz"), work / f"{kind}-source")
    environment = work / f"{kind}-environment"
    run([sys.executable, "-m", "venv", str(environment)], work)
    folder = environment / ("Scripts" if os.name == "nt" else "bin")
    package = only(dist, "*.whl" if kind == "wheel" else "*.tar.gz")
    variables = {**os.environ, "PATH": path_without_rust() if kind == "wheel" else os.environ["PATH"]}
    run([str(folder / "python"), "-m", "pip", "install", "--quiet", f"{package}[test]"], work, variables)
    where = output([str(folder / "python"), "-c", "import regionpose; print(regionpose.__file__)"], work)
    if environment not in Path(where).parents:
        raise SystemExit(f"regionpose is imported from {where}; needed the one in {environment}")
    run([str(folder / "regionpose"), "demo", "--out", str(work / f"{kind}-demo")], work, variables)
    run([str(folder / "python"), "-m", "pytest", *tests], source, variables)


def check_crate(work: Path) -> None:
    """Pack the crate, and test what is in the packet."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    # Its tests build it: no need to have it built as it is packed.
    run(["cargo", "package", "--package", "regionpose", "--no-verify", "--locked", "--allow-dirty"], ROOT)
    packed = max((target / "package").glob("regionpose-*.crate"), key=lambda path: path.stat().st_mtime)
    run(["cargo", "test", "--quiet"], unpacked(packed, work / "crate-source"))


def only(folder: Path, pattern: str) -> Path:
    """The one file of that name."""
    found = sorted(folder.glob(pattern))
    if len(found) != 1:
        raise SystemExit(f"{folder} holds {len(found)} files {pattern}; needed one")
    return found[0]


def unpacked(archive: Path, folder: Path) -> Path:
    """The folder in an archive, unpacked."""
    with tarfile.open(archive) as held:
        held.extractall(folder, filter="data")
    (inner,) = folder.iterdir()
    return inner


def path_without_rust() -> str:
    """PATH without the folders that hold Rust's tools."""
    folders = os.environ["PATH"].split(os.pathsep)
    return os.pathsep.join(
        folder for folder in folders if not any(shutil.which(tool, path=folder) for tool in RUST_TOOLS)
    )


def run(command: list[str], folder: Path, variables: dict[str, str] | None = None) -> None:
    """Run a command in a folder; its failure ends the check."""
    print(f"$ {' '.join(command)}", flush=True)
    if subprocess.run(command, cwd=folder, env=variables, check=False).returncode != 0:
        raise SystemExit(f"failed: {' '.join(command)}")


def output(command: list[str], folder: Path) -> str:
    """What a command prints."""
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout.strip()


if __name__ == "__main__":
    main()
