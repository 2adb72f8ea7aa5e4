"""Each proof is put to designs with a fault, where it must find a counterexample from reset."""

import numpy as np
import pytest
from formal.arithmetic import AccumulatorProof, BilinearProof, DifferenceProof, DividerProof
from formal.capture import CaptureProof
from formal.core import any_core
from formal.mutant import mutant
from formal.prove import refute
from formal.streams import FramesProof, StabilityProof, WaitsProof, ZeroStallProof
from formal.window import WindowProof, tag_bits

from hdl.arithmetic.differences import DifferenceForm
from hdl.arithmetic.linear import LinearForm


def tagged_core(width, height, d_lo, d_hi, **options):
    return any_core(width, height, d_lo, d_hi, tag_bits=tag_bits(width, height), **options)


def stability():
    return StabilityProof(any_core(4, 4, 0, 1))


def zero_stall():
    return ZeroStallProof(any_core(3, 3, 0, 1), lemmas=False)


def waits():
    return WaitsProof(any_core(3, 3, 0, 1), lemmas=False)


def frames():
    return FramesProof(any_core(3, 3, 0, 1), lemmas=False)


def capture():
    return CaptureProof(3, 2, lemmas=False)


def windows(*window, steady=True, **options):
    return lambda: WindowProof(tagged_core(*window, reach=1, **options), steady=steady)


def accumulator(*form):
    return lambda: AccumulatorProof(LinearForm(*form), lemmas=False)


def difference(*form):
    return lambda: DifferenceProof(DifferenceForm(np.array(form[0]), *form[1:]), lemmas=False)


def divider():
    return DividerProof([(5, 1), (4, 0)], divisor_bits=4, quotient_bits=5, lemmas=False)


def bilinear():
    return BilinearProof(3, 1, 2, lemmas=False)


# Module, text, faulty text, proof, clocks, assertion that fails.
FAULTS = {
    "the pipeline moves while a beat waits": (
        "hdl.stream.rectifier",
        "enable.eq(~m_axis.tvalid | m_axis.tready)",
        "enable.eq(1)",
        stability,
        12,
        "m_axis: tdata, tuser and tlast stay until tready",
    ),
    "the last register moves while a beat waits": (
        "hdl.stream.bilinear",
        "with m.If(self.enable):\n                m.d.sync += self.pixel",
        "with m.If(1):\n                m.d.sync += self.pixel",
        stability,
        12,
        "m_axis: tdata, tuser and tlast stay until tready",
    ),
    "rows are written one row too early": (
        "hdl.stream.flow",
        "ahead != self._lead + 2",
        "ahead != self._lead + 3",
        windows(3, 4, 0, 1, steady=False),
        10,
        "tap (0, 0) is not read while it is written",
    ),
    "rows are read one row too early": (
        "hdl.stream.flow",
        "(ahead > self._lead)",
        "(ahead >= self._lead)",
        windows(3, 5, -1, 1),
        10,
        "tap (1, 0) is read from a complete row",
    ),
    "one row too few is kept": (
        "hdl.geometry.coordinates",
        "spread + 3 + (spread + 3) % 2",
        "spread + 2 + (spread + 2) % 2",
        windows(3, 5, -1, 1),
        20,
        "tap (1, 0) is not read while it is written",
    ),
    "the ring is read one slot too far": (
        "hdl.stream.linebuffer",
        "unwrapped >= p.rows,",
        "unwrapped > p.rows,",
        windows(3, 5, -1, 1),
        14,
        "tap (1, 1) is the wanted pixel",
    ),
    "the lower row wraps one slot too late": (
        "hdl.stream.linebuffer",
        "slot == p.rows - 1, 0,",
        "slot == p.rows, 0,",
        windows(3, 5, -1, 1),
        14,
        "tap (1, 1) is the wanted pixel",
    ),
    "the ring is written one slot too far": (
        "hdl.stream.linebuffer",
        "base == (p.rows // 2 - 1) * p.pitch",
        "base == p.rows // 2 * p.pitch",
        windows(3, 5, -1, 1),
        30,
        "tap (1, 1) is the wanted pixel",
    ),
    "the offset forgets that a frame ended": (
        "hdl.stream.linebuffer",
        "Mux(self.end_of_frame, p.height % 2**bits, 0)",
        "0",
        windows(3, 5, -1, 1),
        30,
        "tap (1, 1) is not read while it is written",
    ),
    "the offset does not wait for the datapath": (
        "hdl.stream.rectifier",
        "issue & raster.end_of_line, to_window",
        "issue & raster.end_of_line, 0",
        windows(4, 5, -1, 1, latency=1),
        24,
        "tap (1, 0) is the wanted pixel",
    ),
    "warming up counts as a row": (
        "hdl.stream.rectifier",
        "flow.row_issued.eq(issue",
        "flow.row_issued.eq(step",
        windows(4, 5, -1, 1, warm_up=2),
        10,
        "tap (0, 0) is read from a complete row",
    ),
    "missing lines are declared while the buffer is full": (
        "hdl.stream.capture",
        "(missing_lines & self.may_write)",
        "missing_lines",
        windows(3, 4, 0, 1, steady=False),
        10,
        "tap (0, 0) is not read while it is written",
    ),
    "a pixel beyond the line is written": (
        "hdl.stream.capture",
        "self.x != self._width",
        "self.x != self._width + 1",
        windows(4, 4, 0, 1, steady=False),
        12,
        "tap (0, 0) is not read while it is written",
    ),
    "rows are written one row too late": (
        "hdl.stream.flow",
        "ahead != self._lead + 2",
        "ahead != self._lead + 1",
        zero_stall,
        12,
        "s_axis_tready is high",
    ),
    "rows are read one row too late": (
        "hdl.stream.flow",
        "(ahead > self._lead)",
        "(ahead > self._lead + 1)",
        zero_stall,
        14,
        "s_axis_tready is high",
    ),
    "the input waits for rows that are read one row too late": (
        "hdl.stream.flow",
        "(ahead > self._lead)",
        "(ahead > self._lead + 1)",
        waits,
        14,
        "no beat waits without a cause",
    ),
    "the last rows wait for the next frame": (
        "hdl.stream.flow",
        " | complete",
        "",
        frames,
        24,
        "a frame drains in time",
    ),
    "tlast is one beat early": (
        "hdl.stream.rectifier",
        "raster.end_of_line, to_output",
        "raster.end_of_line, to_output - 1",
        frames,
        14,
        "m_axis: tlast on a line's last beat only",
    ),
    "missing lines are waited for": (
        "hdl.stream.capture",
        " | (missing_lines & self.may_write)",
        "",
        frames,
        24,
        "a beat does not wait for ever",
    ),
    "the last pixel of a line is dropped": (
        "hdl.stream.capture",
        "self.x != self._width",
        "self.x != self._width - 1",
        capture,
        8,
        "no pixel of a frame's line is lost",
    ),
    "a frame that lacks lines does not end": (
        "hdl.stream.capture",
        "with m.If(self.frame_written):",
        "with m.If(self.frame_written & ~missing_lines):",
        capture,
        8,
        "any other beat waits only until a row may be written",
    ),
    "a row starts one column off": (
        "hdl.arithmetic.linear",
        "(form.width - 1) * form.a",
        "form.width * form.a",
        accumulator(3, 5, -8, 0, 5, 4),
        10,
        "the value is the linear form's",
    ),
    "a format is one bit short": (
        "hdl.arithmetic.linear",
        "min(corners), max(corners)",
        "min(corners) + 1, max(corners)",
        accumulator(-1, -4, -1, 0, 5, 4),
        24,
        "the value is the linear form's",
    ),
    "a difference has no jump": (
        "hdl.arithmetic.differences",
        "Mux(self.end_of_line, value(jumps[0]), along)",
        "Mux(self.end_of_line, 0, along)",
        difference([[0, 4, 8], [12, 8, 0], [-16, 0, 0]], 2, 2, 0, 5, 3),
        12,
        "the value is the polynomial's",
    ),
    "a difference changes within a cell": (
        "hdl.arithmetic.differences",
        "along = Mux(end_of_cell, along, 0)",
        "along = Mux(1, along, 0)",
        difference([[0, 4, 8], [12, 8, 0], [-16, 0, 0]], 2, 2, 0, 5, 3),
        12,
        "the value is the polynomial's",
    ),
    "a difference has a bit too few": (
        "hdl.arithmetic.differences",
        "Q.covering(self.lowest, self.highest, 0).width - self.fixed_bits",
        "Q.covering(self.lowest, self.highest, 0).width - self.fixed_bits - 1",
        difference([[0, 4, 8], [12, 8, 0], [-16, 0, 0]], 2, 2, 0, 5, 3),
        20,
        "the value is the polynomial's",
    ),
    "a subtraction has no carry": (
        "hdl.arithmetic.divider",
        "Cat(subtract, operand)",
        "Cat(0, operand)",
        divider,
        8,
        "quotient 0 is the floor",
    ),
    "the rows' weights are not exchanged": (
        "hdl.stream.bilinear",
        "weight[i] ^ swapped",
        "weight[i]",
        bilinear,
        6,
        "channel 0 is the weighted sum of its taps",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found(fault, tmp_path):
    module, text, faulty, proof, clocks, assertion = FAULTS[fault]
    with mutant(module, text, faulty):
        failed = refute(proof(), tmp_path, clocks)
    # The solver may name any of the taps that are wrong.
    assert {name.partition(")")[2] or name for name in failed} & {assertion.partition(")")[2] or assertion}
