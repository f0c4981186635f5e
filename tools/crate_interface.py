"""The crate's public interface as text, read from its sources; `tests/rust/interface.txt` holds it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

CRATE = Path(__file__).resolve().parents[1] / "rust" / "src"
OPEN_MODULES = ("mesh", "moments")
"""Modules that are public as a whole."""

ITEM = re.compile(r"(?<!#\[doc\(hidden\)\]\n)^pub (?:const )?(?:fn|struct|enum|trait|type|const) (\w+)", re.MULTILINE)
METHOD = re.compile(
    r"((?:^    #\[[^\n]*\]\n)*)^    (pub (?:const )?fn .*?)(?: \{$| \{ [^\n]*\}$|;$)", re.MULTILINE | re.DOTALL
)


def without_comments(code: str) -> str:
    """Rust code without comments and unit tests."""
    code = re.sub(r"^\s*//.*\n", "", code.partition("#[cfg(test)]\nmod tests")[0], flags=re.MULTILINE)
    return re.sub(r"^( *)#\[\w+\(\n.*?^\1\)\]\n", "", code, flags=re.MULTILINE | re.DOTALL)


def sources() -> dict[str, str]:
    """The code of each file by its path without the ending."""
    files = sorted(CRATE.glob("**/*.rs"))
    return {
        file.relative_to(CRATE).with_suffix("").as_posix().removesuffix("/mod"): without_comments(
            file.read_text(encoding="utf-8")
        )
        for file in files
    }


def root_exports(code: str) -> Iterable[tuple[str, str]]:
    """Module and name of what `lib.rs` exports from the crate's own modules."""
    for path, group, single in re.findall(r"^pub use ([\w:]+)::(?:\{(.*?)\}|(\w+));", code, re.MULTILINE | re.DOTALL):
        yield from ((path.replace("::", "/"), name.strip()) for name in (group or single).split(",") if name.strip())


def definition(code: str, name: str) -> str:
    """An item's head, with public fields of a struct and variants of an enum."""
    start = next(match.start() for match in ITEM.finditer(code) if match[1] == name)
    text = code[start:]
    if re.match(r"pub (struct|enum|trait)", text) and "{" in text.partition("\n")[0]:
        head, *body = text[: text.index("\n}")].split("\n")
        shown = body if head.startswith(("pub enum", "pub trait")) else [line for line in body if "    pub " in line]
        return "\n".join([head, *(line for line in shown if line.strip() and "#[" not in line), "}"])
    end = r" \{$|;$" if "fn " in text.partition("\n")[0] else r" = |;$"
    return one_line(re.split(end, text, maxsplit=1, flags=re.MULTILINE)[0])


def methods(codes: Iterable[str], name: str) -> Iterable[str]:
    """Signatures of a type's documented methods and the traits written out for it."""
    for code in codes:
        for block in re.findall(
            rf"^impl(?:<[^\n]*?>)? (?:[^\n]* for )?{name}\b[^\n]*\{{\n.*?^\}}", code, re.MULTILINE | re.DOTALL
        ):
            head = block.partition(" {\n")[0]
            if " for " in head:
                yield head
            found = METHOD.findall(block)
            yield from (
                f"    {one_line(signature)}" for attributes, signature in found if "doc(hidden)" not in attributes
            )


def one_line(signature: str) -> str:
    """A signature that is spread over lines, on one."""
    text = re.sub(r"\s+", " ", signature).strip()
    return re.sub(r"\( ", "(", re.sub(r",? \)", ")", text))


def interface() -> str:
    """Every public item, module by module, with its methods."""
    files = sources()
    found = [(module, name) for module, name in root_exports(files["lib"])]
    for module in OPEN_MODULES:
        own = [file for file in files if file.split("/")[0] == module]
        found.extend((file, name) for file in own for name in ITEM.findall(files[file]))
    parts = []
    for module, name in sorted(set(found), key=lambda item: (item[0].split("/")[0] in OPEN_MODULES, item[1], item[0])):
        # A module may hand on what one of its files defines.
        place = next(file for file in files if file.startswith(module) and name in ITEM.findall(files[file]))
        # Another type of the same name has methods of its own.
        codes = (code for file, code in files.items() if file == place or name not in ITEM.findall(code))
        parts.append("\n".join([definition(files[place], name), *methods(codes, name)]))
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    print(interface(), end="")
