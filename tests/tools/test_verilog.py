import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import rigs
from amaranth import Module
from amaranth.lib import wiring
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out

from hdl.datapaths import DATAPATHS
from hdl.stream.rectifier import Rectifier, RectifierParameters
from hdl.tools import yosys
from hdl.tools.verilog import convert

SCRIPT = """
import sys
from hdl import calibration
from hdl.datapaths import DATAPATHS
from hdl.geometry.rectification import rectify
from hdl.stream.rectifier import Rectifier, RectifierParameters
from hdl.tools.verilog import convert
for name, datapath in DATAPATHS.items():
    view = rectify(calibration.embedded((160, 120)), lens=datapath.supports_lens)["left"]
    sys.stdout.write(convert(Rectifier(RectifierParameters(datapath.fit(view, 5))), "core"))
"""


def core_parameters(name, **formats):
    size = (64, 48) if name == "table" else (640, 480)
    return RectifierParameters(DATAPATHS[name].fit(rigs.view("samples", "left", *size), 5), **formats)


@cache
def exported(name, top="core", header="", **formats):
    """The Verilog of a core for VGA frames; with a table, for smaller ones."""
    return convert(Rectifier(core_parameters(name, **formats)), top, header)


@pytest.mark.parametrize("name", DATAPATHS)
def test_text_is_short_and_says_nothing_of_where_or_when(name):
    text = exported(name)
    assert text.count("\n") <= 3000
    assert not re.search(r"\bsrc\b|\.py\b|\d{4}-\d\d-\d\d|\d\d:\d\d:\d\d", text)
    assert str(Path(__file__).parents[1]) not in text
    assert not re.search(r"(?<![*/])/\w+/", text)  # a path; comments have a slash beside a star or another slash


@pytest.mark.parametrize("name", DATAPATHS)
def test_modules_have_plain_names_that_begin_with_the_top(name):
    text = exported(name, top="eye")
    modules = re.findall(r"^module (.+?) ?\(", text, re.MULTILINE)
    assert modules.count("eye") == 1 and len(set(modules)) == len(modules)
    assert all(re.fullmatch(r"eye(_[a-z0-9_]+)?", module) for module in modules)
    assert {"eye_capture", "eye_flow", "eye_raster", "eye_line_buffer", "eye_bilinear"} <= set(modules)
    # Each is instantiated once, under a plain name too.
    instances = re.findall(r"^  (\S+)  (\w+) \($", text, re.MULTILINE)
    assert sorted(module for module, _ in instances) == sorted(set(modules) - {"eye"})


@pytest.mark.parametrize(
    "formats, bits",
    [
        ({}, 8),
        ({"pixel_bits": 10}, 16),
        ({"pixel_bits": 12}, 16),
        ({"pixel_bits": 16}, 16),
        ({"channels": 3}, 24),
    ],
)
def test_ports_are_those_of_axi4_stream_video(formats, bits):
    text = exported("proposed", **formats)
    top = text[re.search(r"^module core\(", text, re.MULTILINE).end() :]
    top = top[: top.index("endmodule")]
    ports = re.findall(r"^  (input|output) (?:\[(\d+):0\] )?(\w+);", top, re.MULTILINE)
    data = str(bits - 1)
    assert sorted(ports) == sorted(
        [
            ("input", "", "aclk"),
            ("input", "", "aresetn"),
            ("input", data, "s_axis_tdata"),
            ("input", "", "s_axis_tvalid"),
            ("output", "", "s_axis_tready"),
            ("input", "", "s_axis_tuser"),
            ("input", "", "s_axis_tlast"),
            ("output", data, "m_axis_tdata"),
            ("output", "", "m_axis_tvalid"),
            ("input", "", "m_axis_tready"),
            ("output", "", "m_axis_tuser"),
            ("output", "", "m_axis_tlast"),
        ]
    )
    assert sorted(top[: top.index(")")].replace(" ", "").replace("\n", "").split(",")) == sorted(
        name for _, _, name in ports
    )


@pytest.mark.parametrize("name", DATAPATHS)
def test_a_second_export_is_the_same_text(name):
    assert exported.__wrapped__(name) == exported(name)


def test_another_process_writes_the_same_bytes(tmp_path):
    texts = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT],
            cwd=tmp_path,
            check=True,
            capture_output=True,
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
        ).stdout
        for seed in ("1", "2")
    }
    assert len(texts) == 1
    assert texts.pop().count(b"module core(") == len(DATAPATHS)


def test_header_is_a_comment_before_everything_else():
    text = exported("proposed", header="first line\nsecond line")
    assert text.startswith("// first line\n// second line\n/* verilator lint_save */\n")
    assert text.removeprefix("// first line\n// second line\n") == exported("proposed")
    assert text.endswith("endmodule\n/* verilator lint_restore */\n")


def test_reset_is_synchronous_and_the_clock_is_aclk_alone():
    text = exported("conventional")
    assert "negedge" not in text
    assert set(re.findall(r"always @\((.*?)\)", text)) <= {"posedge aclk", "posedge clk", "*"}


def test_line_memories_are_four_with_a_write_and_a_registered_read_each():
    text = exported("proposed")
    text = text[text.index("module core_line_buffer ") :]
    text = text[: text.index("endmodule")]
    assert "initial" not in text  # which is how they would get their contents
    memories = re.findall(r"^  reg \[7:0\] (\w+) \[(\d+):0\];", text, re.MULTILINE)
    parameters = core_parameters("proposed").line_buffer
    assert memories == [
        (f"bank_{row}_row_{column}_column", str(parameters.depth - 1))
        for row in ("even", "odd")
        for column in ("even", "odd")
    ]
    for memory, _ in memories:
        accesses = re.findall(rf"(.*){memory}\[.*\](.*);", text)
        assert [bool(re.match(r" <= ", after)) for _, after in accesses] == [True, False]
        assert re.fullmatch(r"\s*\w+ <= ", accesses[1][0])


class Stored(wiring.Component):
    """A memory that is read in order, the contents given."""

    address: In(16)
    word: Out(12)

    def __init__(self, words):
        super().__init__()
        self.words = words

    def elaborate(self, platform):
        m = Module()
        m.submodules.memory = memory = Memory(shape=12, depth=len(self.words), init=self.words)
        read = memory.read_port()
        m.d.comb += [read.addr.eq(self.address), self.word.eq(read.data)]
        return m


@pytest.mark.parametrize("depth", [1, 3, 4, 5, 100, 4000, 12345])
def test_contents_of_memories_take_few_lines_and_are_whole(depth):
    words = np.random.default_rng(depth).integers(0, 1 << 12, depth).tolist()
    text = convert(Stored(words), "stored")
    assert re.findall(r"memory\[(\d+)\] = 12'h(\w+);", text) == [(str(i), f"{w:03x}") for i, w in enumerate(words)]
    lines = re.findall(r"^  initial begin memory.* end$", text, re.MULTILINE)
    # No other block holds any, and each has one line: as long as a line of text, or longer if they would be too many.
    assert sum(line.count("memory[") for line in lines) == depth
    assert len(lines) <= 1000
    if depth < 4000:
        assert max(map(len, lines)) <= 120 and all(len(line) > 80 for line in lines[:-1])


def test_the_contents_are_what_a_tool_reads(tmp_path):
    words = [5, 0xFFF, 0, 0x123] * 20 + [7]
    (tmp_path / "stored.v").write_text(convert(Stored(words), "stored"))
    yosys.run("read_verilog stored.v; proc; memory_collect; write_rtlil stored.il", tmp_path)
    ((size, bits),) = re.findall(r"parameter \\INIT (\d+)'([01]+)", (tmp_path / "stored.il").read_text())
    assert int(size) == 12 * len(words)
    assert [int(bits[end - 12 : end], 2) for end in range(len(bits), 0, -12)] == words


def test_yosys_errors_are_passed_on():
    with pytest.raises(RuntimeError) as caught:
        exported("proposed", top="a b")
    assert str(caught.value).startswith("Yosys could not write a b: ")
