"""The model of Artix-7: longest paths worked out by hand, and what must make a path longer or shorter."""

import json

import pytest

from hdl.errors import ToolError
from hdl.tools import yosys
from hdl.tools.synthesis import Resources
from hdl.tools.xc7_cells import (
    BLOCK_RAM,
    BLOCK_RAM_REGISTERED,
    CARRY,
    CARRY_IN,
    FLIP_FLOP,
    LUT,
    LUT_RAM,
    SHIFT_REGISTER,
    timed,
)
from hdl.tools.xc7_dsp import Dsp
from hdl.tools.xc7_timing import WIRES, longest_path

SETUP = timed({"type": "FDRE"}).setup("D")
ALONE, TWO = WIRES[0][1], WIRES[1][1]  # a wire to one input, one to two


def adders(number):
    """Adders of which each waits for the one before; Yosys would make a tree of sums alone."""
    ports = "input clk, " + ", ".join(f"input [11:0] i{i}" for i in range(number + 1)) + ", output reg [11:0] q"
    lines = [f"reg [11:0] a{i}; always @(posedge clk) a{i} <= i{i};" for i in range(number + 1)]
    lines += ["wire [11:0] s0 = a0;"]
    lines += [f"wire [11:0] s{i + 1} = (s{i} + a{i + 1}) ^ {{s{i}[0], 11'd0}};" for i in range(number)]
    return ports, " ".join([*lines, f"always @(posedge clk) q <= s{number};"])


def enabled(number):
    """One register that enables so many."""
    ports = f"input clk, d, input [{number - 1}:0] i, output reg [{number - 1}:0] q"
    return ports, "reg a; always @(posedge clk) begin a <= d; if (a) q <= i; end"


FACTORS = "input clk, input signed [15:0] i, j, output reg signed [31:0] q"
HELD = "reg signed [15:0] a, b; reg signed [31:0] m; always @(posedge clk) begin a <= i; b <= j;"
# Name to ports and inside.
DESIGNS = {
    "wire_through": ("input clk, d, output reg q", "always @(posedge clk) q <= d;"),
    "parity": (
        "input clk, input [3:0] i, output reg q",
        "reg [3:0] a; always @(posedge clk) begin a <= i; q <= ^a; end",
    ),
    "sum": (
        "input clk, input [7:0] i, j, output reg [7:0] q",
        "reg [7:0] a, b; always @(posedge clk) begin a <= i; b <= j; q <= a + b; end",
    ),
    "block_ram": (
        "input clk, w, input [9:0] a, r, input [35:0] d, output reg q",
        "reg [35:0] words [0:1023]; reg [35:0] read;"
        "always @(posedge clk) begin if (w) words[a] <= d; read <= words[r]; q <= ^read[3:0]; end",
    ),
    "delay": ("input clk, d, output reg q", "reg [15:0] s; always @(posedge clk) begin s <= {s, d}; q <= s[15]; end"),
    "small_memory": (
        "input clk, w, input [4:0] a, r, input [1:0] d, output reg q",
        "reg [1:0] words [0:31]; wire [1:0] read = words[r];"
        "always @(posedge clk) begin if (w) words[a] <= d; q <= ^read; end",
    ),
    **{f"adders_{number}": adders(number) for number in (1, 2, 3)},
    **{f"enabled_{number}": enabled(number) for number in (2, 12, 100, 200)},
    "product": (FACTORS, "always @(posedge clk) q <= i * j;"),
    "product_held": (FACTORS, f"{HELD} q <= a * b; end"),
    "product_held_twice": (FACTORS, f"{HELD} m <= a * b; q <= m; end"),
}


@pytest.fixture(scope="module")
def netlists(tmp_path_factory):
    """Of all designs, by name: one synthesis."""
    folder = tmp_path_factory.mktemp("designs")
    modules = [f"module {name}({ports});\n{inside}\nendmodule\n" for name, (ports, inside) in DESIGNS.items()]
    inside = " ".join(f"(* keep *) {name} {name}_();" for name in DESIGNS)
    (folder / "designs.v").write_text("".join([*modules, f"module all;\n{inside}\nendmodule\n"]))
    yosys.run("read_verilog designs.v; synth_xilinx -family xc7 -noiopad -top all; write_json designs.json", folder)
    return json.loads((folder / "designs.json").read_text())["modules"]


@pytest.fixture
def path_of(netlists):
    return lambda name: longest_path(netlists[name])


def test_a_register_between_ports_is_a_wire_away_from_them(path_of):
    path = path_of("wire_through")
    assert path.ns == pytest.approx(FLIP_FLOP + ALONE + SETUP)
    assert path.mhz == pytest.approx(1000 / path.ns)


def test_a_look_up_table_has_a_wire_before_it_and_its_flip_flop_behind_it(path_of):
    path = path_of("parity")
    assert path.ns == pytest.approx(FLIP_FLOP + ALONE + LUT + SETUP)
    assert [step.cell for step in path.steps] == ["FDRE", "LUT4"]
    assert (path.levels, path.start, path.end, path.end_port) == (1, "a", "q", "D")


def test_a_carry_chain_is_timed_from_its_lowest_bits_to_its_highest(path_of):
    path = path_of("sum")
    # An operand drives its bit's table, and the chain at DI: up to the carry of four, from there to the highest sums.
    by_table = TWO + LUT + max(ways[-1] for ways in CARRY["S", "CO"])
    directly = TWO + max(ways[-1] for ways in CARRY["DI", "CO"])
    assert path.ns == pytest.approx(FLIP_FLOP + max(by_table, directly) + max(CARRY_IN["CI", "O"]) + SETUP)
    assert path.levels == 2  # the table, and a chain of two cells


def test_block_ram_is_slow_without_its_register(path_of):
    assert path_of("block_ram").ns == pytest.approx(BLOCK_RAM + ALONE + LUT + SETUP)
    half = timed({"type": "RAMB18E1", "parameters": {"DOA_REG": "1", "DOB_REG": "0"}})
    assert half.launch("DOADO") == half.launch("DOPADOP") == BLOCK_RAM_REGISTERED < BLOCK_RAM == half.launch("DOBDO")


def test_a_shift_register_is_slower_than_a_flip_flop(path_of):
    assert path_of("delay").ns == pytest.approx(SHIFT_REGISTER + ALONE + SETUP)


def test_memory_in_look_up_tables_is_written_slowly_and_read_as_a_look_up_table_is(path_of):
    path = path_of("small_memory")
    assert path.ns == pytest.approx(LUT_RAM + ALONE + LUT + SETUP)
    assert path.steps[0].cell.startswith("RAM") and path.steps[1].cell == "LUT2"
    memory = timed({"type": "RAM32M"})
    assert memory.through("ADDRB", 0, "DOB", 1) == LUT and memory.through("ADDRB", 0, "DOC", 1) is None
    assert memory.setup("ADDRD") and memory.setup("ADDRA") is None
    memory = timed({"type": "RAM64X1D"})
    assert memory.through("DPRA3", 0, "DPO", 0) == memory.through("A3", 0, "SPO", 0) == LUT
    assert memory.through("A3", 0, "DPO", 0) is memory.through("D", 0, "SPO", 0) is None


def test_one_more_adder_is_longer(path_of):
    times = [path_of(f"adders_{number}").ns for number in (1, 2, 3)]
    assert times[0] + 0.5 < times[1] < times[2] - 0.5


def test_a_wire_to_more_inputs_is_longer(path_of):
    times = [path_of(f"enabled_{number}").ns for number in (2, 12, 100, 200)]
    assert times == sorted(set(times))
    assert [ns for _, ns in WIRES] == sorted({ns for _, ns in WIRES})


def test_a_product_is_slow_where_no_register_of_its_block_is_used(path_of):
    times = [path_of(name).ns for name in ("product_held_twice", "product_held", "product")]
    assert times == sorted(set(times)) and times[-1] > 4 * ALONE


def dsp(**parameters):
    return Dsp({"parameters": {name: str(value) for name, value in parameters.items()}})


def test_registers_of_a_dsp_block_decide_where_a_path_ends():
    bare = dsp()
    assert (bare.through("A", 0, "P", 0), bare.launch("P"), bare.setup("A")) == (3.841, None, None)
    assert bare.through("PCIN", 0, "P", 0) < bare.through("C", 0, "P", 0) < bare.through("B", 0, "PCOUT", 0)
    assert bare.through("CLK", 0, "P", 0) is None
    product = dsp(MREG=1)
    assert product.through("A", 0, "P", 0) is None and product.through("C", 0, "P", 0) == bare.through("C", 0, "P", 0)
    # What follows from other figures of DSP_L.sdf, against that file's own.
    assert product.setup("B") == pytest.approx(1.743)
    assert dsp(PREG=1).setup("A") == pytest.approx(3.722) and dsp(PREG=1).setup("C") == pytest.approx(1.701)
    added = dsp(USE_DPORT="TRUE", ADREG=1)
    assert added.setup("A") == pytest.approx(1.756) and added.setup("D") == pytest.approx(1.626, abs=0.002)
    assert dsp(AREG=1).setup("A") < 0.5 and dsp(AREG=1).launch("P") == 4.009 > dsp(AREG=1, PREG=1).launch("P")
    assert dsp(USE_DPORT="TRUE").through("D", 0, "P", 0) > bare.through("A", 0, "P", 0)
    assert dsp(USE_MULT="NONE").through("A", 0, "P", 0) < bare.through("A", 0, "P", 0)


def test_registers_within_a_dsp_block_are_as_far_apart_as_its_highest_clock_says():
    """Source: AMD DS181, Artix-7 -1: 464.25 MHz with all registers, 257.47 without one at the product."""
    assert dsp(AREG=1, BREG=1, MREG=1, PREG=1).within == pytest.approx(1000 / 464.25, rel=0.02)
    assert dsp(AREG=1, BREG=1, PREG=1).within == pytest.approx(1000 / 257.47, rel=0.002)
    assert dsp(AREG=1).within == 0
    cell = {"type": "DSP48E1", "parameters": {"AREG": "1", "PREG": "1"}, "port_directions": {}, "connections": {}}
    path = longest_path({"ports": {}, "cells": {"x": cell}, "netnames": {}})
    assert (path.ns, path.end_port, path.steps) == (dsp(AREG=1, PREG=1).within, "within", ())


def test_a_cell_without_figures_is_refused():
    unknown = {"type": "XADC", "parameters": {}, "port_directions": {}, "connections": {}}
    with pytest.raises(ToolError) as error:
        longest_path({"ports": {}, "cells": {"x": unknown}, "netnames": {}})
    assert str(error.value) == "no delays are known of the cell XADC"


def table(source, target):
    """A look-up table between two nets."""
    return {
        "type": "LUT1",
        "parameters": {},
        "port_directions": {"I0": "input", "O": "output"},
        "connections": {"I0": [source], "O": [target]},
    }


def test_a_loop_is_refused():
    nets = {"ring": {"bits": [2]}, "back": {"bits": [3]}}
    with pytest.raises(ToolError, match="^a loop without a register: (ring|back)$"):
        longest_path({"ports": {}, "cells": {"one": table(2, 3), "other": table(3, 2)}, "netnames": nets})


def test_a_module_without_a_path_takes_no_time():
    assert longest_path({"ports": {}, "cells": {}, "netnames": {}}).ns == 0


def test_blocks_on_a_path_are_named():
    flip_flops = {
        name: {
            "type": "FDRE",
            "parameters": {},
            "port_directions": {"C": "input", "D": "input", "Q": "output"},
            "connections": {"C": [2], "D": [source], "Q": [target]},
        }
        for name, source, target in (("$1", 3, 4), ("$2", 5, 6))
    }
    nets = {"raster.x": {"bits": [9, 4]}, "$yosys": {"bits": [5]}, "window.base": {"bits": [6]}, "clk": {"bits": [2]}}
    ports = {"clk": {"direction": "input", "bits": [2]}, "d": {"direction": "input", "bits": [3]}}
    path = longest_path({"ports": ports, "cells": {**flip_flops, "$t": table(4, 5)}, "netnames": nets})
    assert (path.start, path.end, path.via) == ("raster", "window", ("raster", "window"))
    assert [step.net for step in path.steps] == ["raster.x[1]", "$yosys"]


def test_cells_are_counted_in_a_netlist(netlists):
    found = Resources.of(netlists["product_held"])
    assert (found.dsp, found.ramb36, Resources.of(netlists["block_ram"]).ramb36) == (1, 0, 1)
    assert Resources.of(netlists["parity"]) == Resources(5, 1, 0, 0, 0, 0, 0, 0)
