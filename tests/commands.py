"""Command lines, run in this process as the shell runs them."""

import pytest

from hdl.cli import run


def ended(capsys, command, *arguments):
    """Exit status, standard output and standard error of a click command."""
    with pytest.raises(SystemExit) as end:
        run(command, list(map(str, arguments)))
    return end.value.code, *capsys.readouterr()
