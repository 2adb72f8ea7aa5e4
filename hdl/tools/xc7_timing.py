"""The longest path of a netlist for a Xilinx 7-series FPGA, by a model: no place and route of these is open to all."""

import re
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

from hdl.errors import ToolError
from hdl.tools.nets import Nets
from hdl.tools.xc7_cells import FLIP_FLOP, timed

# What is to be said wherever a figure of it is.
MODEL = "a model of an Artix-7 -1: delays of its cells, wires assumed by their fan-out; not place and route"

# Our own assumption: of a wire that drives up to so many inputs, ns.
WIRES = ((1, 0.45), (3, 0.55), (8, 0.7), (20, 0.85), (60, 1.1), (150, 1.5), (float("inf"), 1.9))
# Within a slice, a column of carry chains or of DSP blocks there is a wire of its own: the driver's type; the load's
# and its port; ns.
_DIRECT = (
    (r"LUT\d|INV", r"CARRY4\.S|MUXF7\.I[01]", 0.0),
    (r"CARRY4", r"CARRY4\.CI|FD\w+\.D", 0.0),
    (r"MUXF7", r"MUXF8\.I[01]", 0.0),
    (r"DSP48E1", r"DSP48E1\.PCIN", 0.055),
)
# A look-up table's own flip-flop takes what nothing else does.
_OWN_FLIP_FLOP = r"LUT\d|INV|MUXF[78]", r"FD\w+\.D"
_OUTPUT_SETUP = 0.05
# What a path in it is told by, since one carry chain is many cells.
_CHAIN = "CARRY4"


@dataclass(frozen=True)
class Step:
    """The output of a cell on a path.

    Members
    -------
    ns : float
        Since the clock, the wire before the cell and the cell included.
    cell : str
        Its type; "" for a port of the module.
    net, block : str
        As `hdl.tools.nets.Nets` names them; block may be None.
    """

    ns: float
    cell: str
    net: str
    block: str | None


@dataclass(frozen=True)
class Path:
    """A way from register to register, by the model; ports of the module count as registers.

    Members
    -------
    ns : float
    start, end : str
        The blocks, or top level signals, of the registers.
    end_port : str
        The port of the register, such as "D" or "CE".
    steps : tuple of Step
        From the first register's output on.
    """

    ns: float
    start: str
    end: str
    end_port: str
    steps: tuple

    @property
    def mhz(self):
        """The highest clock."""
        return 1000 / self.ns

    @property
    def via(self):
        """The blocks that it leads through, the first and the last one too."""
        blocks = [self.start, *(step.block for step in self.steps if step.block), self.end]
        return tuple(block for before, block in zip([None, *blocks], blocks) if block != before)

    @property
    def levels(self):
        """The cells between the registers; a carry chain is one."""
        types = [step.cell for step in self.steps]
        return sum(1 for before, cell in zip(types, types[1:]) if not before == cell == _CHAIN)


def longest_path(netlist):
    """The `Path` that takes longest.

    Parameters
    ----------
    netlist : dict
        `hdl.tools.synthesis.netlist`'s, of `hdl.tools.synthesis.xc7`.

    Raises
    ------
    ToolError
        For cells that there are no figures of, and loops.
    """
    return _Search(Nets(netlist)).longest()


class _End(NamedTuple):
    """Where a path ends: ns, the cell and its port, or a port of the module, and the bit there; -1: none, the path
    lies within the cell."""

    ns: float
    cell: str
    port: str
    bit: int = -1


class _Search:
    def __init__(self, nets):
        self._nets = nets
        self._timed = {name: timed(cell) for name, cell in nets.cells.items()}
        # What of each bit is latest: ns, and the bit before it, or None.
        self._latest = {}
        try:
            order = list(TopologicalSorter({bit: self._before(bit) for bit in nets.drivers}).static_order())
        except CycleError as loop:
            raise ToolError(f"a loop without a register: {nets.name(loop.args[1][0])}") from None
        for bit in order:
            self._latest[bit] = self._arrival(bit)

    def longest(self):
        ends = [end for name in self._nets.cells for end in self._ends(name)]
        for bit, port in self._nets.outputs.items():
            ends.append(_End(self._at(bit) + self._wire(bit) + _OUTPUT_SETUP, port, "", bit))
        if not ends:
            return Path(0.0, "", "", "", ())
        ns, cell, port, bit = max(ends)
        end = self._block_of(cell)
        if bit < 0:
            return Path(ns, end, end, port, ())
        steps = self._steps(bit)
        return Path(ns, next((step.block for step in steps if step.block), steps[0].net), end, port, steps)

    def _ends(self, name):
        cell, times = self._nets.cells[name], self._timed[name]
        if times.within:
            yield _End(times.within, name, "within")
        for port, bits in cell["connections"].items():
            setup = None if self._nets.is_output(name, port) else times.setup(port)
            if setup is not None:
                for bit in bits:
                    if isinstance(bit, int):
                        yield _End(self._at(bit) + self._wire(bit, name, port) + setup, name, port, bit)

    def _before(self, bit):
        return [source for source, _ in self._ways(bit)]

    def _ways(self, bit):
        """(source, ns from there) of each bit from which the cell's output ``bit`` is reached without a register."""
        name, target, to = self._nets.drivers[bit]
        if not self._nets.fan_out(bit):
            return
        cell, times = self._nets.cells[name], self._timed[name]
        for port, bits in cell["connections"].items():
            if self._nets.is_output(name, port):
                continue
            for index, source in enumerate(bits):
                if isinstance(source, int):
                    ns = times.through(port, index, target, to)
                    if ns is not None:
                        yield source, ns + self._wire(source, name, port)

    def _arrival(self, bit):
        if bit not in self._nets.drivers:
            return FLIP_FLOP, None
        name, port, _ = self._nets.drivers[bit]
        launch = self._timed[name].launch(port)
        found = [] if launch is None else [(launch, None)]
        found += [(self._latest[source][0] + ns, source) for source, ns in self._ways(bit)]
        return max(found, key=lambda way: way[0], default=(0.0, None))

    def _at(self, bit):
        return self._latest[bit][0] if bit in self._latest else FLIP_FLOP

    def _wire(self, bit, name=None, port=None):
        """Of the wire from a bit's driver to an input; to an output of the module."""
        fan_out = self._nets.fan_out(bit)
        if name and bit in self._nets.drivers:
            driver = self._nets.cells[self._nets.drivers[bit].cell]["type"]
            load = f"{self._nets.cells[name]['type']}.{port}"
            for source, target, ns in _DIRECT:
                if re.fullmatch(source, driver) and re.fullmatch(target, load):
                    return ns
            if fan_out == 1 and re.fullmatch(_OWN_FLIP_FLOP[0], driver) and re.fullmatch(_OWN_FLIP_FLOP[1], load):
                return 0.0
        return next(ns for most, ns in WIRES if fan_out <= most)

    def _steps(self, bit):
        steps = []
        while bit is not None:
            ns, before = self._latest.get(bit, (FLIP_FLOP, None))
            cell = self._nets.cells[self._nets.drivers[bit].cell]["type"] if bit in self._nets.drivers else ""
            steps.append(Step(ns, cell, self._nets.name(bit), self._nets.block(bit)))
            bit = before
        return tuple(reversed(steps))

    def _block_of(self, name):
        """The block of a cell: by what it drives, or else by its own name; a port of the module itself."""
        if name not in self._nets.cells:
            return name
        cell = self._nets.cells[name]
        outputs = [
            bit for port, bits in cell["connections"].items() if self._nets.is_output(name, port) for bit in bits
        ]
        found = (self._nets.block(bit) for bit in outputs if isinstance(bit, int))
        return next((block for block in found if block), name)
