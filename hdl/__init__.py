"""Stereo rectification cores: from a calibration file to Verilog."""

import os
import signal
import sys

__version__ = "0.1.0"

# Amaranth prefers any Yosys on the PATH over the one it is pinned with; another version writes other Verilog.
os.environ["AMARANTH_USE_YOSYS"] = "builtin"


def exit_when_interrupted() -> None:
    """From here on SIGINT ends the process with status 130 and one line.

    A command spends its first second importing, where an interruption would come out as a traceback, or as somebody's
    failed import. There is nothing to clean up yet. `hdl.cli.run` takes over.
    """

    def end(number: int, frame: object) -> None:
        os.write(2, b"interrupted\n")
        os._exit(130)

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, end)


# `python -m hdl.generate` imports this first.
if sys.argv[:1] == ["-m"] and any(
    word.removeprefix("-m").startswith(("hdl.", "sim.", "scripts.")) for word in sys.orig_argv
):
    exit_when_interrupted()
