"""How long the cells of an Artix-7 take, speed grade -1, slow corner, 1.0 V: ns.

Source: AMD DS181, "Artix-7 FPGAs Data Sheet: DC and AC Switching Characteristics" (flip-flops, look-up tables, shift
registers and memory in them); Project X-Ray's data base, prjxray-db, artix7/timings: CLBLL_L.sdf (multiplexers, carry
chain, setup of memory in look-up tables) and BRAM_L.sdf.
"""

import re

from hdl.errors import ToolError
from hdl.tools.xc7_dsp import Dsp

# From the clock to an output; through a look-up table, be it logic or the choice of a word of a memory.
FLIP_FLOP, SHIFT_REGISTER, LUT_RAM, BLOCK_RAM, BLOCK_RAM_REGISTERED = 0.456, 1.61, 1.32, 2.454, 0.882
LUT = 0.124
MULTIPLEXERS = {"MUXF7": {"I0": 0.217, "I1": 0.223, "S": 0.296}, "MUXF8": {"I0": 0.104, "I1": 0.094, "S": 0.273}}
# From the carry in to each of the four outputs; from each of S and DI to the outputs from its own on.
CARRY_IN = {
    ("CI", "O"): (0.222, 0.334, 0.239, 0.313),
    ("CI", "CO"): (0.271, 0.157, 0.228, 0.114),
    ("CYINIT", "O"): (0.482, 0.598, 0.584, 0.642),
    ("CYINIT", "CO"): (0.536, 0.494, 0.592, 0.580),
}
CARRY = {
    ("S", "O"): ((0.223, 0.400, 0.523, 0.582), (0.205, 0.558, 0.618), (0.226, 0.330), (0.227,)),
    ("S", "CO"): ((0.340, 0.433, 0.512, 0.508), (0.469, 0.548, 0.528), (0.292, 0.378), (0.380,)),
    ("DI", "O"): ((None, 0.407, 0.556, 0.615), (None, 0.537, 0.596), (None, 0.438), (None,)),
    ("DI", "CO"): ((0.379, 0.465, 0.540, 0.526), (0.445, 0.520, 0.507), (0.356, 0.398), (0.385,)),
}


class Cell:
    """A cell in which no input reaches an output without a clock, unless a subclass says so.

    Parameters
    ----------
    launch : float or None
        From the clock to an output; None where no register drives it.
    setup : {str: float} or None
        From an input to the clock, by patterns of its ports; a port that matches none reaches no register.
    """

    #: The longest way between two registers in the cell.
    within = 0.0

    def __init__(self, launch=None, setup=None):
        self._launch, self._setup = launch, setup or {}

    def launch(self, port):
        """From the clock to an output; None where no register drives it."""
        return self._launch

    def setup(self, port):
        """From an input to the clock; None where no register takes it."""
        return next((time for pattern, time in self._setup.items() if re.fullmatch(pattern, port)), None)

    def through(self, source, index, target, to):
        """From bit ``index`` of an input to bit ``to`` of an output with no register between; None where there is no
        such way."""
        return None


class Lut(Cell):
    def through(self, source, index, target, to):
        return LUT


class ShiftRegister(Cell):
    def through(self, source, index, target, to):
        return LUT if re.fullmatch(r"A\d?", source) and target == "Q" else None


class LutRam(Cell):
    """An output has an address of its own: DPO DPRA, DOA ADDRA; the first, or only, one that of the write port."""

    def through(self, source, index, target, to):
        if source.startswith("DPRA"):
            own = target == "DPO"
        elif source.startswith("ADDR"):
            own = target[-1] == source[-1]
        else:
            own = re.fullmatch(r"A\d?", source) and target != "DPO"
        return LUT if own else None


class Multiplexer(Cell):
    def __init__(self, times):
        super().__init__()
        self._times = times

    def through(self, source, index, target, to):
        return self._times[source]


class Carry(Cell):
    def through(self, source, index, target, to):
        if (source, target) in CARRY_IN:
            return CARRY_IN[source, target][to]
        return CARRY[source, target][index][to - index] if to >= index else None


class BlockRam(Cell):
    """Its outputs are slow, unless they have their register."""

    def __init__(self, cell):
        super().__init__(None, {
            r"ADDR\w+": 0.566, r"DI\w+": 0.737, r"WE\w+": 0.532, r"EN\w+": 0.443, r"(REGCE|RST)\w+": 0.36,
        })  # fmt: skip
        self._registered = {side: int(cell["parameters"].get(f"DO{side}_REG", "0"), 2) for side in "AB"}

    def launch(self, port):
        side = re.match("DOP?([AB])", port)
        return BLOCK_RAM_REGISTERED if side and self._registered[side.group(1)] else BLOCK_RAM


_FLIP_FLOP = Cell(FLIP_FLOP, {"D": 0.05, "CE": 0.205, "[RS]|CLR|PRE": 0.429})
_SHIFT_REGISTER = ShiftRegister(SHIFT_REGISTER, {"D": 0.173, "CE": 0.205})
_LUT_RAM = LutRam(LUT_RAM, {r"DI?[A-D]?": 0.453, "WE": 0.654, r"A\d?|ADDRD": 0.245})
_LUT, _CARRY, _NONE = Lut(), Carry(), Cell()
_KINDS = {
    r"LUT[1-6]|INV": lambda cell: _LUT,
    r"FD[RSCP]E(_1)?": lambda cell: _FLIP_FLOP,
    "CARRY4": lambda cell: _CARRY,
    r"MUXF[78]": lambda cell: Multiplexer(MULTIPLEXERS[cell["type"]]),
    r"SRL16E?|SRLC(16|32)E": lambda cell: _SHIFT_REGISTER,
    r"RAM\d+(X1S|X1D|M)(_1)?": lambda cell: _LUT_RAM,
    r"RAMB(18|36)E1": BlockRam,
    "DSP48E1": Dsp,
    r"BUFG|\$scopeinfo": lambda cell: _NONE,
}


def timed(cell):
    """The `Cell` of a cell of a netlist. Raises ToolError for a type that there are no figures of."""
    for pattern, kind in _KINDS.items():
        if re.fullmatch(pattern, cell["type"]):
            return kind(cell)
    raise ToolError(f"no delays are known of the cell {cell['type']}")
