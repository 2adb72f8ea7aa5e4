"""Proofs, for all time and all inputs: k-induction over the blocks and over whole cores, by SymbiYosys with Yices.

Each proof is also put to designs with a fault, where it must find a counterexample from reset, and the situations that
matter are shown to be reachable. FORMAL_FULL_SIZE=1 proves the window at 640x480, too: some minutes.
"""

import os
from unittest import mock

import cores
import numpy as np
import pytest
import rigs
from amaranth.back import rtlil
from amaranth.hdl import Assert, Cover, Elaboratable, Module, Signal
from formal import configurations
from formal.arithmetic import AccumulatorProof, DifferenceProof, DividerProof
from formal.capture import CaptureProof
from formal.configurations import tagged_core
from formal.core import any_core
from formal.interpolation import BilinearProof, PauseProof
from formal.mutant import mutant
from formal.ports import BITS, PortProof
from formal.prove import NotProved, cover, prove
from formal.streams import FramesProof, StabilityProof, WaitsProof, ZeroStallProof
from formal.window import WindowProof

from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST
from hdl.arithmetic.differences import DifferenceForm
from hdl.arithmetic.linear import LinearForm
from hdl.datapaths.polynomial import Polynomial
from hdl.geometry.coordinates import Border
from hdl.stream.bilinear import Bilinear
from hdl.stream.ports import InputRegister, OutputSkid
from hdl.stream.rectifier import Rectifier

VGA = (640, 480, -11, 14)  # width, height, d_lo, d_hi: about as the embedded rig has them
FULL_SIZE = pytest.mark.skipif(not os.environ.get("FORMAL_FULL_SIZE"), reason="minutes long: set FORMAL_FULL_SIZE=1")


PIPELINES = pytest.mark.parametrize("pipeline", [COMPACT, BALANCED, FAST], ids=lambda pipeline: pipeline.name)


@pytest.mark.parametrize(
    "parameters",
    [
        any_core(8, 6, -1, 1, latency=3),
        any_core(9, 6, -1, 1, latency=3, pipeline=BALANCED),
        any_core(11, 6, -1, 1, latency=3, pipeline=FAST),
        cores.parameters("accumulate", channels=3),
    ],
    ids=["compact", "balanced", "fast", "accumulate"],
)
def test_beats_stay_until_they_are_taken(parameters, tmp_path):
    prove(StabilityProof(parameters), tmp_path)


@pytest.mark.parametrize(
    "window, options",
    [
        ((5, 6, -1, 1), {"reach": 1}),
        ((4, 4, -1, 1), {"reach": 0}),
        ((7, 7, -1, 2), {"latency": 3, "warm_up": 5}),
        ((5, 5, -1, 2), {"latency": 2, "border": Border("replicate")}),
        ((6, 7, 2, 3), {"latency": 2, "border": Border("constant", 200), "reach": 1}),
        ((5, 5, -3, -2), {}),
        ((5, 5, 3, 3), {"latency": 1}),
        ((4, 4, -3, 2), {"latency": 1}),
        ((7, 4, -1, 1), {"pipeline": BALANCED, "latency": 1, "reach": 1}),
        ((6, 4, 0, 1), {"pipeline": BALANCED, "border": Border("replicate")}),
        ((8, 4, 0, 1), {"pipeline": FAST, "warm_up": 3, "reach": 1}),
        pytest.param(VGA, {}, marks=FULL_SIZE),
        pytest.param(VGA, {"latency": 24, "warm_up": 16}, marks=FULL_SIZE),
        pytest.param(VGA, {"latency": 24, "warm_up": 16, "pipeline": FAST}, marks=FULL_SIZE),
    ],
    ids=str,
)
def test_windows_hold_the_wanted_pixels_whatever_the_streams_do(window, options, tmp_path):
    prove(WindowProof(tagged_core(*window, **options), lemmas=True), tmp_path)


def test_windows_hold_the_wanted_pixels_from_memories_in_slices(tmp_path):
    with mock.patch("hdl.stream.bank.STACKED", 0):
        proof = WindowProof(tagged_core(4, 4, -1, 1), lemmas=True)
        assert [len(memories) for memories in proof.core.bank(0, 0)] == [8]
        prove(proof, tmp_path)


def test_windows_hold_the_wanted_pixels_from_blocks_on_each_other(tmp_path):
    with mock.patch("hdl.stream.bank._BLOCKS", ((4, 16),)):
        proof = WindowProof(tagged_core(8, 3, 0, 1, pipeline=FAST, reach=1), lemmas=True)
        assert len(proof.core.bank(0, 0)) == 2
        prove(proof, tmp_path)


def test_windows_hold_the_wanted_pixels_where_the_ring_is_too_long_for_a_table(tmp_path):
    with mock.patch("hdl.stream.ring._TABLE_ROWS", 0):
        proof = WindowProof(tagged_core(7, 4, 0, 1, pipeline=BALANCED, reach=1), lemmas=True)
        assert proof.parameters.line_buffer.place_latency == 2
        prove(proof, tmp_path)


def test_windows_are_read_in_all_situations(tmp_path):
    cover(WindowProof(tagged_core(3, 4, -1, 1), covers=True), tmp_path, 20)


@pytest.mark.parametrize(
    "window, options",
    [
        ((8, 6, -1, 1), {"latency": 3}),
        ((3, 3, 0, 1), {}),
        ((8, 7, -4, 0), {"warm_up": 7}),
        ((5, 9, -8, 7), {}),
        ((9, 5, 2, 3), {"latency": 6}),
        ((6, 3, 0, 1), {"pipeline": BALANCED}),
        ((14, 7, -4, 0), {"warm_up": 7, "pipeline": BALANCED}),
        ((12, 9, -8, 7), {"latency": 3, "pipeline": FAST}),
        (VGA, {"latency": 24, "warm_up": 16}),
        (VGA, {"latency": 24, "warm_up": 16, "pipeline": FAST}),
    ],
    ids=str,
)
def test_input_never_stalls_while_the_output_is_ready(window, options, tmp_path):
    prove(ZeroStallProof(any_core(*window, **options)), tmp_path)


@pytest.mark.parametrize(
    "window, options",
    [
        ((8, 6, -1, 1), {"latency": 3}),
        ((3, 3, 0, 1), {}),
        ((8, 7, -4, 0), {"warm_up": 7}),
        ((9, 5, 2, 3), {}),
        ((6, 3, 0, 1), {"pipeline": BALANCED}),
        ((14, 7, -4, 0), {"warm_up": 7, "pipeline": BALANCED}),
        ((12, 5, 2, 3), {"latency": 3, "pipeline": FAST}),
    ],
    ids=str,
)
def test_input_waits_for_no_longer_than_the_output_did_and_pixels_are_missing(window, options, tmp_path):
    prove(WaitsProof(any_core(*window, **options)), tmp_path)


@pytest.mark.parametrize("pipeline, clocks", [(COMPACT, 20), (BALANCED, 36)], ids=["compact", "balanced"])
def test_input_may_wait_for_as_long_as_there_is_cause(pipeline, clocks, tmp_path):
    cover(configurations.waits(pipeline), tmp_path, clocks)


def test_frames_come_in_back_to_back(tmp_path):
    cover(configurations.zero_stall(), tmp_path, 28)


@pytest.mark.parametrize(
    "window, options",
    [
        ((8, 6, -1, 1), {"latency": 3}),
        ((3, 3, 0, 1), {}),
        ((7, 5, -2, 3), {"warm_up": 6}),
        ((32, 24, -4, 5), {"latency": 9}),
        ((6, 3, 0, 1), {"pipeline": BALANCED}),
        ((14, 7, -4, 0), {"warm_up": 7, "pipeline": BALANCED}),
        ((12, 5, 2, 3), {"latency": 3, "pipeline": FAST}),
        pytest.param(VGA, {"latency": 24, "warm_up": 16}, marks=FULL_SIZE),
    ],
    ids=str,
)
def test_every_frame_drains_and_no_beat_waits_for_ever(window, options, tmp_path):
    prove(FramesProof(any_core(*window, **options)), tmp_path)


def test_a_frame_may_take_as_long_as_the_bound_says(tmp_path):
    cover(configurations.frames(), tmp_path, 28)


@pytest.mark.parametrize("width, height, ahead", [(5, 3, False), (640, 480, False), (5, 1, True), (640, 480, True)])
def test_capture_gives_out_whole_frames_whatever_comes_in(width, height, ahead, tmp_path):
    prove(CaptureProof(width, height, ahead), tmp_path)


def test_capture_meets_every_kind_of_broken_frame(tmp_path):
    cover(CaptureProof(3, 2, lemmas=False), tmp_path, 8)


# The smallest or largest values of these are those of their formats, in each corner of the frame.
@pytest.mark.parametrize("a, b, c", [(1, 16, -128), (-1, 16, -113), (1, -16, 112), (-1, -16, 127), (-1, -16, 255)])
def test_accumulators_follow_their_form_to_the_ends_of_its_format(a, b, c, tmp_path):
    form = LinearForm(a, b, c, 0, 16, 16)
    assert form.format.width == 8
    prove(AccumulatorProof(form), tmp_path)


@pytest.mark.parametrize("name", ["proposed", "affine"])
@pytest.mark.parametrize("axis", ["u_form", "v_form"])
def test_accumulators_of_a_fitted_datapath_never_overflow(name, axis, tmp_path):
    prove(AccumulatorProof(getattr(cores.parameters(name).datapath, axis)), tmp_path)


@pytest.mark.parametrize("rig, axis, degree", [("zoomed", "v_form", 2), ("toed_in", "u_form", 3)])
def test_differences_of_a_fitted_datapath_never_overflow(rig, axis, degree, tmp_path):
    form = getattr(Polynomial.fit(rigs.view(rig, "left", 19, 16), 5), axis)
    assert form.degree == degree
    prove(DifferenceProof(form), tmp_path)


@pytest.mark.parametrize(
    "coefficients, cell_width, cell_height",
    [
        # In each of these a value or a difference is the least or the greatest of its format.
        ([[-64, 3, 1], [9, -2, 0], [0, 0, 0]], 1, 1),
        ([[0, -8, -4], [3, 5, 0], [-7, 0, 0]], 4, 4),
        ([[0, 4, 8], [12, 8, 0], [-16, 0, 0]], 2, 2),
        ([[1, 0, 0, 1], [0, 0, -1, 0], [0, 2, 0, 0], [1, 0, 0, 0]], 2, 1),
        ([[-1, 1, 0, 0, 1], [1, 0, 0, 1, 0], [1, 0, -1, 0, 0], [0, -1, 0, 0, 0], [1, 0, 0, 0, 0]], 1, 1),
    ],
)
def test_differences_follow_their_polynomial(coefficients, cell_width, cell_height, tmp_path):
    prove(DifferenceProof(DifferenceForm(np.array(coefficients), cell_width, cell_height, 0, 9, 7)), tmp_path)


@pytest.mark.parametrize(
    "dividends, bits",
    [
        ([(5, 1), (4, 0)], {"divisor_bits": 4, "quotient_bits": 5}),
        ([(6, 2)], {"divisor_bits": 5, "quotient_bits": 6}),
    ],
    ids=str,
)
def test_quotients_are_floors(dividends, bits, tmp_path):
    prove(DividerProof(dividends, **bits), tmp_path)


def test_divisions_leave_remainders(tmp_path):
    cover(DividerProof([(5, 1), (4, 0)], divisor_bits=4, quotient_bits=5, lemmas=False), tmp_path, 8)


@pytest.mark.parametrize(
    "pipeline, pixel_bits, channels, fraction_bits, lead",
    [
        (COMPACT, 3, 1, 2, 1),
        (COMPACT, 1, 3, 3, 1),
        (BALANCED, 3, 1, 2, 2),
        (BALANCED, 1, 3, 3, 2),
        (BALANCED, 1, 1, 4, 2),
        (BALANCED, 1, 1, 5, 2),
        (FAST, 2, 1, 2, 4),
        (FAST, 1, 3, 3, 4),
        (FAST, 1, 1, 4, 4),
        (FAST, 1, 1, 5, 4),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_pixels_are_the_weighted_sums_of_their_taps(pipeline, pixel_bits, channels, fraction_bits, lead, tmp_path):
    proof = BilinearProof(pixel_bits, channels, fraction_bits, lead, pipeline)
    prove(proof, tmp_path, proof.depth)


@PIPELINES
def test_the_interpolator_waits_in_pauses(pipeline, tmp_path):
    prove(PauseProof(Bilinear(8, 3, 5, 2, pipeline)), tmp_path)


@pytest.mark.parametrize("block", [InputRegister, OutputSkid])
def test_registers_at_the_streams_lose_no_beat(block, tmp_path):
    prove(PortProof(block(BITS)), tmp_path)


def test_a_beat_that_was_set_aside_comes_out(tmp_path):
    cover(PortProof(OutputSkid(BITS), lemmas=False), tmp_path, 8)


class Count(Elaboratable):
    """A counter to six, and what the test says of it."""

    def __init__(self, *statements):
        self._statements = statements

    def elaborate(self, platform):
        m, count = Module(), Signal(3)
        m.d.sync += count.eq(count + (count != 6))
        m.d.comb += [kind(fact(count), message) for kind, fact, message in self._statements]
        return m


def test_what_is_not_proved_is_named(tmp_path):
    six, five = (Assert, lambda count: count <= 6, "six"), (Assert, lambda count: count <= 5, "five")
    seven = Cover, lambda count: count == 7, "seven"
    assert prove(Count(six), tmp_path / "six").status == "PASS"
    with pytest.raises(NotProved, match=r"^five \(6 clocks after reset; .*five\)$"):
        prove(Count(six, five), tmp_path / "five", depth=8)
    with pytest.raises(NotProved, match=r"^not two \(induction step; .*not-two\)$"):
        prove(Count((Assert, lambda count: count[1:] != 3, "not two")), tmp_path / "not-two")
    with pytest.raises(NotProved, match=r"^out of reach within 9 clocks: seven \("):
        cover(Count(six, seven, (Cover, lambda count: count == 6, "reached")), tmp_path / "seven", 9)
    with pytest.raises(ValueError, match="needs a message"):
        prove(Count((Assert, lambda count: count <= 6, "")), tmp_path / "nameless")
    with (
        pytest.raises(ValueError, match="^hdl.stream.flow: 'no such text' occurs 0 times, not once$"),
        mutant("hdl.stream.flow", "no such text", ""),
    ):
        pass


def test_no_assertion_reaches_a_core():
    assert "$check" not in rtlil.convert(Rectifier(cores.parameters()), emit_src=False)
