"""What the site adds to Sphinx: the help of every command, links to folders as their names, and tables as CSV files."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import click
import typer
from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx.util.docutils import SphinxDirective

if TYPE_CHECKING:
    from sphinx.application import Sphinx

WIDTH = 100
"""Columns of a help text: what a page shows without scrolling."""


FOLDER_LINK = re.compile(r"\[([^\]]+)\]\((\.\./[\w./-]+)\)")
"""A link of a document to a place outside of the documents."""


def name_folders(app: Sphinx, page: str, source: list[str]) -> None:
    """Links to folders of the checkout, which a site doesn't hold, become their names."""
    here = Path(app.srcdir, page).parent
    source[0] = FOLDER_LINK.sub(lambda link: f"`{link[1]}`" if (here / link[2]).is_dir() else link[0], source[0])


def command_helps() -> dict[str, str]:
    """The help of every command by its name, the program's own first."""
    from regionpose.cli.app import app

    root = typer.main.get_command(app)
    helps = {"regionpose": _help_of(root, None, "regionpose")}
    parent = click.Context(root, info_name="regionpose")
    for name in root.list_commands(parent):  # type: ignore[attr-defined]
        helps[name] = _help_of(root.get_command(parent, name), parent, name)  # type: ignore[attr-defined]
    return helps


def _help_of(command: click.Command, parent: click.Context | None, name: str) -> str:
    context = click.Context(command, info_name=name, parent=parent, max_content_width=WIDTH, terminal_width=WIDTH)
    return command.get_help(context)


class CommandHelp(SphinxDirective):
    """`regionpose-commands`: a section with the help of each command."""

    has_content = False
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        """One section for each command."""
        return [self._section(name, text) for name, text in command_helps().items()]

    def _section(self, name: str, text: str) -> nodes.section:
        title = name if name == "regionpose" else f"regionpose {name}"
        section = nodes.section(ids=[nodes.make_id(title)], names=[title])
        section += nodes.title(text=title)
        section += nodes.literal_block(text, text, language="text")
        return section


class TableFiles(SphinxPostTransform):
    """Each table of the measurements as a CSV file beside the page, with a link below it."""

    default_priority = 200
    builders = ("html",)
    pages: ClassVar[tuple[str, ...]] = ("results", "results/measurements")

    def run(self, **_: Any) -> None:
        """Write the files of a page that has them."""
        page = self.env.docname
        if page not in self.pages:
            return
        folder = Path(self.app.outdir, "results", "tables")
        folder.mkdir(parents=True, exist_ok=True)
        prefix = "" if page.startswith("results/") else "results/"
        for number, table in enumerate(list(self.document.findall(nodes.table)), start=1):
            name = f"{Path(page).name}-{_section_of(table)}-{number}.csv"
            (folder / name).write_text(table_text(table), encoding="utf-8")
            link = f'<p class="table-file"><a href="{prefix}tables/{name}" download>CSV</a></p>'
            table.parent.insert(table.parent.index(table) + 1, nodes.raw("", link, format="html"))


def _section_of(table: nodes.table) -> str:
    """The id of the section that holds a table."""
    around = table.parent
    while not isinstance(around, nodes.section):
        around = around.parent
    return str(around["ids"][0])


def table_text(table: nodes.table) -> str:
    """A table as CSV, its heads first."""
    held = io.StringIO()
    csv.writer(held, lineterminator="\n").writerows(
        [entry.astext() for entry in row.findall(nodes.entry)] for row in table.findall(nodes.row)
    )
    return held.getvalue()


def setup(app: Sphinx) -> dict[str, bool]:
    """Register them."""
    app.add_directive("regionpose-commands", CommandHelp)
    app.add_post_transform(TableFiles)
    app.connect("source-read", name_folders)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
