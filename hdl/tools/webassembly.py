"""Where the programs that we run, which are WebAssembly, keep what they are compiled to."""

import os
import tempfile
from pathlib import Path

import platformdirs

VARIABLE = "YOWASP_CACHE_DIR"


def environment():
    """The environment to run them in, in any folder: `VARIABLE`, if set, moves the caches of all of them."""
    moved = os.environ.get(VARIABLE)
    if not moved:
        return dict(os.environ)
    # Amaranth's Yosys knows no variable of its own.
    return {**os.environ, **dict.fromkeys((VARIABLE, "XDG_CACHE_HOME"), str(Path(moved).absolute()))}


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
