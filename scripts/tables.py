"""What the scripts that measure share: options, and tables on the terminal."""

import json
from pathlib import Path

import rich_click as click
from rich.console import Console
from rich.table import Table

from hdl import files
from hdl.cli import FileType, FolderType

WIDTH = 160  # columns, where there is no terminal that has its own

json_option = click.option(
    "--json",
    "json_file",
    type=FileType(),
    metavar="FILE",
    help="Write the rows to FILE.",
)

cache_option = click.option(
    "--cache",
    type=FolderType(),
    default=Path("build/cache"),
    show_default=True,
    help="Where results of synthesis are kept.",
)


def write_json(file, rows):
    """Write ``rows`` to ``file``, unless it is None."""
    if file:
        files.write({file: json.dumps(rows, indent=2, allow_nan=False) + "\n"})


def show(title, headings, rows, texts=1):
    """Print a table; ``rows`` are texts, the first ``texts`` columns to the left, the others to the right."""
    table = Table(title=title, title_justify="left")
    for index, heading in enumerate(headings):
        table.add_column(heading, justify="left" if index < texts else "right")
    for row in rows:
        table.add_row(*map(str, row))
    Console(width=None if Console().is_terminal else WIDTH).print(table)
