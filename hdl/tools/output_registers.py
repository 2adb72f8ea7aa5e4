"""Registers behind the read port of an ECP5's block RAM, taken into the block, which has some of its own.

Lattice's tools do so, and Yosys does not. With its register (REGMODE "OUTREG", enabled by OCE) the block is as fast as
a flip-flop, and without it one of the slowest cells there are. What the netlist does stays the same to the clock.
"""

from hdl.tools.nets import Nets

BLOCK, REGISTER = "DP16KD", "TRELLIS_FF"
_WIDE = 36  # bits of a port that takes the pins of both
_NEVER = ["0"]


def absorb(netlist):
    """The netlist with all registers in the blocks that can be.

    All outputs of a read port that anything reads must each drive one register and nothing else, all of these at the
    port's own clock, with one and the same enable, without a reset, and zero at first, as the block's are.

    Parameters
    ----------
    netlist : dict
        `hdl.tools.synthesis.netlist`'s, of `hdl.tools.synthesis.ecp5`; it is left as it is.

    Returns
    -------
    dict
    """
    nets = Nets(netlist)
    cells = dict(netlist["cells"])
    for name, block in netlist["cells"].items():
        if block["type"] == BLOCK:
            for sides in _ports(block):
                registers = _registers(nets, block, sides)
                if registers:
                    cells[name] = _registered(cells[name], sides, {port: cells.pop(name) for port, name in registers})
    return {**netlist, "cells": cells}


def registered_blocks(netlist):
    """How many blocks of a netlist use their output registers."""
    return sum(
        "OUTREG" in (cell["parameters"]["REGMODE_A"], cell["parameters"]["REGMODE_B"])
        for cell in netlist["cells"].values()
        if cell["type"] == BLOCK
    )


def _ports(block):
    """The sides whose pins make a read port: one, or, of 36 bits, both."""
    wide = any(int(block["parameters"][f"DATA_WIDTH_{side}"], 2) == _WIDE for side in "AB")
    return ("AB",) if wide else ("A", "B")


def _registers(nets, block, sides):
    """(output, name of the register behind it) of a read port; empty where not all can be taken in."""
    parameters, pins = block["parameters"], block["connections"]
    if any(parameters[f"REGMODE_{side}"] != "NOREG" or pins[f"RST{side}"] != _NEVER for side in sides):
        return []
    if any(parameters[f"CLK{side}MUX"] != f"CLK{side}" for side in sides):
        return []
    found, ways = [], {tuple(pins[f"CLK{side}"]) for side in sides}
    enables = set()
    for port, (bit,) in pins.items():
        if not (port.startswith("DO") and port[2] in sides and nets.fan_out(bit)):
            continue
        if nets.fan_out(bit) > 1 or not nets.loads[bit]:
            return []
        load = nets.loads[bit][0]
        register = nets.cells[load.cell]
        if register["type"] != REGISTER or load.port != "DI" or not _plain(register):
            return []
        ways.add(tuple(register["connections"]["CLK"]))
        enables.add(_enable(register))
        found.append((port, load.cell))
    return found if len(ways) == len(enables) == 1 else []


def _plain(register):
    """Whether it has no reset, and begins with zero."""
    parameters, pins = register["parameters"], register["connections"]
    return (
        parameters["CLKMUX"] == "CLK"
        and parameters["CEMUX"].strip() in ("CE", "1")
        and parameters["LSRMUX"] == "LSR"
        and pins.get("LSR", _NEVER) == _NEVER
        and parameters["REGSET"] == "RESET"
    )


def _enable(register):
    """The bit that enables it: a number, or "1"."""
    return register["connections"]["CE"][0] if register["parameters"]["CEMUX"].strip() == "CE" else "1"


def _registered(block, sides, registers):
    """The block with the registers behind its outputs in it."""
    enable = {_enable(register) for register in registers.values()}
    return {
        **block,
        "parameters": block["parameters"] | {f"REGMODE_{side}": "OUTREG" for side in sides},
        "connections": block["connections"]
        | {f"OCE{side}": list(enable) for side in sides}
        | {port: register["connections"]["Q"] for port, register in registers.items()},
    }
