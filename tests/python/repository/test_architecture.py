"""Modules depend one way only, as `docs/architecture.md` draws it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
CRATE = ROOT / "rust" / "src"
BINDINGS = ROOT / "rust" / "bindings" / "src"
PACKAGE = ROOT / "python" / "regionpose"
DOCUMENT = ROOT / "docs" / "architecture.md"

Uses = dict[str, set[str]]

CRATE_LAYERS: tuple[tuple[str, ...], ...] = (
    ("math", "noise"),
    ("budget", "error"),
    ("batch", "geometry", "moments"),
    ("mesh", "prior", "region"),
    ("options",),
    ("view",),
    ("equations",),
    ("contour",),
    ("samples",),
    ("problem",),
    ("search",),
    ("verdict",),
    ("alignment",),
)
"""Folders and files of the crate; each uses those of the layers before its own only."""

PACKAGE_LAYERS: tuple[tuple[str, ...], ...] = (
    ("_core",),
    ("progress", "validation"),
    ("geometry",),
    ("cameras", "kernels"),
    ("regions",),
    ("io",),
    ("segment", "solve"),
    ("alignment", "fusion"),
    ("viz",),
    ("scene",),
    ("app",),
    ("__init__",),
    ("datasets",),
    ("cli",),
    ("__main__",),
)
"""Modules of the Python package, the compiled one first."""

KNOWS_NO_POSE = (
    "equations/derivatives.rs",
    "equations/system.rs",
    "equations/whitening.rs",
    "geometry/clipping.rs",
    "geometry/overlap.rs",
    "geometry/rings",
    "mesh",
    "moments",
    "region",
    "region.rs",
    "view",
)
"""Files and folders of the crate that a change of the pose's form leaves alone."""

SOLE_USERS = {
    "libm": {"math"},
    "pulp": {"math"},
    "rayon": {"batch"},
    "robust": {"geometry"},
    "spade": {"mesh"},
}
"""Crates that one module hides from the others."""

PYTHON_CRATES = {"numpy", "pyo3"}


def code_of(file: Path) -> str:
    """A Rust file without comments and unit tests."""
    code = re.sub(r"//.*", "", file.read_text(encoding="utf-8"))
    return code.partition("#[cfg(test)]")[0]


def rust_modules(folder: Path) -> dict[str, str]:
    """Code of the top modules of a crate, files of a module's folder joined to it."""
    modules: dict[str, str] = {}
    for file in sorted(folder.glob("**/*.rs")):
        name = file.relative_to(folder).parts[0].removesuffix(".rs")
        modules[name] = modules.get(name, "") + code_of(file)
    modules.pop("lib", None)
    return modules


def own_uses(modules: dict[str, str], crate: str = "crate") -> Uses:
    """The other modules that each module names by `crate::`."""
    return {name: named_after(code, crate) - {name} for name, code in modules.items()}


def named_after(code: str, crate: str) -> set[str]:
    """First names after `crate::`, those in braces too."""
    single = re.findall(rf"\b{crate}::(\w+)", code)
    groups = re.findall(rf"\b{crate}::\{{(.*?)\}};", code, re.DOTALL)
    grouped = [re.split(r"::|\s", item.strip())[0] for group in groups for item in without_nested(group).split(",")]
    return {name for name in [*single, *grouped] if name}


def without_nested(group: str) -> str:
    """The items of a use group without the groups inside them."""
    while "{" in group:
        group = re.sub(r"\{[^{}]*\}", "", group)
    return group


def crate_file_uses(folder: Path) -> Uses:
    """The other files that each file of a crate uses, by their paths without the ending."""
    code = {module_path(file.relative_to(folder)): code_of(file) for file in folder.glob("**/*.rs")}
    return {
        name: {used for path in paths_in(text) if (used := file_of(absolute(path, name), set(code)))} - {name, ""}
        for name, text in code.items()
    }


def module_path(file: Path) -> str:
    """A file's place in the tree of modules: `view/mask` of `view/mask/mod.rs`."""
    return file.with_suffix("").as_posix().removesuffix("/mod")


def paths_in(code: str) -> Iterable[list[str]]:
    """Paths that Rust code names from `crate`, `super`, `self` or a module that it declares."""
    heads = "|".join(["crate", "super", "self", *re.findall(r"\bmod (\w+);", code)])
    for used in re.findall(rf"\buse ((?:{heads})::[^;]*);", code):
        yield from ungrouped(used)
    for path in re.findall(rf"(?<![\w:])(?:{heads})(?:::\w+)+", re.sub(r"\buse [^;]*;", "", code)):
        yield path.split("::")


def ungrouped(use: str) -> Iterable[list[str]]:
    """The paths of a use with groups in braces."""
    group = re.search(r"\{([^{}]*)\}", use)
    if group is None:
        yield [part.split()[0] for part in use.split("::") if part.strip()]
        return
    for item in group[1].split(","):
        if item.strip():
            yield from ungrouped(use[: group.start()] + item.strip() + use[group.end() :])


def absolute(path: list[str], name: str) -> list[str]:
    """A path from the crate's root, of one that the file at `name` names."""
    if path[0] == "crate":
        return path[1:]
    above = [*name.split("/"), *path]
    while "super" in above:
        place = above.index("super")
        del above[place - 1 : place + 1]
    return [part for part in above if part != "self"]


def file_of(path: list[str], files: set[str]) -> str:
    """The file that holds an item's path; empty for none."""
    while path and "/".join(path) not in files:
        path = path[:-1]
    return "/".join(path)


def package_file_uses(folder: Path) -> Uses:
    """The other files that each file of the package imports, by dotted names."""
    trees = {
        dotted(file.relative_to(folder.parent)): (file, ast.parse(file.read_text(encoding="utf-8")))
        for file in folder.glob("**/*.py")
    }
    uses: Uses = {}
    for name, (file, tree) in trees.items():
        inside = name if file.name == "__init__.py" else name.rpartition(".")[0]
        used = {file_of(path.split("."), {n.replace(".", "/") for n in trees}) for path in imports_of(tree, inside)}
        uses[name] = {path.replace("/", ".") for path in used} - {name, "", "regionpose"}
    return uses


def dotted(file: Path) -> str:
    """The module name of a file."""
    return ".".join(file.with_suffix("").parts).removesuffix(".__init__")


def imports_of(tree: ast.Module, inside: str) -> Iterable[str]:
    """Dotted names that a file in the package `inside` imports."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parts = inside.split(".")
            above = parts[: len(parts) + 1 - node.level] if node.level else []
            base = [*above, *([node.module] if node.module else [])]
            yield from (".".join([*base, alias.name]) for alias in node.names)


def in_circles(uses: Uses) -> list[str]:
    """What uses itself by way of others."""
    return sorted(name for name in uses if name in reached(uses, name))


def reached(uses: Uses, name: str) -> set[str]:
    """All that something uses, directly or by way of others."""
    found: set[str] = set()
    ahead = [*uses[name]]
    while ahead:
        used = ahead.pop()
        if used not in found:
            found.add(used)
            ahead.extend(uses[used])
    return found


def package_uses(folder: Path) -> Uses:
    """The other modules that each module or subpackage of the Python package imports, anywhere in a file."""
    uses: Uses = {}
    for file in sorted(folder.glob("**/*.py")):
        parts = file.relative_to(folder).with_suffix("").parts
        uses.setdefault(parts[0], set()).update(imported(ast.parse(file.read_text(encoding="utf-8")), parts))
    modules = {*uses, "_core"}
    return {name: {use if use in modules else "__init__" for use in used} - {name} for name, used in uses.items()}


def imported(tree: ast.Module, parts: tuple[str, ...]) -> Iterable[str]:
    """Names that a file at `parts` imports from the package; `__init__` for the package itself."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (first_module(alias.name) for alias in node.names if in_package(alias.name))
        elif isinstance(node, ast.ImportFrom):
            above = ("regionpose", *parts)[: len(parts) + 1 - node.level] if node.level else ()
            base = ".".join([*above, node.module or ""]).strip(".")
            if base == "regionpose":
                yield from (alias.name for alias in node.names)
            elif in_package(base):
                yield first_module(base)


def in_package(name: str) -> bool:
    """Whether a dotted name is the package or in it."""
    return name.split(".")[0] == "regionpose"


def first_module(name: str) -> str:
    """The module below the package in a dotted name."""
    return [*name.split("."), "__init__"][1]


def violations(uses: Uses, layers: tuple[tuple[str, ...], ...]) -> list[str]:
    """What breaks the rule, in words."""
    level = {name: index for index, layer in enumerate(layers) for name in layer}
    broken = [f"{name} is in no layer" for name in sorted(uses) if name not in level]
    for name in sorted(set(uses) & set(level)):
        for used in sorted(uses[name]):
            if level.get(used, len(layers)) >= level[name]:
                broken.append(f"{name} uses {used}, which is not in a layer before its own")
    return broken


def test_each_module_of_the_crate_uses_the_layers_before_its_own_only() -> None:
    uses = own_uses(rust_modules(CRATE))
    assert "view" in uses["equations"], "the parser misses uses"
    assert violations(uses, CRATE_LAYERS) == []


def test_each_module_of_the_package_imports_the_layers_before_its_own_only() -> None:
    uses = package_uses(PACKAGE)
    assert "regions" in uses["solve"], "the parser misses imports"
    assert violations(uses, PACKAGE_LAYERS) == []


def test_the_files_of_the_crate_use_one_another_in_no_circles() -> None:
    uses = crate_file_uses(CRATE)
    assert "contour/mixture" in uses["contour/fit"] and "geometry/rings/ring" in uses["geometry/rings/nesting"]
    assert in_circles(uses) == []


def test_the_files_of_the_package_import_one_another_in_no_circles() -> None:
    uses = package_file_uses(PACKAGE)
    assert "regionpose.solve.prior" in uses["regionpose.solve.batch"]
    assert in_circles(uses) == []


@pytest.mark.parametrize("place", KNOWS_NO_POSE)
def test_moments_meshes_and_charts_know_no_pose(place: str) -> None:
    files = [file for file in CRATE.glob("**/*.rs") if file.relative_to(CRATE).as_posix().startswith(place)]
    assert files
    assert [file.name for file in files if "Pose" in code_of(file)] == []


@pytest.mark.parametrize("crate", SOLE_USERS)
def test_one_module_hides_each_larger_dependency(crate: str) -> None:
    users = {name for name, code in rust_modules(CRATE).items() if re.search(rf"\b{crate}::", code)}
    assert users == SOLE_USERS[crate]


def test_the_crate_knows_no_python_and_the_bindings_reach_it_from_outside() -> None:
    for name, code in rust_modules(CRATE).items():
        assert not re.search(rf"\b({'|'.join(PYTHON_CRATES)})::", code), name
    named = named_after("".join(rust_modules(BINDINGS).values()), "regionpose")
    assert {name for name in named if name.islower()} <= {"in_parallel", "internals", "mesh", "moments"}


def test_the_cameras_end_at_bearings() -> None:
    models = re.compile(r"\b(pinhole|fisheye|ocam|unified|distortion)\b", re.IGNORECASE)
    assert [name for name, code in rust_modules(CRATE).items() if models.search(code)] == []


def test_the_document_draws_the_same_layers() -> None:
    drawn = re.findall(r"^```text\n(.*?)^```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    layers = [tuple(tuple(line.split(", ")) for line in block.splitlines()) for block in drawn]
    assert layers == [CRATE_LAYERS, PACKAGE_LAYERS]


def test_uses_in_braces_and_in_paths_are_found_and_comments_are_not() -> None:
    code = "use crate::{pose::{Pose, Tangent}, region};\nlet x = crate::chart::f();\nuse super::math;"
    assert named_after(code, "crate") == {"pose", "region", "chart"}


def test_a_use_of_a_later_layer_of_the_own_layer_or_of_an_unknown_module_is_a_violation() -> None:
    layers = (("a",), ("b", "c"), ("d",))
    assert violations({"b": {"a"}, "d": {"a", "b"}}, layers) == []
    assert len(violations({"a": {"d"}, "b": {"c"}, "e": {"a"}, "d": {"e"}}, layers)) == 4


def test_paths_from_parents_and_declared_modules_are_found() -> None:
    code = "mod inner;\nuse super::{other::{Thing, more::f}, Type};\nuse inner::g;\nlet x = self::deep::h();"
    paths = {"/".join(absolute(path, "folder/file")) for path in paths_in(code)}
    inner, outer = {"folder/file/deep/h", "folder/file/inner/g"}, {"folder/Type", "folder/other/Thing"}
    assert paths == {*inner, *outer, "folder/other/more/f"}


def test_a_circle_is_found_and_a_common_use_is_none() -> None:
    assert in_circles({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []
    assert in_circles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c"]


def test_absolute_relative_and_inner_imports_are_found() -> None:
    inner = "def f():\n    from ..pose import Pose\n"
    source = f"import regionpose.cameras.base\nfrom regionpose import _core\n{inner}import numpy"
    assert set(imported(ast.parse(source), ("scene", "file"))) == {"cameras", "_core", "pose"}
    assert set(imported(ast.parse("import regionpose as rp"), ("cli",))) == {"__init__"}
