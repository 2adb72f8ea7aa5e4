"""Registers behind block RAM: what is taken in does the same to the clock, and what would not is left."""

import copy
import json

import pytest

from hdl.errors import ToolError
from hdl.tools import yosys
from hdl.tools.output_registers import absorb, registered_blocks
from hdl.tools.synthesis import ecp5

MEMORY = """module {name}(input clk, reset, write, enable, go, other, input [{address}:0] to, from, input [{top}:0] d,
    output [{top}:0] q, output [{top}:0] more);
  (* ram_style = "block", no_rw_check *) reg [{top}:0] words [0:{last}];
  reg [{top}:0] read, held, again;
  always @(posedge clk) begin
    if (write) words[to] <= d;
    if (enable) read <= words[from];
    {behind}
  end
  assign q = held;
  assign more = {more};
endmodule
"""
# What is behind the memory's read port: Verilog, and the module's second output.
BEHIND = {
    "enabled": ("if (go) held <= read;", "0"),
    "ungated": ("held <= read;", "0"),
    "reset": ("if (reset) held <= 0; else if (go) held <= read;", "0"),
    "two_registers": ("if (go) held <= read; if (other) again <= read;", "again"),
    "two_loads": ("if (go) held <= read;", "read"),
    "inverted": ("if (go) held <= ~read;", "0"),
    "two_enables": ("if (go) held[1:0] <= read[1:0]; if (other) held[{top}:2] <= read[{top}:2];", "0"),
}
ABSORBED = {"enabled", "ungated"}

# A DP16KD as far as the netlists here use it: port A writes, port B reads, in words of 18 or 36 bits. Of its words four
# are there, so that Yosys can look through all that it may hold; the register is Lattice's FPGA-TN-02204.
BLOCK = """module DP16KD({ports});
  parameter DATA_WIDTH_A = 18; parameter DATA_WIDTH_B = 18; parameter [63:0] REGMODE_A = "NOREG";
  parameter [63:0] REGMODE_B = "NOREG"; parameter RESETMODE = ""; parameter ASYNC_RESET_RELEASE = "";
  parameter CSDECODE_A = ""; parameter CSDECODE_B = ""; parameter CLKAMUX = ""; parameter CLKBMUX = "";
  parameter WRITEMODE_A = ""; parameter WRITEMODE_B = ""; parameter GSR = ""; {initial_values}
  input CLKA, CLKB, WEA, WEB, CEA, CEB, OCEA, OCEB, RSTA, RSTB, CSA0, CSA1, CSA2, CSB0, CSB1, CSB2; input {inputs};
  output {outputs};
  localparam WIDE = DATA_WIDTH_A == 36;
  wire [1:0] to = WIDE ? {{ADA6, ADA5}} : {{ADA5, ADA4}}, from = WIDE ? {{ADB6, ADB5}} : {{ADB5, ADB4}};
  wire enables = WEA & CEA & ADA0 & (WIDE ? ADA2 & ADA3 : 1'b1) & ADA1;
  reg [35:0] words0 = 0, words1 = 0, words2 = 0, words3 = 0, read = 0, held = 0;
  wire [35:0] chosen = from[1] ? (from[0] ? words3 : words2) : (from[0] ? words1 : words0);
  wire [35:0] d = {{{data}}};
  always @(posedge CLKA) if (enables) case (to)
    0: words0 <= d; 1: words1 <= d; 2: words2 <= d; default: words3 <= d;
  endcase
  always @(posedge CLKB) begin if (CEB) read <= WIDE ? chosen : {{chosen[17:0], 18'b0}}; if (OCEB) held <= read; end
  assign {{{answer}}} = REGMODE_B == "OUTREG" ? held : read;
endmodule
"""


def block():
    def pins(name, number):
        return [f"{name}{index}" for index in range(number)]

    inputs = [*pins("ADA", 14), *pins("ADB", 14), *pins("DIA", 18), *pins("DIB", 18)]
    outputs = [*pins("DOA", 18), *pins("DOB", 18)]
    controls = "CLKA CLKB WEA WEB CEA CEB OCEA OCEB RSTA RSTB CSA0 CSA1 CSA2 CSB0 CSB1 CSB2".split()
    return BLOCK.format(
        ports=", ".join([*controls, *inputs, *outputs]),
        inputs=", ".join(inputs),
        outputs=", ".join(outputs),
        data=", ".join(reversed([*pins("DIA", 18), *pins("DIB", 18)])),
        answer=", ".join(reversed(outputs)),
        initial_values=" ".join(f"parameter [319:0] INITVAL_{index:02X} = 0;" for index in range(64)),
    )


@pytest.fixture(scope="module")
def netlists(tmp_path_factory):
    """A memory with each of `BEHIND`, and a wide one: as synthesised, by name."""
    folder = tmp_path_factory.mktemp("memories")
    designs = {name: (18, *behind) for name, behind in BEHIND.items()} | {"wide": (36, *BEHIND["enabled"])}
    found = {}
    text = "".join(
        MEMORY.format(
            name=name, top=width - 1, address=8 if width > 18 else 9, last=511 if width > 18 else 1023, more=more,
            behind=behind.format(top=width - 1),
        )
        for name, (width, behind, more) in designs.items()
    )  # fmt: skip
    (folder / "memories.v").write_text(text)
    runs = " ".join(f"design -load read; {ecp5(name, False)}; write_json {name}.json;" for name in designs)
    yosys.run(f"read_verilog memories.v; design -save read; {runs}", folder)
    for name in designs:
        found[name] = json.loads((folder / f"{name}.json").read_text())["modules"][name]
    return found


def flip_flops(module):
    return sum(cell["type"] == "TRELLIS_FF" for cell in module["cells"].values())


@pytest.mark.parametrize("name", [*BEHIND, "wide"])
def test_registers_are_taken_in_where_the_block_does_the_same(netlists, name):
    before = netlists[name]
    kept = copy.deepcopy(before)
    after = absorb(before)
    assert before == kept
    assert sum(cell["type"] == "DP16KD" for cell in before["cells"].values()) == 1
    if name in ABSORBED | {"wide"}:
        assert registered_blocks(after) == 1 and flip_flops(after) == 0
        assert flip_flops(before) == (36 if name == "wide" else 18)
    else:
        assert after == before and registered_blocks(after) == 0


def change(netlist, kind, parameters, connections):
    """The netlist with parameters and connections of all cells of a kind changed."""
    changed = copy.deepcopy(netlist)
    for cell in changed["cells"].values():
        if cell["type"] == kind:
            cell["parameters"] |= parameters
            cell["connections"] |= connections
    return changed


@pytest.mark.parametrize(
    "kind, parameters, connections",
    [
        ("TRELLIS_FF", {"CLKMUX": "INV"}, {}),
        ("TRELLIS_FF", {}, {"CLK": [9999]}),
        ("TRELLIS_FF", {"CEMUX": "INV"}, {}),
        ("TRELLIS_FF", {"REGSET": "SET"}, {}),
        ("TRELLIS_FF", {"LSRMUX": "INV"}, {}),
        ("TRELLIS_FF", {}, {"LSR": ["x"]}),
        ("DP16KD", {"CLKBMUX": "INV"}, {}),
        ("DP16KD", {}, {"RSTB": [9999]}),
        ("DP16KD", {"REGMODE_B": "OUTREG"}, {}),
    ],
)
def test_registers_that_differ_in_anything_are_left(netlists, kind, parameters, connections):
    changed = change(netlists["enabled"], kind, parameters, connections)
    assert absorb(changed) == changed


def test_an_output_that_leaves_the_module_is_left(netlists):
    changed = copy.deepcopy(netlists["enabled"])
    read = next(cell for cell in changed["cells"].values() if cell["type"] == "DP16KD")["connections"]["DOB0"]
    changed["ports"]["more"] = {"direction": "output", "bits": read}
    assert absorb(changed) == changed


def differ(before, after, folder):
    """What Yosys says of two netlists of a module, for any input in ten clocks: "" where their outputs are the same."""
    for title, module in {"before": before, "after": after}.items():
        (folder / f"{title}.json").write_text(json.dumps({"modules": {title: module}}))
    (folder / "block.v").write_text(block())
    script = """read_json before.json; read_json after.json; read_verilog -nooverwrite +/lattice/cells_sim_ecp5.v;
        read_verilog -overwrite block.v; miter -equiv -make_outputs before after both;
        hierarchy -top both; proc; flatten; opt_clean; async2sync; memory_map; opt -full
        sat -verify -prove trigger 0 -set-init-zero -seq 1 -tempinduct-baseonly -maxsteps 10 both"""
    try:
        yosys.run("; ".join(script.replace("\n", ";").split(";")), folder)
    except ToolError as problem:
        return str(problem)
    return ""


@pytest.mark.parametrize("name", [*sorted(ABSORBED), "wide"])
def test_the_netlist_does_the_same_to_the_clock(netlists, name, tmp_path):
    assert differ(netlists[name], absorb(netlists[name]), tmp_path) == ""


@pytest.mark.parametrize(
    "pins, registered",
    [({"OCEB": ["1"]}, {}), ({"OCEB": ["0"]}, {}), ({}, {"REGMODE_B": "NOREG"})],
    ids=["always enabled", "never enabled", "no register"],
)
def test_the_comparison_notices_another_register(netlists, pins, registered, tmp_path):
    wrong = change(absorb(netlists["enabled"]), "DP16KD", registered, pins)
    assert "proof did fail" in differ(netlists["enabled"], wrong, tmp_path)
