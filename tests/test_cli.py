"""What every command does about interruptions, and about terminals and pipes that take less than they should."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PRINT = "import click; from hdl.cli import run; run(click.Command('print', callback=lambda: print('\\xe4')), [])"


def python(*arguments, stdout=subprocess.PIPE, path=(), **environment):
    """A CompletedProcess of Python in the project's folder."""
    search = os.pathsep.join([*map(str, path), str(ROOT)])
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        stdout=stdout,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": search, **environment},
        check=False,
    )


@pytest.mark.parametrize("module", ["hdl.generate", "hdl.calibration", "hdl.report", "sim.run", "scripts.picture"])
def test_an_interruption_while_modules_are_imported_is_one_line(tmp_path, module):
    (tmp_path / "numpy.py").write_text(
        "import os, signal, time\n"
        "try:\n"
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    time.sleep(60)\n"
        "except BaseException as error:\n"  # as modules do that try for another one
        "    raise ImportError(error)\n"
    )
    result = python("-m", module, path=[tmp_path])
    assert (result.returncode, result.stdout, result.stderr) == (130, b"", b"interrupted\n")


def test_a_program_that_imports_the_package_keeps_its_own_interruption(tmp_path):
    (tmp_path / "mine.py").write_text(
        "import os, signal, hdl\n"
        "try:\n    os.kill(os.getpid(), signal.SIGINT)\n"
        "except KeyboardInterrupt:\n    print(1)\n"
    )
    assert python("-m", "mine", path=[tmp_path]).stdout == b"1\n"


def test_a_full_disk_behind_standard_output_is_one_line():
    if not Path("/dev/full").exists():
        pytest.skip("there is no /dev/full")
    with open("/dev/full", "wb") as full:
        result = python("-c", PRINT, stdout=full)
    assert (result.returncode, result.stderr) == (2, b"error: standard output: No space left on device\n")


def test_letters_that_a_terminal_does_not_have_are_written_otherwise():
    result = python("-c", PRINT, PYTHONIOENCODING="ascii")
    assert (result.returncode, result.stdout, result.stderr) == (0, b"\\xe4\n", b"")
