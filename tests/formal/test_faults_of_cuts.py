"""Each register of a pipeline with a fault of its own, where the proofs must find a counterexample from reset."""

from unittest import mock

import pytest
from formal.configurations import (
    WIDTHS,
    bilinear,
    capture,
    input_register,
    output_skid,
    pauses,
    waits,
    windows,
    zero_stall,
)
from formal.mutant import mutant
from formal.prove import refute

from hdl.arithmetic.cuts import BALANCED, FAST

NARROW, WIDE = WIDTHS[BALANCED], WIDTHS[FAST]


def balanced(proof):
    return lambda: proof(BALANCED)


# Module, text, faulty text, proof, clocks, assertion that fails.
FAULTS = {
    "a row counts as issued with its first position": (
        "hdl.stream.raster",
        "(self.near_end, self._width - 1 - NEAR)",
        "(self.near_end, 0)",
        windows(NARROW, 4, 0, 1, steady=False, pipeline=BALANCED),
        20,
        "tap (0, 0) is read from a complete row",
    ),
    "a row counts as issued too late for the next one": (
        "hdl.stream.raster",
        "(self.near_end, self._width - 1 - NEAR)",
        "(self.near_end, self._width - 2)",
        windows(NARROW, 4, 0, 1, steady=False, pipeline=BALANCED),
        20,
        "tap (0, 1) is read from a complete row",
    ),
    "the permission is not renewed at a row's end": (
        "hdl.stream.issue",
        "Mux(self.step & self.end_of_line, self.may_issue, permitted | self.may_issue)",
        "permitted | self.may_issue",
        windows(NARROW, 4, 0, 1, steady=False, pipeline=BALANCED),
        20,
        "tap (0, 1) is read from a complete row",
    ),
    "the permission comes a row late": (
        "hdl.stream.flow",
        "enough | complete",
        "(enough & margin[0]) | complete",
        balanced(zero_stall),
        30,
        "s_axis_tready is high",
    ),
    "a row counts as issued with its last position, and the input waits": (
        "hdl.stream.issue",
        "self.row_issued.eq(self.issue & self.near_end)",
        "self.row_issued.eq(self.issue & self.end_of_line)",
        balanced(waits),
        30,
        "no beat waits without a cause",
    ),
    "the next row's place forgets that a frame ended": (
        "hdl.stream.ring",
        "Mux(last_row, self._height % 2**bits, 0)",
        "0",
        windows(NARROW, 3, 0, 1, pipeline=BALANCED),
        40,
        "tap (1, 1) is not read while it is written",
    ),
    "the table of places is a slot off": (
        "hdl.stream.ring",
        "place // 2 % (self._rows // 2)",
        "(place + 1) // 2 % (self._rows // 2)",
        windows(NARROW, 3, 0, 1, pipeline=BALANCED),
        26,
        "tap (1, 1) is not read while it is written",
    ),
    "a pixel is written without its register": (
        "hdl.stream.linebuffer",
        'clocks.after(f"write_{row}_{col}", enable, p.pipeline.writes)',
        "enable",
        windows(NARROW, 3, 0, 1, pipeline=BALANCED),
        26,
        "tap (1, 1) is the wanted pixel",
    ),
    "the border comes a clock early": (
        "hdl.stream.linebuffer",
        "p.pipeline.address + p.bank.latency)",
        "p.pipeline.address + p.bank.latency - 1)",
        windows(NARROW, 3, 0, 1, pipeline=BALANCED),
        26,
        "tap (1, 1) outside is the border's value",
    ),
    "addresses have a register too many": (
        "hdl.stream.linebuffer",
        'stages.after(f"address_{place}", address, p.pipeline.address)',
        'stages.after(f"address_{place}", address, 2)',
        windows(WIDE, 3, 0, 1, pipeline=FAST),
        30,
        "tap (1, 1) is the wanted pixel",
    ),
    "blocks are chosen between a clock early": (
        "hdl.stream.bank",
        "self._memory(address), self._layout.latency)",
        "self._memory(address), self._layout.latency - 1)",
        windows(WIDE, 3, 0, 1, pipeline=FAST),
        30,
        "tap (1, 1) is the wanted pixel",
    ),
    "a block is written for all on each other": (
        "hdl.stream.bank",
        "enable & (self._memory(address) == index)",
        "enable",
        windows(WIDE, 3, 0, 1, pipeline=FAST),
        40,
        "tap (1, 1) is not read while it is written",
    ),
    "the last line is known a line late": (
        "hdl.stream.capture",
        "is_last_line.eq(y == (self._height - 2) % self._height)",
        "is_last_line.eq(y == self._height - 1)",
        lambda: capture(ahead=True),
        10,
        "a frame has its height in rows",
    ),
    "a line is full a pixel late": (
        "hdl.stream.capture",
        "line_is_full.eq(self.x == self._width - 1)",
        "line_is_full.eq(self.x == self._width)",
        lambda: capture(ahead=True),
        10,
        "pixels are written column by column",
    ),
    "a beat that stands aside is lost": (
        "hdl.stream.ports",
        "Mux(standing, aside, self.i)",
        "self.i",
        output_skid,
        8,
        "beats come out as they went in",
    ),
    "what stands aside moves with the output": (
        "hdl.stream.ports",
        "with m.If(self.enable):\n            m.d.sync += aside",
        "with m.If(self.o_ready):\n            m.d.sync += aside",
        output_skid,
        8,
        "beats come out as they went in",
    ),
    "a beat at the input does not wait": (
        "hdl.stream.ports",
        "self.i_ready.eq(~self.o_valid | self.o_ready)",
        "self.i_ready.eq(1)",
        input_register,
        8,
        "the beats that are held are missing at the output",
    ),
    "a negative digit is a unit too low": (
        "hdl.stream.blend",
        "Cat(upper, Const(rounds, 1), value)",
        "Cat(Const(0, 1), Const(rounds, 1), value)",
        bilinear(BALANCED),
        10,
        "channel 0 is the weighted sum of its taps",
    ),
    "digits do not round": (
        "hdl.stream.blend",
        "rounds = half and",
        "rounds = False and",
        bilinear(BALANCED),
        10,
        "channel 0 is the weighted sum of its taps",
    ),
    "the highest digit is not doubled": (
        "hdl.stream.blend",
        "Mux(digit[1], difference << 1,",
        "Mux(digit[1], difference,",
        bilinear(BALANCED, 3),
        10,
        "channel 0 is the weighted sum of its taps",
    ),
    "the tree does not round": (
        "hdl.stream.blend",
        "half and exponent == exponents[-1])",
        "False)",
        bilinear(FAST),
        10,
        "channel 0 is the weighted sum of its taps",
    ),
    "the rows' weights come before their taps": (
        "hdl.stream.bilinear",
        "self._lead + blend.latency",
        "blend.latency",
        bilinear(FAST),
        10,
        "channel 0 is the weighted sum of its taps",
    ),
    "a digit moves in a pause": (
        "hdl.stream.blend",
        'stages.after(f"{step}_digits"',
        'Stages(m, 1).after(f"{step}_digits"',
        pauses(BALANCED),
        6,
        "row_0_digits waits",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_register_is_found(fault, tmp_path):
    module, text, faulty, proof, clocks, assertion = FAULTS[fault]
    # Blocks of so few words that there are some on top of each other.
    with mock.patch("hdl.stream.bank._BLOCKS", ((4, 16),)), mutant(module, text, faulty):
        failed = refute(proof(), tmp_path, clocks)
    # The solver may name any of the taps that are wrong.
    assert {name.partition(")")[2] or name for name in failed} & {assertion.partition(")")[2] or assertion}
