"""From a camera's view and the user's choices to a core: its Verilog and its plan."""

import dataclasses
import hashlib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hdl.arithmetic.cost import GOALS
from hdl.arithmetic.cuts import BALANCED, PIPELINES
from hdl.calibration.rig import SIDES, STRETCH, Rig, stretch
from hdl.core.clock import FAMILIES, reached, shallowest
from hdl.core.line_memory import LineMemoryError, refuse_early
from hdl.core.plan import PLAN_VERSION, Plan
from hdl.core.versions import versions
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import Datapath
from hdl.datapaths.selection import Considered, choose, fit
from hdl.errors import BudgetError, InputError
from hdl.geometry.coordinates import Border
from hdl.geometry.notes import turned
from hdl.geometry.rectification import RectificationOptions, helpful, rectify
from hdl.geometry.row_minimisation import loss
from hdl.geometry.view import View
from hdl.stream.rectifier import PIXEL_FORMATS, Rectifier, RectifierParameters
from hdl.tools import verilog

AUTO = "auto"
# What the first line of a core's Verilog says, after its name.
MARK = ": streaming stereo rectifier,"


@dataclass(frozen=True)
class Options:
    """What the user chooses, besides the calibration; each by its command-line name.

    Parameters
    ----------
    datapath : str
        A key of `DATAPATHS`, or `AUTO`: the cheapest that meets the budget.
    optimise : str
        What `AUTO` saves; a key of `hdl.arithmetic.cost.GOALS`. ``lut`` also makes the pipeline `Pipeline.lean`.
    max_error : float or None
        Largest allowed coordinate error per axis, px.
    pixel_bits, channels, fraction_bits : int
    border : Border
    max_line_buffer_kib : int
        Largest allowed line memory, KiB.
    dsp : bool
        Whether multiplications are left to the synthesis tool, which puts them into DSP blocks; else adders make them.
    pipeline : str
        A key of `PIPELINES`.
    clock : float or None
        MHz that the core must reach: the shallowest pipeline that does is taken in ``pipeline``'s stead.
    family : str
        What FPGA the clock is of; a key of `hdl.core.clock.FAMILIES`.

    Raises
    ------
    InputError
        For a value that an option does not take, under the option's name.
    """

    datapath: str = AUTO
    max_error: float | None = None
    pixel_bits: int = 8
    channels: int = 1
    fraction_bits: int = 5
    border: Border = Border()
    max_line_buffer_kib: int = 4096
    optimise: str = "balanced"
    dsp: bool = True
    pipeline: str = BALANCED.name
    clock: float | None = None
    family: str = "xc7"

    def __post_init__(self) -> None:
        names = (AUTO, *DATAPATHS)
        for option, value, fits, needed in (
            ("--datapath", self.datapath, self.datapath in names, f"one of {', '.join(names)}"),
            ("--optimise", self.optimise, self.optimise in GOALS, f"one of {', '.join(GOALS)}"),
            (
                "--max-error",
                self.max_error,
                self.max_error is None or 0 < self.max_error < math.inf,
                "a positive number of pixels",
            ),
            ("--fraction-bits", self.fraction_bits, 3 <= self.fraction_bits <= 8, "3 to 8"),
            ("--pipeline", self.pipeline, self.pipeline in PIPELINES, f"one of {', '.join(PIPELINES)}"),
            ("--clock", self.clock, self.clock is None or 0 < self.clock < math.inf, "a positive number of MHz"),
            ("--family", self.family, self.family in FAMILIES, f"one of {', '.join(FAMILIES)}"),
            ("--max-line-buffer-kib", self.max_line_buffer_kib, self.max_line_buffer_kib >= 1, "1 or more"),
        ):
            if not fits:
                raise InputError(option, None, value, f"must be {needed}")
        if (self.pixel_bits, self.channels) not in PIXEL_FORMATS:
            problem = "1 channel has 8, 10, 12 or 16 bits, 3 channels have 8 each"
            raise InputError("--pixel-bits", None, f"{self.pixel_bits} for --channels {self.channels}", problem)
        if not 0 <= self.border.value < 2**self.pixel_bits:
            problem = f"does not fit into {self.pixel_bits} bits"
            raise InputError("--border", None, f"constant:{self.border.value}", problem)


@dataclass(frozen=True)
class Core:
    """A finished core.

    Members
    -------
    parameters : RectifierParameters
    exact : (u, v)
        The float64 map that it was built for, px, each (height, width).
    verilog : str
    plan : Plan
    """

    parameters: RectifierParameters
    exact: tuple[np.ndarray, np.ndarray]
    verilog: str
    plan: Plan


def build(view: View, options: Options, top: str, progress: Callable[[str], object] = lambda step: None) -> Core:
    """Build one core.

    Parameters
    ----------
    view : hdl.geometry.rectification.View
    options : Options
    top : str
        Name of the top module.
    progress : callable
        Called with a line of text before each step that may take long.

    Returns
    -------
    Core

    Raises
    ------
    InputError
        Where the budget, the line memory or the frame size cannot be met; a `LineMemoryError` before the datapath is
        fitted, where the map alone tells; and for `refuse_other_size`.
    """
    refuse_other_size(view.fault, view.side, view.source_size, (view.width, view.height))
    progress("exact map")
    exact = view.map()
    refuse_early(view, options)
    considered: list[Considered] = []
    pipeline = PIPELINES[options.pipeline]
    if options.datapath == AUTO:
        asked = options.fraction_bits, options.max_error, options.optimise
        considered = choose(view, *asked, progress, options.dsp, pipeline)
        datapath = considered[0].datapath
        assert datapath  # of all candidates the chosen one has it
    else:
        progress(f"word lengths of {options.datapath}")
        datapath = fit(options.datapath, view, options.fraction_bits, options.max_error, options.dsp)
    clocked = view.lens, view.width, options.family
    if options.clock is not None:
        pipeline = shallowest(options.clock, datapath.name, *clocked)
    clock = reached(datapath.name, pipeline.name, *clocked)
    datapath = datapath.with_pipeline(pipeline.lean if options.optimise == "lut" else pipeline)
    progress("error at every pixel")
    error = datapath.coordinates.error(*exact, view.source_size)
    worst = max(error["u"]["max"], error["v"]["max"])
    if options.max_error is not None and worst > options.max_error:
        raise BudgetError(options.max_error, worst, f"{datapath.name} for the {view.side} camera")
    progress("line buffer")
    try:
        parameters = RectifierParameters(datapath, options.pixel_bits, options.channels, options.border)
    except InputError:
        raise
    except ValueError as problem:  # the frame is too small
        raise InputError("--size", None, f"{view.width}x{view.height}", str(problem)) from problem
    try:
        line_buffer = parameters.line_buffer
    except InputError:
        raise
    except ValueError as problem:  # the map asks for a whole frame
        raise view.fault(*view.geometry, str(problem)) from problem
    kib = line_buffer.bits / 8192
    if kib > options.max_line_buffer_kib:
        raise LineMemoryError(view.side, line_buffer.rows, kib, options.max_line_buffer_kib)
    progress("Verilog")
    text = verilog.convert(Rectifier(parameters), top, header=_header(top, view, datapath, options))
    plan = Plan.sealed(
        plan_version=PLAN_VERSION,
        top=top,
        camera={
            "side": view.side,
            "source": view.entry,
            "model": view.camera.model,
            "K": view.camera.K.tolist(),
            "D": view.camera.D.tolist(),
        },
        rectification={
            "R": view.R.tolist(),
            "P": view.P.tolist(),
            "unit": view.unit,
            "aligned": view.aligned,
            "origin": view.origin,
            "minimised": _minimised(view),
        },
        source=dict(zip(("width", "height"), view.source_size)),
        width=view.width,
        height=view.height,
        lens=view.lens,
        distortion_dropped=None if view.lens else _dropped(view),
        datapath=datapath.name,
        dsp=options.dsp,
        pipeline={"name": pipeline.name, "mhz": clock.mhz, "basis": clock.basis},
        optimise=options.optimise,
        fraction_bits=options.fraction_bits,
        pixel_bits=options.pixel_bits,
        channels=options.channels,
        border={"mode": options.border.mode, "value": options.border.value},
        line_buffer={"rows": line_buffer.rows, "d_lo": line_buffer.window.d_lo, "d_hi": line_buffer.window.d_hi},
        latency_cycles=parameters.latency_cycles,
        formats={name: str(q) for name, q in datapath.formats.items()},
        cost=dataclasses.asdict(datapath.cost),
        max_error_requested=options.max_error,
        error=error,
        considered=[
            {
                "datapath": entry.name,
                "error": entry.error,
                "verdict": entry.verdict,
                "cost": entry.cost and dataclasses.asdict(entry.cost),
            }
            for entry in considered
        ],
        versions=versions(),
        verilog_sha256=hashlib.sha256(text.encode()).hexdigest(),
    )
    return Core(parameters, exact, text, plan)


def refuse_other_size(
    fault: Callable[..., InputError], side: str, source: tuple[int, int], rectified: tuple[int, int]
) -> None:
    """Raise InputError where the images of a camera are not of the rectified images' size.

    Parameters
    ----------
    fault : callable
        `Rig.fault`.
    side : str
    source, rectified : (width, height)
        px.
    """
    if source != rectified:
        size = "{}x{}".format(*rectified)
        problem = f"a source image of another size than the rectified one, {size}, is all that no core takes yet"
        if stretch(source, rectified) <= STRETCH:
            problem += f"; --size {size} does for images that are resampled to it"
        raise fault(f"size{1 + SIDES.index(side)}", "{}x{}".format(*source), problem)


def refuse_whole_frames(rig: Rig, views: dict[str, View], options: RectificationOptions, sides: Iterable[str]) -> None:
    """Raise InputError, with the cause, where no core can follow the map of one of ``sides``: before any is fitted.

    ``views`` are those of ``rig`` (`Rig`) and ``options`` (`RectificationOptions`). A core rounds its coordinates, and
    may be refused for one row more.
    """
    if all(_can_follow(views[side]) for side in sides):
        return
    if turn := turned(rig, views, options):
        raise turn
    view = next(views[side] for side in sides if not _can_follow(views[side]))
    problem = (
        f"the first row of the rectified {view.side} image shows row {view.window.lead} of the source's "
        f"{view.source_size[1]}, and no core holds a whole frame"
    )
    others = [choice for choice in helpful(rig) if all(map(_can_follow, rectify(rig, choice, lens=view.lens).values()))]
    found = " or ".join(choice.spelled for choice in others)
    raise rig.fault(*view.geometry, problem + (f"; {found} would do" if found else ""))


def _can_follow(view: View) -> bool:
    return view.window.leaves_room(view.source_size[1])


def _minimised(view: View) -> dict[str, Any] | None:
    if not view.before:
        return None
    lost = loss({view.side: view.before}, {view.side: view})
    return {"rows_before": view.before.window.rows, "rows_after": view.window.rows, "lost": lost}


def _dropped(view: View) -> dict[str, Any] | None:
    if not view.camera.D.any():
        return None
    magnitudes = (np.abs(shift) for shift in view.distortion)
    return {axis: {"mean": shift.mean(), "max": shift.max()} for axis, shift in zip("uv", magnitudes)}


def _source(view: View) -> str:
    return f"Camera: {view.entry}.\n" if view.entry else ""


def _header(top: str, view: View, datapath: Datapath, options: Options) -> str:
    pixel = f"{options.channels}x{options.pixel_bits}" if options.channels > 1 else options.pixel_bits
    return (
        f"{top}{MARK} {view.side} camera, {view.width}x{view.height} px of {pixel} bits, "
        f"1 px/clock.\n{_source(view)}"
        f"Datapath {datapath.name}: {datapath.summary}; {'with' if view.lens else 'without'} the lens; pipeline "
        f"{datapath.pipeline.name}.\n"
        f"AXI4-Stream video in (s_axis) and out (m_axis), tuser: start of frame, tlast: end of line; aresetn is\n"
        f"synchronous. Accuracy, memory and latency: {top}.json."
    )
