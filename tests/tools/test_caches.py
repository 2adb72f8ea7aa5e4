"""Caches: what is said of one that cannot be written, and that a damaged entry is made anew."""

import json

import pytest
from amaranth import Module
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from hdl.errors import ToolError
from hdl.tools import synthesis, webassembly, yosys
from hdl.tools.verilog import convert


class Wire(wiring.Component):
    i: In(1)
    o: Out(1)

    def elaborate(self, platform):
        m = Module()
        m.d.comb += self.o.eq(self.i)
        return m


@pytest.fixture
def no_folder(tmp_path, monkeypatch):
    """A cache folder that cannot be made, since a file is in the way."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("YOWASP_CACHE_DIR", str(tmp_path / "file/cache"))
    return tmp_path / "file/cache"


def test_the_variable_moves_the_cache_of_the_yosys_that_writes_verilog(no_folder):
    with pytest.raises(ToolError) as error:
        convert(Wire(), "wire_through")
    assert str(error.value) == (
        f"Yosys could not write wire_through: its cache, {no_folder}, cannot be written: Not a directory; "
        "set YOWASP_CACHE_DIR to another folder"
    )


def test_a_relative_folder_is_the_same_wherever_the_programs_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("YOWASP_CACHE_DIR", "cache")
    moved = webassembly.environment()
    assert moved["YOWASP_CACHE_DIR"] == moved["XDG_CACHE_HOME"] == str(tmp_path / "cache")


def test_a_home_that_cannot_be_written_is_said_with_the_variable(tmp_path, monkeypatch):
    monkeypatch.delenv("YOWASP_CACHE_DIR", raising=False)
    monkeypatch.setattr(webassembly.platformdirs, "user_cache_dir", lambda name: str(tmp_path / "file" / name))
    (tmp_path / "file").touch()
    assert webassembly.problem("Traceback:\nNotADirectoryError: ...\n") == (
        f"its cache, {tmp_path}/file/YoWASP, cannot be written: Not a directory; set YOWASP_CACHE_DIR to another folder"
    )


def test_an_error_of_the_program_itself_comes_before_its_cache(no_folder):
    assert webassembly.problem("a warning\nERROR: no such module\nmore\n") == "ERROR: no such module"


def test_another_failure_is_said_by_its_last_line(tmp_path, monkeypatch):
    monkeypatch.setenv("YOWASP_CACHE_DIR", str(tmp_path))
    assert webassembly.problem("Traceback:\n  here\nOSError: no room\n") == "OSError: no room"
    assert webassembly.problem("") == "no message"


CELLS = {"FDRE": 3, "LUT2": 5}


@pytest.mark.parametrize("damage", ["", '{"FDRE": 3', "[]", '{"FDRE": null}', "\0\0\0\0"])
def test_a_damaged_result_of_synthesis_is_made_anew(tmp_path, monkeypatch, damage):
    runs = []

    def run(script, directory, keep):
        runs.append(script)
        (directory / "stat.json").write_text(json.dumps({"design": {"num_cells_by_type": CELLS}}))

    monkeypatch.setattr(yosys, "run", run)
    first = synthesis.synthesise("module core; endmodule\n", "core", cache=tmp_path)
    assert (first.ff, first.lut) == (3, 5)
    (entry,) = tmp_path.iterdir()
    entry.write_text(damage)
    for _ in range(2):
        assert synthesis.synthesise("module core; endmodule\n", "core", cache=tmp_path) == first
    assert len(runs) == 2


MODULE = {"attributes": {}, "ports": {}, "cells": {"x": {"type": "INV", "attributes": {}}}, "netnames": {}}


def test_netlists_are_kept_by_what_they_are_made_of_and_made_anew_where_damaged(tmp_path, monkeypatch):
    runs = []

    def run(script, directory, keep):
        runs.append(script)
        source = {"src": "core.v:1.1-2.2"}
        module = {
            **MODULE,
            "cells": {"x": {"type": "INV", "attributes": source}},
            "netnames": {"n": {"attributes": source}},
        }
        (directory / "netlist.json").write_text(json.dumps({"modules": {"core": module, "INV": {}}}))

    def made(text="module core; endmodule\n", command=synthesis.xc7("core", False)):
        return synthesis.netlist(text, "core", command, cache=tmp_path)

    monkeypatch.setattr(yosys, "run", run)
    first = made()
    assert first == {**MODULE, "netnames": {"n": {"attributes": {}}}}
    (entry,) = tmp_path.iterdir()
    for damage in ("", "[]", '{"ports": {}}', '{"ports": {}, "cells": null}'):
        assert made() == first
        entry.write_text(damage)
    assert made() == made() == first and len(runs) == 5
    made(command=synthesis.ecp5("core", False))
    made(text="module core(); endmodule\n")
    assert len(runs) == 7
    synthesis_entries = [file for file in tmp_path.iterdir() if not file.name.startswith("netlist-")]
    assert synthesis_entries == []


def test_the_log_of_a_synthesis_that_fails_is_kept(tmp_path):
    with pytest.raises(ToolError) as error:
        synthesis.synthesise("module core; endmodul\n", "core", cache=tmp_path)
    (log,) = tmp_path.iterdir()
    assert str(error.value).startswith("Yosys: core.v:1: ERROR: ") and str(error.value).endswith(f"(log: {log})")
    assert "ERROR" in log.read_text()
