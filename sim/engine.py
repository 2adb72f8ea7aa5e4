"""Whole frames through an exported core, compiled by `sim.compiler` and driven over AXI4-Stream.

A stream is an array of `BEAT`s.

    core = compile_core("build/rectifier.v", "rectifier")
    run = core.run(to_beats(frames, line_gap=20), idle=0.2, backpressure=0.3, seed=1)
    rectified = to_frames(run.beats, 640, 480)
"""

import ctypes
import enum
import weakref
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from sim.beats import BEAT, StreamError, to_beats

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


def _pauses(name: str, share: float, burst: float | None) -> tuple[int, int]:
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

    def __init__(self, library: Path, cached: bool) -> None:
        self.library, self.cached = library, cached
        self._code = ctypes.CDLL(str(library))
        self._code.bench_new.restype = ctypes.c_void_p
        for function in (self._code.bench_delete, self._code.bench_in_bits, self._code.bench_out_bits):
            function.argtypes = [ctypes.c_void_p]
        self._code.bench_run.argtypes = [ctypes.c_void_p, ctypes.POINTER(_Job)]
        self._power_up()
        self.in_bits = self._code.bench_in_bits(self._bench)
        self.out_bits = self._code.bench_out_bits(self._bench)

    def _power_up(self) -> None:
        self._bench = self._code.bench_new()
        self._release = weakref.finalize(self, self._code.bench_delete, self._bench)
        self._complete = False

    def run(
        self,
        stream: np.ndarray,
        *,
        idle: float = 0.0,
        backpressure: float = 0.0,
        burst: float | None = None,
        seed: int = 0,
        start: Literal["power-up", "reset", "continue"] = "power-up",
        expected: int | None = None,
        watchdog: int = 10_000,
        settle: int = 64,
        reset_cycles: int = 16,
        check: bool = True,
    ) -> Run:
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


def _refuse(run: Run, job: _Job) -> None:
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
