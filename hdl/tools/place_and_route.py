"""The clock of a core after place and route, on a Lattice ECP5, by nextpnr."""

import hashlib
import json
import re
import statistics
import tempfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from hdl.errors import ToolError
from hdl.files import named
from hdl.tools import nextpnr, yosys
from hdl.tools.output_registers import absorb, registered_blocks
from hdl.tools.synthesis import ecp5, netlist

DEVICE, BLOCKS = "LFE5U-85F-6 CABGA381", 208  # blocks of RAM in it
_OPTIONS = "--85k --package CABGA381 --speed 6 --lpf-allow-unconstrained --timing-allow-fail"
CLOCK = 200.0  # MHz to strive for

_WRAPPER, _CORE = "ports_registered", "core"
# What Yosys and nextpnr name cells by: the net, and these.
_CELL_NAME = re.compile(r"[\[.$]|_(LUT4|TRELLIS|CCU2C|PFUMX|L6MUX21|DP16KD|MULT18X18D)(_|$)")
_PORTS = "ports"


class TooLarge(ToolError):
    """A core with more memory than the device has."""


@dataclass(frozen=True)
class Routed:
    """
    Members
    -------
    mhz : {int: float}
        The highest clock, by seed.
    paths : {int: list of [str, float]}
        The path that sets it, by seed: block, or signal of the top module, and ns spent there and on the wires from
        there. "ports" is not of the core.
    cells : {str: int}
        Of the core alone: "ff", "lut4", "ccu2c" (carry, two look-up tables each), "dp16kd" (block RAM), "registered"
        (those of them with their output register), "dpr16x4" and "mult18x18d".
    """

    mhz: dict
    paths: dict
    cells: dict

    @property
    def median(self):
        return statistics.median_low(self.mhz.values())

    @property
    def best(self):
        return max(self.mhz.values())

    @property
    def path(self):
        """That of the median."""
        return next(self.paths[seed] for seed, mhz in self.mhz.items() if mhz == self.median)


def conditions():
    """How `place_and_route` measures, in words."""
    versions = (module.version().split(".post")[0] for module in (yosys, nextpnr))
    return "ECP5 ({}), Yosys {}, nextpnr {}, registers around all ports".format(DEVICE, *versions)


def place_and_route(
    verilog, top, *, seeds=(1, 2, 3), clock=CLOCK, outreg=False, dsp=False, clock_port="aclk", cache=Path("build/cache")
):
    """`Routed`: the core ``top`` of a Verilog text, placed and routed once a seed.

    Shift registers of their own feed the inputs and take up the outputs, so that no pin counts.

    Parameters
    ----------
    verilog, top : str
    seeds : sequence of int
    clock : float
        MHz to strive for.
    outreg : bool
        Whether registers behind block RAM are taken into it (`hdl.tools.output_registers`).
    dsp : bool
        Whether multipliers may be DSP blocks.
    clock_port : str
    cache : Path
        Results are cached by content: the versions of the tools, their commands, the text.

    Raises
    ------
    ToolError
        Where nextpnr is not installed, and with the error line and the log's path of a tool that fails. `TooLarge`
        where the core does not fit into the device.
    """
    nextpnr.version()
    alone = netlist(verilog, top, ecp5(top, dsp), cache=cache)
    blocks = count(alone)["dp16kd"]
    if blocks > BLOCKS:
        raise TooLarge(f"{top} has {blocks} blocks of RAM, and {DEVICE.split()[0]} {BLOCKS}")
    text = verilog + wrapper(alone["ports"], top, clock_port)
    if outreg:
        alone = absorb(alone)
    runs = {seed: _run(text, ecp5(_WRAPPER, dsp), seed, clock, outreg, Path(cache)) for seed in seeds}
    return Routed(
        {seed: run["mhz"] for seed, run in runs.items()},
        {seed: run["path"] for seed, run in runs.items()},
        count(alone),
    )


def count(module):
    """`Routed.cells` of a netlist."""
    types = Counter(cell["type"] for cell in module["cells"].values())
    names = {"ff": "TRELLIS_FF", "lut4": "LUT4", "ccu2c": "CCU2C", "dp16kd": "DP16KD", "dpr16x4": "TRELLIS_DPR16X4",
             "mult18x18d": "MULT18X18D"}  # fmt: skip
    return {name: types[kind] for name, kind in names.items()} | {"registered": registered_blocks(module)}


def wrapper(ports, top, clock_port):
    """Verilog of a module around ``top`` with four pins: registers for its inputs are a shift register, and those for
    its outputs are copied into one."""
    inputs = {name: len(port["bits"]) for name, port in ports.items() if port["direction"] == "input"}
    outputs = {name: len(port["bits"]) for name, port in ports.items() if port["direction"] == "output"}
    if clock_port not in inputs:
        raise ValueError(f"clock_port = {clock_port}: {top} has no such input")
    del inputs[clock_port]
    given, taken = sum(inputs.values()), sum(outputs.values())
    wires = [f".{clock_port}(clock)"]
    for ends, whole in ((inputs, "given"), (outputs, "taken")):
        at = 0
        for name, width in ends.items():
            wires.append(f".{name}({whole}[{at + width - 1}:{at}])")
            at += width
    return f"""
module {_WRAPPER}(input clock, input bit_in, input load, output bit_out);
  reg [{given}:0] given;
  wire [{taken - 1}:0] taken;
  reg [{taken - 1}:0] kept, shifted;
  reg loads;
  {top} {_CORE}({", ".join(wires)});
  always @(posedge clock) begin
    given <= {{given[{given - 1}:0], bit_in}};
    kept <= taken;
    loads <= load;
    shifted <= loads ? kept : {{shifted, bit_in}};
  end
  assign bit_out = shifted[{taken - 1}];
endmodule
"""


def _run(text, command, seed, clock, outreg, cache):
    """{"mhz", "path"} of one run."""
    options = f"{_OPTIONS} --freq {clock:g} --seed {seed}"
    what = (yosys.version(), nextpnr.version(), command, options, f"outreg {outreg}", text)
    key = hashlib.sha256("\0".join(what).encode()).hexdigest()[:20]
    result = cache / f"routed-{key}.json"
    try:
        found = json.loads(result.read_text())
        if found["mhz"] > 0 and isinstance(found["path"], list):
            return found
    except (OSError, ValueError, TypeError, KeyError):
        pass
    module = netlist(text, _WRAPPER, command, cache=cache)
    if outreg:
        module = absorb(module)
    with named(cache), tempfile.TemporaryDirectory(dir=cache, prefix=".routed-") as work:
        work = Path(work)
        (work / "netlist.json").write_text(json.dumps({"modules": {_WRAPPER: module}}))
        arguments = ["--json", "netlist.json", "--report", "report.json", *options.split()]
        nextpnr.run(arguments, work, keep=result.with_suffix(".log"))
        found = read_report(json.loads((work / "report.json").read_text()))
        (work / "result").write_text(json.dumps(found))
        (work / "result").replace(result)
    return found


def read_report(report):
    """{"mhz", "path"} of nextpnr's report: the highest clock, and `Routed.paths` of it."""
    mhz = min(clock["achieved"] for clock in report["fmax"].values())
    path = max(
        (found["path"] for found in report["critical_paths"] if _between_registers(found)),
        key=lambda steps: sum(step["delay"] for step in steps),
    )
    blocks = []
    for step in path:
        # A wire, and the time from the clock to the output, are of the cell before; logic and setup of the one there.
        cell = step["from" if step["type"] in ("routing", "clk-to-q") else "to"]["cell"]
        block = _block(cell) or (blocks[-1][0] if blocks else cell)
        if not blocks or blocks[-1][0] != block:
            blocks.append([block, 0.0])
        blocks[-1][1] += step["delay"]
    return {"mhz": round(mhz, 2), "path": [[block, round(ns, 2)] for block, ns in blocks]}


def _between_registers(path):
    return all(path[end].startswith("posedge") for end in ("from", "to"))


def _block(cell):
    """The block within the core that a cell belongs to by its name; None for one that only a tool has named."""
    if cell.startswith("$"):
        return None
    if not cell.startswith(f"{_CORE}."):
        return _PORTS
    return _CELL_NAME.split(cell.removeprefix(f"{_CORE}."), maxsplit=1)[0] or None
