"""What all command lines share: frame sizes, error reporting, progress."""

import re
import sys
from contextlib import contextmanager

import rich_click as click
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from hdl.coordinates import Border
from hdl.errors import InputError

LEAST_SIZE, GREATEST_SIZE = 32, 8192


class SizeType(click.ParamType):
    """WIDTHxHEIGHT in px."""

    name = "WxH"

    def convert(self, value, param, ctx):
        match = re.fullmatch(r"([0-9]{1,6})[xX]([0-9]{1,6})", value) if isinstance(value, str) else None
        if not match:
            raise InputError("--size", None, value, "must be WIDTHxHEIGHT, for example 640x480")
        size = tuple(int(number) for number in match.groups())
        if not all(LEAST_SIZE <= number <= GREATEST_SIZE for number in size):
            raise InputError("--size", None, value, f"width and height must be {LEAST_SIZE} to {GREATEST_SIZE}")
        return size


class BorderType(click.ParamType):
    """constant, constant:VALUE or replicate."""

    name = "constant[:V]|replicate"

    def convert(self, value, param, ctx):
        return value if isinstance(value, Border) else Border.parse(value)


def run(command):
    """Run a click command; anything wrong with the input is one line on stderr and exit status 2."""
    try:
        sys.exit(command.main(standalone_mode=False) or 0)
    except click.ClickException as error:
        _fail(error.format_message())
    except (InputError, OSError) as error:
        _fail(str(error))
    except (click.Abort, KeyboardInterrupt):
        Console(stderr=True).print("interrupted")
        sys.exit(130)


def _fail(message):
    Console(stderr=True, soft_wrap=True, highlight=False).print(
        "[bold red]error:[/]", " ".join(message.split()).replace("[", r"\[")
    )
    sys.exit(2)


def camera_table(title, sides, rows):
    """A table with a column for each camera; ``rows``: pairs of a name and one text a camera."""
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column("")
    for side in sides:
        table.add_column(side, justify="right")
    for name, texts in rows:
        table.add_row(name, *texts)
    return table


@contextmanager
def steps():
    """A callable that names the step in progress on a terminal, with the time it takes; silent elsewhere."""
    console = Console(stderr=True)
    with Progress(
        SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), console=console, transient=True,
        disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("", total=None)
        yield lambda step: progress.reset(task, description=step, total=None)
