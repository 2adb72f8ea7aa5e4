"""What all command lines share: frame sizes, error reporting, progress."""

import errno
import io
import re
import signal
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

from hdl import files
from hdl.errors import InputError, ToolError

_UNWRITTEN = (errno.ENOSPC, errno.EIO, errno.EDQUOT, errno.EFBIG)

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


class FileType(click.Path):
    """A file to write to; raises InputError, before any work is done, where that will not be possible.

    Parameters
    ----------
    suffixes : sequence of str
        The ends of names that there are, with their dots; empty: any.
    """

    def __init__(self, suffixes=()):
        super().__init__(path_type=Path)
        self._suffixes = suffixes

    def convert(self, value, param, ctx):
        _refuse_empty(value, param)
        file = super().convert(value, param, ctx)
        files.check_targets(param.opts[0], [file], suffixes=self._suffixes)
        return file


class FolderType(click.Path):
    """A folder to write to, which need not exist; raises InputError, before any work is done, where that will not be
    possible, and for an empty name, as an unset variable leaves."""

    def __init__(self):
        super().__init__(path_type=Path)

    def convert(self, value, param, ctx):
        _refuse_empty(value, param, "; . is the folder here")
        folder = super().convert(value, param, ctx)
        files.check_folder(param.opts[0], folder)
        return folder


def _refuse_empty(value, param, instead=""):
    if value == "":
        raise InputError(param.opts[0], None, None, f"an empty name{instead}")


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
    if callable(signal.getsignal(signal.SIGINT)):  # `hdl.exit_when_interrupted`'s, if any
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of files that the terminal has no letters for
    try:
        status = command.main(arguments, standalone_mode=False)
        if sys.stdout:
            sys.stdout.flush()
        sys.exit(status or 0)
    except click.ClickException as error:
        _fail(error.format_message())
    except InputError as error:
        _fail(str(error))
    except OSError as error:
        # All files that are written are named.
        where = error.filename or ("standard output" if error.errno in _UNWRITTEN else None)
        _fail(f"{where}: {error.strerror}" if where else str(error))
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
        SpinnerColumn("dots" if console.encoding.startswith("utf") else "line"),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("", total=None)
        yield lambda step: progress.reset(task, description=step, total=None)
