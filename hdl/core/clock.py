"""The clock that a core reaches, by what was measured of cores like it."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from hdl.arithmetic.cuts import PIPELINES, Pipeline
from hdl.errors import InputError

# Made by `python -m scripts.clock`.
RECORD = "clock.json"


@dataclass(frozen=True)
class Family:
    """FPGAs that clocks were measured on.

    Members
    -------
    name, title : str
    mhz : callable
        Of a row of the record.
    how : str
        What kind of figure it is.
    """

    name: str
    title: str
    mhz: Callable[[dict[str, Any]], float]
    how: str


FAMILIES = {
    family.name: family
    for family in (
        Family(
            "xc7",
            "Xilinx 7 series, as an Artix-7 of speed grade 1",
            lambda row: 1000 / row["xc7"]["ns"],
            "a model of Artix-7 -1 delays over the netlist of Yosys, no place and route",
        ),
        Family(
            "ecp5",
            "Lattice ECP5, speed grade 6",
            lambda row: row["ecp5"]["median"],
            "place and route by nextpnr on an LFE5U-85F-6, the median of its seeds",
        ),
    )
}


@dataclass(frozen=True)
class Clock:
    """What cores like one reached.

    Members
    -------
    mhz : float
    basis : str
        How, and of which cores, that was measured.
    """

    mhz: float
    basis: str


def reached(datapath: str, pipeline: str, lens: bool, width: int, family: str) -> Clock:
    """The `Clock` of a core: the slowest of the measured ones that are most like it.

    Those of its pipeline, and of these the one of its datapath in the narrowest frame that is not narrower than its
    own; where there is none so wide, or none of its datapath, also all of the frame that would be taken then. The wider
    a frame, the more block RAMs are on each other.

    Parameters
    ----------
    datapath, pipeline : str
    lens : bool
    width : int
        Of its frame, px.
    family : str
        A key of `FAMILIES`.
    """
    # A device may have no room for a core.
    rows = [row for row in _rows() if row["pipeline"] == pipeline and row[family]]
    own = [row for row in rows if (row["datapath"], row["lens"]) == (datapath, lens)]
    like = _as_wide(own, width)
    if not like or like[0]["width"] < width:
        like += _as_wide(rows, width)
    kind = FAMILIES[family]
    slowest = min(like, key=kind.mhz)
    title = slowest["datapath"] + (" with the lens" if slowest["lens"] else "")
    size = f"{slowest['width']}x{slowest['height']}"
    return Clock(round(kind.mhz(slowest), 1), f"{kind.how}: {title}, {pipeline}, {size}")


def shallowest(mhz: float, datapath: str, lens: bool, width: int, family: str) -> Pipeline:
    """The first of `PIPELINES` with which a core reaches ``mhz``; other parameters as for `reached`.

    Raises InputError that names what comes nearest, where none does.
    """
    clocks = {name: reached(datapath, name, lens, width, family) for name in PIPELINES}
    for name, clock in clocks.items():
        if clock.mhz >= mhz:
            return PIPELINES[name]
    name, clock = max(clocks.items(), key=lambda item: item[1].mhz)
    problem = f"no pipeline of {datapath} reaches it; the nearest, {name}, reaches {clock.mhz:.0f} MHz by {clock.basis}"
    raise InputError("--clock", None, f"{mhz:g}", problem)


def _as_wide(rows, width):
    """Those of the narrowest frame that is at least so wide, or else of the widest."""
    widths = {row["width"] for row in rows}
    chosen = min((found for found in widths if found >= width), default=max(widths, default=None))
    return [row for row in rows if row["width"] == chosen]


@cache
def _rows():
    return json.loads(files("hdl.core").joinpath(RECORD).read_text(encoding="utf-8"))["rows"]
