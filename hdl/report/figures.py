"""The figures of the report: what the plan does not say by itself, computed from the rebuilt core."""

import dataclasses
import re
from dataclasses import dataclass, replace

import numpy as np

from hdl.arithmetic.cost import Cost
from hdl.arithmetic.cuts import PIPELINES
from hdl.core import versions as core_versions
from hdl.datapaths.base import fitted_budget
from hdl.datapaths.selection import Considered, choose
from hdl.errors import InputError
from hdl.geometry.coordinates import inside_image
from hdl.report.video import margins
from hdl.tools import yosys
from hdl.tools.xc7_timing import MODEL

_NOTED = 0.01  # share of the image without a source from which on it is worth a warning


@dataclass(frozen=True)
class Largest:
    """The largest magnitude of an error and where it is: px, and the rectified pixel."""

    value: float
    x: int
    y: int


@dataclass(frozen=True)
class Ladder:
    """The datapaths that were candidates for one camera.

    Members
    -------
    budget : float
        Largest coordinate error allowed, px per axis.
    entries : list of Considered
        The one in the core has the verdict "chosen" or "chosen by name".
    note : str or None
        What is to be said about how they were found.
    """

    budget: float
    entries: list
    note: str | None


def coordinate_errors(core):
    """{"u", "v"}: the hardware's coordinate less the exact one, px, (height, width) float64; NaN where the exact
    source is outside the image, as in `hdl.geometry.coordinates.Coordinates.error`."""
    coordinates = core.parameters.datapath.coordinates
    u, v = core.exact
    inside = inside_image(u, v, core.plan.source.width, core.plan.source.height)
    scale = 2.0**-coordinates.fraction_bits
    pairs = {"u": (coordinates.u, u), "v": (coordinates.v, v)}
    return {axis: np.where(inside, used * scale - exact, np.nan) for axis, (used, exact) in pairs.items()}


def largest(error):
    """The `Largest` of an error map of `coordinate_errors`."""
    magnitude = np.abs(error)
    y, x = np.unravel_index(np.nanargmax(magnitude), magnitude.shape)
    return Largest(float(magnitude[y, x]), int(x), int(y))


def row_needs(coordinates, border):
    """Least and greatest (source row - output row) of the taps of each output row, two (height,) float64 arrays.

    NaN where an output row reads no tap inside the source. Over all rows they are D_lo and D_hi of
    `hdl.geometry.coordinates.Coordinates.window`.
    """
    height, width = coordinates.height, coordinates.width
    column, top = coordinates.u >> coordinates.fraction_bits, coordinates.v >> coordinates.fraction_bits
    lows, highs = [], []
    for tap in (top, top + 1):
        if border.mode == "replicate":
            rows, read = np.clip(tap, 0, height - 1), np.ones(tap.shape, bool)
        else:
            rows = tap
            read = (column >= -1) & (column <= width - 1) & (tap >= 0) & (tap <= height - 1)
        offset = rows - np.arange(height)[:, None]
        lows.append(np.where(read, offset, np.inf).min(axis=1))
        highs.append(np.where(read, offset, -np.inf).max(axis=1))
    low, high = np.minimum(*lows), np.maximum(*highs)
    return np.where(np.isfinite(low), low, np.nan), np.where(np.isfinite(high), high, np.nan)


def ladder(planned, core, progress=lambda step: None):
    """The `Ladder` of a `PlannedCore`: what its plan considered or, where its datapath was chosen by name, what
    `hdl.datapaths.selection.choose` says of the others."""
    plan = planned.plan
    budget = plan.max_error_requested or fitted_budget(plan.fraction_bits)
    if plan.considered:
        entries = [
            Considered(entry.datapath, None, entry.error, entry.cost and Cost(**entry.cost.model_dump()), entry.verdict)
            for entry in plan.considered
        ]
        return Ladder(budget, entries, None)
    worst = max(plan.error.u.max, plan.error.v.max)
    own = Considered(plan.datapath, None, worst, core.parameters.datapath.cost, "chosen by name")
    try:
        pipeline = PIPELINES[plan.pipeline.name]
        others = choose(planned.view, plan.fraction_bits, budget, "balanced", progress, plan.dsp, pipeline)
    except InputError as refusal:
        return Ladder(budget, [own], f"Of the others none meets {budget:g} px: {refusal.problem}.")
    entries = [
        replace(entry, verdict="the cheapest that meets it") if entry.verdict == "chosen" else entry
        for entry in others
        if entry.name != plan.datapath
    ]
    note = f"{plan.datapath} was chosen by name; the others are what {budget:g} px would take."
    return Ladder(budget, [own, *entries], note)


def timing(core, clock_mhz):
    """Latency and frame rate at a clock, without blanking: MHz, clocks, lines, us; of a frame, us and frames/s."""
    plan = core.plan
    return {
        "clock_mhz": clock_mhz,
        "latency_cycles": plan.latency_cycles,
        "latency_lines": plan.latency_cycles / plan.width,
        "latency_us": plan.latency_cycles / clock_mhz,
        "frame_us": plan.width * plan.height / clock_mhz,
        "frames_per_second": clock_mhz * 1e6 / (plan.width * plan.height),
    }


def clock(path):
    """The highest clock by the model's longest path, and by how much it is higher than video formats' pixel clocks."""
    return {
        "model": MODEL,
        "mhz": path.mhz,
        "path_ns": path.ns,
        "path": list(path.via),
        "formats": [
            {**dataclasses.asdict(margin.format), "met": margin.met, "margin": margin.share}
            for margin in margins(path.mhz)
        ],
    }


def memory(core):
    """The line buffer: rows, D_lo, D_hi, lead, banks, and what the same memory would be for a whole frame, KiB."""
    line_buffer, plan = core.parameters.line_buffer, core.plan
    return {
        "rows": line_buffer.rows,
        "d_lo": line_buffer.window.d_lo,
        "d_hi": line_buffer.window.d_hi,
        "lead": line_buffer.window.lead,
        "bank_depth": line_buffer.depth,
        "bank_width": line_buffer.pixel_width,
        "kib": line_buffer.bits / 8192,
        "frame_kib": plan.width * plan.height * line_buffer.pixel_width / 8192,
    }


def ports(planned):
    """The ports of the top module, as its Verilog declares them, in the order they are wired: name, direction, bits."""
    module = re.search(rf"^module {planned.plan.top}\(.*?^endmodule", planned.verilog, re.DOTALL | re.MULTILINE).group()
    found = {
        name: (direction, int(last or 0) + 1)
        for direction, last, name in re.findall(r"^  (input|output) (?:\[(\d+):0\] )?(\w+);", module, re.MULTILINE)
    }
    return [(name, *found[name]) for name in sorted(found, key=_place)]


def _place(port):
    stream, _, signal = port.partition("_axis_")
    signals = ("tdata", "tvalid", "tready", "tuser", "tlast")
    return (("s", "m").index(stream) + 1, signals.index(signal)) if signal else (0, port)


def warnings(plan):
    """What a user of the core should know, each one sentence."""
    side = plan.camera.side
    found = []
    dropped = plan.distortion_dropped
    if dropped:
        found.append(
            f"The {side} core leaves the lens out, which moves coordinates by up to {dropped.u.max:.1f} px in u and "
            f"{dropped.v.max:.1f} px in v; the errors here are against the map without it."
        )
    total = plan.width * plan.height
    if plan.error.pixels < (1 - _NOTED) * total:
        what = (
            "the nearest source pixel" if plan.border.mode == "replicate" else f"the border value {plan.border.value}"
        )
        found.append(
            f"{(total - plan.error.pixels) / total:.1%} of the {side} rectified image has no source; it shows {what}, "
            "and is not counted in the errors."
        )
    worst = max(plan.error.u.max, plan.error.v.max)
    if plan.max_error_requested is None and worst > fitted_budget(plan.fraction_bits):
        found.append(
            f"No budget was given for the {side} core, and {plan.datapath} is off by up to {worst:.3g} px, more than "
            f"the {fitted_budget(plan.fraction_bits):g} px that a choice among datapaths keeps to."
        )
    return found


def versions():
    """Versions of what decides the Verilog, the pixels or the resource figures, by name."""
    return core_versions.versions() | {yosys.PACKAGE: yosys.version()}


def as_dict(entry):
    """A `Considered` for JSON."""
    return {
        "datapath": entry.name,
        "error": entry.error,
        "cost": entry.cost and dataclasses.asdict(entry.cost),
        "lut_equivalent": entry.cost and entry.cost.weight(),
        "verdict": entry.verdict,
    }
