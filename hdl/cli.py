"""What all command lines share: frame sizes, error reporting, progress."""

import re
import sys
import warnings
from contextlib import contextmanager
from pathlib import Path

import rich_click as click
from amaranth.hdl import UnusedElaboratable
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from hdl.coordinates import Border
from hdl.errors import InputError, ToolError
from hdl.rectification import RectificationOptions

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


class FolderType(click.Path):
    """A folder to write to, which need not exist; raises InputError for an empty name, as an unset variable leaves."""

    def __init__(self):
        super().__init__(path_type=Path, file_okay=False)

    def convert(self, value, param, ctx):
        if value == "":
            raise InputError("--output", None, None, "an empty name; . is the folder here")
        return super().convert(value, param, ctx)


class CenterType(click.ParamType):
    """X,Y in px."""

    name = "X,Y"

    def convert(self, value, param, ctx):
        if not isinstance(value, str):
            return value
        try:
            x, y = (float(part) for part in value.split(","))
        except ValueError:
            raise InputError("--center", None, value, "must be X,Y in px, for example 319.5,239.5") from None
        return x, y


class BorderType(click.ParamType):
    """constant, constant:VALUE or replicate."""

    name = "constant[:V]|replicate"

    def convert(self, value, param, ctx):
        return value if isinstance(value, Border) else Border.parse(value)


def rectification_options(command):
    """The options of a command that rectifies; together they are the arguments of `RectificationOptions`."""
    for option in reversed(
        (
            click.option(
                "--alpha",
                type=float,
                metavar="A",
                help="cv2.stereoRectify's alpha: 0 shows valid pixels only, 1 all source pixels. Default: 0. With "
                "any of --alpha, --focal, --fov, --center a rectification in the file is not used.",
            ),
            click.option("--focal", type=float, metavar="PX", help="Focal length of the rectified views."),
            click.option("--fov", type=float, metavar="DEG", help="Horizontal field of view, in place of --focal."),
            click.option("--center", type=CenterType(), help="Principal point of both rectified views, px."),
            click.option(
                "--minimise",
                type=click.Choice(["rows"]),
                help="Choose what is left free (rotation about the baseline, row of the principal point, focal "
                "length) so that the line buffers have the fewest rows.",
            ),
            click.option(
                "--max-fov-loss",
                type=float,
                default=RectificationOptions.max_fov_loss,
                show_default=True,
                metavar="SHARE",
                help="Field of view, filled frame or focal length that --minimise may give up.",
            ),
        )
    ):
        command = option(command)
    return command


def note(text):
    """Print one line on stderr that begins with ``note:``."""
    _print_line("note:", "bold", text)


def _print_line(label, style, text):
    line = Text.assemble((label, style), " ", " ".join(text.split()))
    Console(stderr=True, soft_wrap=True, highlight=False, emoji=False).print(line)


def run(command, arguments=None):
    """Run a click command; anything wrong with the input is one line on stderr and exit status 2, a tool that
    fails one with status 1.

    ``arguments``: list of str; default: the process's own.
    """
    warnings.simplefilter("ignore", UnusedElaboratable)  # of what an interruption leaves half built
    try:
        sys.exit(command.main(arguments, standalone_mode=False) or 0)
    except click.ClickException as error:
        _fail(error.format_message())
    except InputError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    except ToolError as error:
        _fail(str(error), status=1)
    except MemoryError:
        _fail("not enough memory for this frame size", status=1)
    except (click.Abort, KeyboardInterrupt):
        Console(stderr=True).print("interrupted")
        sys.exit(130)


def _fail(message, status=2):
    _print_line("error:", "bold red", message)
    sys.exit(status)


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
        SpinnerColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("", total=None)
        yield lambda step: progress.reset(task, description=step, total=None)
