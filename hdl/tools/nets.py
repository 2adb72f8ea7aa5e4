"""A netlist of Yosys, by its nets: what drives a bit, what it drives, how it is called."""

from collections import defaultdict
from typing import NamedTuple


class Pin(NamedTuple):
    """One bit, by its place, of a cell's port."""

    cell: str
    port: str
    bit: int


class Nets:
    """
    Parameters
    ----------
    netlist : dict
        `hdl.tools.synthesis.netlist`'s.

    Members
    -------
    cells : {str: dict}
        Those of the netlist.
    inputs, outputs : {bit: str}
        The module's ports by the bits that they give or take.
    drivers : {bit: Pin}
        Outputs of cells.
    loads : {bit: list of Pin}
        Inputs of cells; the module's outputs are not among them.
    """

    def __init__(self, netlist):
        self.cells = netlist["cells"]
        self.inputs, self.outputs = {}, {}
        for name, port in netlist["ports"].items():
            bits = self.inputs if port["direction"] == "input" else self.outputs
            bits.update((bit, name) for bit in port["bits"] if isinstance(bit, int))
        self.drivers, self.loads = {}, defaultdict(list)
        for cell, port, index, bit in self._connections():
            if self.is_output(cell, port):
                self.drivers[bit] = Pin(cell, port, index)
            else:
                self.loads[bit].append(Pin(cell, port, index))
        self._names = _names(netlist["netnames"])

    def _connections(self):
        for name, cell in self.cells.items():
            for port, bits in cell["connections"].items():
                for index, bit in enumerate(bits):
                    if isinstance(bit, int):  # and no constant
                        yield name, port, index, bit

    def is_output(self, cell, port):
        return self.cells[cell]["port_directions"][port] == "output"

    def fan_out(self, bit):
        """How many inputs, the module's outputs among them, a bit drives."""
        return len(self.loads[bit]) + (bit in self.outputs)

    def name(self, bit):
        """The name that a designer gave, with the block's path, or else one of Yosys."""
        return self._names.get(bit, (None, str(bit)))[1]

    def block(self, bit):
        """The submodule that a bit belongs to, or its own name where it is the top module's; None where only Yosys has
        a name for it. A net from one submodule into another may be said to be of either."""
        # Of a memory it is certain: the cell has its name.
        for name in (self.drivers[bit].cell if bit in self.drivers else "$", self.name(bit)):
            if "$" not in name:
                return name.partition(".")[0].partition("[")[0]
        return None


def _names(netnames):
    found = {}
    for name, net in netnames.items():
        for index, bit in enumerate(net["bits"]):
            rank = ("$" in name, len(name)), f"{name}[{index}]" if len(net["bits"]) > 1 else name
            if isinstance(bit, int) and (bit not in found or rank < found[bit]):
                found[bit] = rank
    return found
