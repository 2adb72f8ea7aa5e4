"""Place and route: the registers around the ports, what a report says, caches, and one tiny design for real."""

import importlib.metadata
import json
import re

import pytest

from hdl.errors import ToolError
from hdl.tools import nextpnr, place_and_route, yosys
from hdl.tools.place_and_route import Routed, count, read_report, wrapper

COUNTER = """module core(aclk, step, total);
  input aclk;
  input [3:0] step;
  output reg [7:0] total;
  always @(posedge aclk) total <= total + step;
endmodule
"""


def ports(**widths):
    return {
        name: {"direction": "input" if width > 0 else "output", "bits": list(range(abs(width)))}
        for name, width in widths.items()
    }


def test_all_ports_but_the_clock_have_registers():
    text = wrapper(ports(aclk=1, a=3, b=1, q=-5, r=-1), "core", "aclk")
    assert "core core(.aclk(clock), .a(given[2:0]), .b(given[3:3]), .q(taken[4:0]), .r(taken[5:5]));" in text
    assert re.findall(r"reg \[(\d+):0\] (\w+(?:, \w+)*);", text) == [("4", "given"), ("5", "kept, shifted")]
    with pytest.raises(ValueError, match="clock_port = clk: core has no such input"):
        wrapper(ports(aclk=1), "core", "clk")


def step(kind, cell, to, delay):
    return {"type": kind, "from": {"cell": cell}, "to": {"cell": to}, "delay": delay}


REPORT = {
    "fmax": {"clock": {"achieved": 123.456}},
    "critical_paths": [
        {"from": "async", "to": "posedge clock", "path": [step("routing", "x", "core.y", 99.0)]},
        {"from": "posedge clock", "to": "posedge clock", "path": [step("clk-to-q", "core.raster.x[3]", "", 0.5)]},
        {
            "from": "posedge clock",
            "to": "posedge clock",
            "path": [
                step("clk-to-q", "core.line_buffer.bank_0.0.0", "core.line_buffer.bank_0.0.0", 5.75),
                step("routing", "core.line_buffer.bank_0.0.0", "core.bilinear.weight_LUT4_Z_3", 0.5),
                step("logic", "core.bilinear.weight_LUT4_Z_3", "core.bilinear.weight_LUT4_Z_3", 0.25),
                step("routing", "core.bilinear.weight_LUT4_Z_3", "$nextpnr_packed", 0.75),
                step("logic", "$nextpnr_packed", "$nextpnr_packed", 0.25),
                step("routing", "$nextpnr_packed", "core.s_axis_tready_TRELLIS_FF_Q", 0.5),
                step("setup", "", "core.s_axis_tready_TRELLIS_FF_Q", 0.125),
                step("routing", "core.s_axis_tready_TRELLIS_FF_Q", "kept_TRELLIS_FF_Q_5", 0.5),
                step("setup", "", "kept_TRELLIS_FF_Q_5", 0.0),
            ],
        },
    ],
}


def test_the_critical_path_is_told_by_block():
    found = read_report(REPORT)
    assert found["mhz"] == 123.46
    assert [block for block, _ in found["path"]] == ["line_buffer", "bilinear", "s_axis_tready", "ports"]
    assert [ns for _, ns in found["path"]] == pytest.approx([6.25, 1.75, 0.62, 0.0], abs=0.006)


def test_the_median_is_one_of_the_seeds_and_so_is_its_path():
    paths = {seed: [[str(seed), 1.0]] for seed in (1, 2, 3, 4)}
    routed = Routed({1: 100.0, 2: 120.0, 3: 110.0, 4: 90.0}, paths, {})
    assert (routed.median, routed.best, routed.path) == (100.0, 120.0, paths[1])


def test_cells_are_counted_by_kind():
    kinds = ["LUT4", "LUT4", "CCU2C", "TRELLIS_FF", "TRELLIS_DPR16X4", "MULT18X18D", "PFUMX", "$scopeinfo"]
    cells = {str(index): {"type": kind} for index, kind in enumerate(kinds)}
    cells["ram"] = {"type": "DP16KD", "parameters": {"REGMODE_A": "NOREG", "REGMODE_B": "OUTREG"}}
    assert count({"cells": cells}) == {
        "ff": 1, "lut4": 2, "ccu2c": 1, "dp16kd": 1, "dpr16x4": 1, "mult18x18d": 1, "registered": 1,
    }  # fmt: skip


@pytest.fixture
def tools(monkeypatch):
    """Tools that do nothing but note how they were called: the netlists' tops, and nextpnr's arguments."""
    calls = []

    def netlist(verilog, top, command, *, cache):
        calls.append((top, command))
        return {"ports": ports(aclk=1, step=4, total=-8), "cells": {}, "netnames": {}}

    def run(arguments, directory, keep):
        calls.append(" ".join(arguments))
        assert json.loads((directory / "netlist.json").read_text())["modules"].keys() == {"ports_registered"}
        (directory / "report.json").write_text(json.dumps(REPORT))

    monkeypatch.setattr(place_and_route, "netlist", netlist)
    monkeypatch.setattr(nextpnr, "run", run)
    monkeypatch.setattr(nextpnr, "version", lambda: "0.1.post2")
    return calls


def test_what_was_routed_is_not_routed_again(tools, tmp_path):
    def runs(**options):
        tools.clear()
        routed = place_and_route.place_and_route(COUNTER, "core", cache=tmp_path, **options)
        assert set(routed.mhz.values()) == {123.46}
        return [call for call in tools if isinstance(call, str)]

    first = runs(seeds=(1, 2))
    assert [call.split("--seed ")[1] for call in first] == ["1", "2"]
    assert all("--85k --package CABGA381 --speed 6" in call and "--freq 200" in call for call in first)
    assert runs(seeds=(2, 1)) == []
    assert len(runs(seeds=(1, 2, 3))) == 1
    for options in ({"outreg": True}, {"clock": 150.0}, {"dsp": True}):
        assert len(runs(seeds=(1,), **options)) == 1
    damaged = sorted(tmp_path.glob("routed-*.json"))
    for file, content in zip(damaged, ["", "{}", "[]", '{"mhz": "fast", "path": []}', '{"mhz": 5}', "\\0"]):
        file.write_text(content)
    assert len(runs(seeds=(1, 2, 3))) + sum(
        len(runs(seeds=(1,), **options)) for options in ({"outreg": True}, {"clock": 150.0}, {"dsp": True})
    ) == len(damaged)
    assert [path for path in tmp_path.iterdir() if path.suffix != ".json"] == []


def test_a_core_with_more_memory_than_the_device_is_too_large(tools, tmp_path, monkeypatch):
    block = {"type": "DP16KD", "parameters": {"REGMODE_A": "NOREG", "REGMODE_B": "NOREG"}}

    def netlist(verilog, top, command, *, cache):
        return {"ports": {}, "netnames": {}, "cells": dict.fromkeys(map(str, range(209)), block)}

    monkeypatch.setattr(place_and_route, "netlist", netlist)
    with pytest.raises(place_and_route.TooLarge) as error:
        place_and_route.place_and_route(COUNTER, "core", cache=tmp_path)
    assert str(error.value) == "core has 209 blocks of RAM, and LFE5U-85F-6 208"
    assert tools == []


def test_what_it_was_measured_by_is_said(tools):
    assert place_and_route.conditions() == (
        f"ECP5 (LFE5U-85F-6 CABGA381), Yosys {yosys.version().split('.post')[0]}, nextpnr 0.1, "
        "registers around all ports"
    )


def test_a_missing_nextpnr_is_said_with_what_installs_it(monkeypatch, tmp_path):
    def missing(package):
        raise importlib.metadata.PackageNotFoundError(package)

    monkeypatch.setattr(importlib.metadata, "version", missing)
    with pytest.raises(ToolError) as error:
        place_and_route.place_and_route(COUNTER, "core", cache=tmp_path)
    assert str(error.value) == "nextpnr, which places and routes, is not installed: pip install .[clock]"
    assert list(tmp_path.iterdir()) == []


installed = pytest.mark.skipif(
    nextpnr.PACKAGE not in {found.name for found in importlib.metadata.distributions()},
    reason="nextpnr is not installed (pip install .[clock])",
)


@installed
def test_a_counter_is_placed_and_routed(tmp_path):
    routed = place_and_route.place_and_route(COUNTER, "core", seeds=(1,), cache=tmp_path)
    # An adder of 8 bits behind registers: below the 500 MHz at which nothing on this device is clocked, far above 100.
    assert 200 < routed.median == routed.best == routed.mhz[1]
    assert {block for block, _ in routed.path} <= {"step", "total", "ports"}
    assert sum(ns for _, ns in routed.path) == pytest.approx(1000 / routed.median, abs=0.3)
    assert routed.cells["ff"] == 8 and routed.cells["dp16kd"] == 0


@installed
def test_the_log_of_a_run_that_fails_is_kept(tmp_path):
    (tmp_path / "work").mkdir()
    with pytest.raises(ToolError) as error:
        nextpnr.run(["--85k", "--json", "missing.json"], tmp_path / "work", keep=tmp_path / "kept.log")
    assert str(error.value).startswith("nextpnr: ERROR: ") and "missing.json" in str(error.value)
