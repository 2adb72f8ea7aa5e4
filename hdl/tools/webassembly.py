"""Where the programs that we run, which are WebAssembly, keep what they are compiled to."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import platformdirs

from hdl.errors import ToolError

VARIABLE = "YOWASP_CACHE_DIR"


def environment():
    """The environment to run them in, in any folder: `VARIABLE`, if set, moves the caches of all of them."""
    moved = os.environ.get(VARIABLE)
    if not moved:
        return dict(os.environ)
    # Amaranth's Yosys knows no variable of its own.
    return {**os.environ, **dict.fromkeys((VARIABLE, "XDG_CACHE_HOME"), str(Path(moved).absolute()))}


def run(name, start, arguments, directory, log, keep=None):
    """Run a program in ``directory``, where all its files must be: it sees no others.

    Parameters
    ----------
    name : str
        Of the program, for messages.
    start : str
        The Python that starts it; there is no executable to rely on, since it need not be on the PATH.
    arguments : list of str
    directory : Path
    log : str
        The file in ``directory`` that it writes its log to.
    keep : Path or None
        Where to put the log of a run that fails.

    Raises
    ------
    ToolError
        With the program's own error line and the log's path.
    """
    process = subprocess.run(
        [sys.executable, "-c", start, *arguments],
        cwd=directory,
        env=environment(),
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
    if process.returncode:
        log = directory / log
        if keep and log.exists():
            log = log.replace(keep)
        where = f" (log: {log})" if log.exists() else ""
        raise ToolError(f"{name}: {problem(process.stdout + process.stderr)}{where}")


def problem(output):
    """What is wrong, in one line, of a run that failed: an error of the program, or else a cache that it cannot write.

    ``output``: str, what it printed.
    """
    lines = output.strip().splitlines()
    error = next((line for line in lines if "ERROR" in line), None)
    if error:
        return error
    last = lines[-1].strip() if lines else "no message"
    moved = os.environ.get(VARIABLE)
    folders = [Path(moved)] if moved else [Path(platformdirs.user_cache_dir(name)) for name in ("YoWASP", "wasmtime")]
    for folder in folders:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(bytes(1 << 16))
        except OSError as refusal:
            return f"its cache, {folder}, cannot be written: {refusal.strerror}; set {VARIABLE} to another folder"
    return last
