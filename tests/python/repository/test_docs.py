"""The documents say what is there: citations, links and examples."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import pytest
import typer
from regionpose.cli.app import app

from benchmarks.synthetic.studies import STUDIES

ROOT = Path(__file__).resolve().parents[3]
MATH = ROOT / "docs" / "math.md"
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("**/*.md"))]
EXAMPLES = ROOT / "examples" / "python"
GALLERY_PAGE = re.compile(r"gallery/(?:images/sphx_glr_)?(\d\d_\w+?)(?:_\d{3}\.png|\.rst)$")
CODE_FOLDERS = ("rust", "python", "tests", "benchmarks", "examples")

NUMBER = r"\d+(?:\.\d+)?"
MENTION = re.compile(r"docs/math\.md`?,")
CITATION = re.compile(rf"docs/math\.md`?,? (?:eqs?\.|sections?) ({NUMBER}(?:(?:, | and | to ){NUMBER})*)")
COMMENT_BREAK = re.compile(r"\s*\n[ \t]*(?:///|//!|//|#)?[ \t]*")
NOT_RUN = re.compile(r"<!-- not run: \S.* -->")
BENCHMARK = re.compile(r"python (?:-m benchmarks(?P<module>(?:\.\w+)*)(?: (?P<study>[a-z]+))?|benchmarks/)")
SUBCOMMANDS = set(typer.main.get_command(app).commands)  # type: ignore[attr-defined]
SUBCOMMAND = re.compile(r"`regionpose ([a-z]+)")


class Block(NamedTuple):
    """A python block of a document and the line before its first."""

    source: str
    line: int


def equations_and_sections(text: str) -> set[str]:
    """Numbers of the tagged equations, `5.2`, and of the sections, `5`."""
    return set(re.findall(r"\\tag\{([\d.]+)\}", text)) | set(re.findall(r"^## (\d+)\. ", text, re.MULTILINE))


def cited_numbers(code: str) -> list[str]:
    """What a source file cites of `docs/math.md`; AssertionError for a citation in another form.

    A mention without a comma points at the whole document and cites nothing.
    """
    joined = COMMENT_BREAK.sub(" ", code)
    citations = CITATION.findall(joined)
    assert len(citations) == len(MENTION.findall(joined)), "a citation of docs/math.md without a section or an equation"
    return [number for citation in citations for number in re.findall(NUMBER, citation)]


def without_code(text: str) -> str:
    """A document without its code and formulas."""
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"`[^`\n]*`|\$[^$\n]+\$", "", prose)


def link_targets(text: str) -> list[str]:
    """Targets of the links and images of a document that are not on the web."""
    targets = re.findall(r"\]\(([^)\s]+)[^)]*\)", without_code(text)) + re.findall(r"(?:src|href)=\"([^\"]+)\"", text)
    return [target for target in targets if not re.match(r"[a-z]+:", target)]


def anchors(text: str) -> set[str]:
    """Names of the headings of a document as GitHub links to them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def is_made_by_the_build(target: str) -> bool:
    """Whether a link leads to a page or a picture that `make docs` makes of an example that is there."""
    made = GALLERY_PAGE.search(target)
    return target.endswith("gallery/index.rst") or (made is not None and (EXAMPLES / f"{made[1]}.py").exists())


def dead_links(document: Path) -> list[str]:
    """The relative links of a document that lead nowhere."""
    dead = []
    for target in link_targets(document.read_text(encoding="utf-8")):
        name, _, anchor = target.partition("#")
        file = document.parent / name if name else document
        named = not anchor or file.suffix != ".md" or (file.exists() and anchor in anchors(file.read_text("utf-8")))
        if not (file.exists() and named) and not is_made_by_the_build(target):
            dead.append(target)
    return dead


def python_blocks(text: str) -> list[Block]:
    """The python blocks of a document that are to be run, in order."""
    lines = text.split("\n")
    blocks = []
    for index, line in enumerate(lines):
        if line.strip() == "```python" and not (index and NOT_RUN.fullmatch(lines[index - 1].strip())):
            end = next(k for k in range(index + 1, len(lines)) if lines[k].strip() == "```")
            blocks.append(Block("\n".join(lines[index + 1 : end]), index + 1))
    return blocks


def relative(path: Path) -> str:
    """A path for a test's name."""
    return path.relative_to(ROOT).as_posix()


def source_files() -> list[Path]:
    """All Rust and Python sources but this one."""
    files = [file for folder in CODE_FOLDERS for file in (ROOT / folder).glob("**/*") if file.suffix in {".rs", ".py"}]
    return sorted(file for file in files if file != Path(__file__).resolve())


def test_equations_are_numbered_one_after_another_within_their_sections() -> None:
    text = MATH.read_text(encoding="utf-8")
    section, equation = 0, 0
    for heading, tag in re.findall(r"^## (\d+)\. |\\tag\{([\d.]+)\}", text, re.MULTILINE):
        if heading:
            section, equation = section + 1, 0
            assert int(heading) == section
        else:
            equation += 1
            assert tag == f"{section}.{equation}"
    assert section > 0


def test_every_citation_of_the_mathematics_names_an_equation_or_section_that_is_there() -> None:
    known = equations_and_sections(MATH.read_text(encoding="utf-8"))
    cited = {(relative(file), number) for file in source_files() for number in cited_numbers(file.read_text("utf-8"))}
    assert len(cited) > 10, "the sources were not found"
    assert not {citation for citation in cited if citation[1] not in known}


def test_references_between_equations_of_the_mathematics_lead_somewhere() -> None:
    text = MATH.read_text(encoding="utf-8")
    known = equations_and_sections(text)
    references = re.findall(r"\((\d+\.\d+)\)", without_code(text)) + re.findall(r"\(section (\d+)\)", text)
    assert references
    assert set(references) <= known


def unknown_commands(text: str) -> list[str]:
    """The commands of a text that are not there: scripts of a package, which are found as modules alone; and modules,
    studies and subcommands of other names.
    """
    text, unknown = COMMENT_BREAK.sub(" ", text), []
    for command in BENCHMARK.finditer(text):
        module, study = command["module"], command["study"]
        place = ROOT / "benchmarks" / Path(*(module or "").split(".")[1:])
        is_there = place.with_suffix(".py").exists() or (place / "__main__.py").exists()
        if module is None or not is_there or (not module and study and study not in STUDIES):
            unknown.append(command[0])
    return unknown + [name for name in SUBCOMMAND.findall(text) if name not in SUBCOMMANDS]


def test_commands_that_reproduce_figures_are_there() -> None:
    files = [*DOCUMENTS, ROOT / "Makefile", *source_files()]
    texts = {relative(file): file.read_text(encoding="utf-8") for file in files}
    assert {name: unknown for name, text in texts.items() if (unknown := unknown_commands(text))} == {}


def test_commands_of_other_names_are_found() -> None:
    modules = "`python benchmarks/speed.py`, `python -m benchmarks.none`, `python -m benchmarks none`"
    assert len(unknown_commands(f"{modules}, `regionpose evaluate x`")) == 4
    assert unknown_commands("`python -m benchmarks.speed`, `python -m benchmarks lidar`, `regionpose pick`") == []


@pytest.mark.parametrize("document", DOCUMENTS, ids=relative)
def test_relative_links_resolve(document: Path) -> None:
    assert dead_links(document) == []


@pytest.mark.slow
@pytest.mark.parametrize("document", DOCUMENTS, ids=relative)
def test_python_blocks_run(document: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = python_blocks(document.read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {"__name__": "__main__"}
    for block in blocks:
        # Empty lines before the source let a traceback name the document's own line.
        exec(compile("\n" * block.line + block.source, relative(document), "exec"), namespace)


def test_a_citation_may_run_over_a_comment_line_and_name_several_equations() -> None:
    code = "/// see (`docs/math.md`,\n    /// sections 2 and 3) and\n# (docs/math.md, eq. 9.2 to\n# 9.5)"
    assert cited_numbers(code) == ["2", "3", "9.2", "9.5"]


def test_a_citation_that_names_no_section_or_equation_is_refused() -> None:
    with pytest.raises(AssertionError, match="without a section"):
        cited_numbers("// as in `docs/math.md`, formula five")
    assert cited_numbers("//! The formulas are derived in docs/math.md.") == []


def test_blocks_marked_as_not_run_and_other_languages_are_left_out() -> None:
    not_run = "<!-- not run: needs a camera -->\n```python\nb\n```\n```bash\nc\n```\n"
    assert python_blocks(f"```python\na = 1\n```\n{not_run}```python\nd = a\n```") == [
        Block("a = 1", 1),
        Block("d = a", 11),
    ]


def test_dead_links_and_anchors_are_found(tmp_path: Path) -> None:
    document = tmp_path / "page.md"
    links = "[a](#a-title-here) [b](#none) [c](page.md) [d](gone.md) [e](https://x.y) `[f](g)`"
    document.write_text(f"# A title, here\n{links}")
    assert dead_links(document) == ["#none", "gone.md"]
