"""Products with registers within: exact, and late by just the clocks that are told."""

import random

import numpy as np
import pytest
from amaranth import Module, signed, unsigned
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from hdl.arithmetic import dsp as dsp_blocks
from hdl.arithmetic.cuts import PIPELINES
from hdl.arithmetic.multiplier import signed_digits
from hdl.arithmetic.products import Products
from hdl.tools.verilog import convert
from sim.drivers import feed, observe, pauses, simulate

EACH_WAY = pytest.mark.parametrize("dsp", [True, False])
EACH_PIPELINE = pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)


class Block(wiring.Component):
    """a*b + constant without its last bits, or a*a, or a multiple of a; ``latency`` as `Products` has it."""

    def __init__(self, products, a, b, constant, dropped=0, factor=None):
        self.products, self.constant, self.dropped, self.factor = products, constant, dropped, factor
        bits = [shape.width + (not shape.signed) for shape in (a, b or a)]
        if factor is None:
            self.latency = products.product_clocks(*bits, constant, square=b is None)
        else:
            self.latency = products.scaled_clocks(bits[0], factor, constant)
        super().__init__({"enable": In(1), "a": In(a), "b": In(b or 1), "result": Out(signed(90))})
        self.square = b is None

    def elaborate(self, platform):
        m = Module()
        a, b = self.a, self.a if self.square else self.b
        options = m, self.enable, "it"
        if self.factor is not None:
            result = self.products.scaled(*options, a, self.factor, self.constant, signed(90), self.dropped)
        else:
            result = self.products.product(*options, a, b, self.constant, signed(90), self.dropped)
        m.d.comb += self.result.eq(result)
        return m


def some(shape, count, generator):
    most = 1 << (shape.width - shape.signed)
    least = -most if shape.signed else 0
    return [generator.choice([least, most - 1, generator.randrange(least, most)]) for _ in range(count)]


def assert_computes(block, function, a, b, dropped=0):
    operands = list(zip(a, b))
    _, results = simulate(
        block,
        feed(block.enable, [block.a, block.b], operands, pauses(0.3, 5, burst=2)),
        observe(block.enable, [block.result], len(operands), block.latency),
        clocks=200,
    )
    assert [value for (value,) in results] == [function(*pair) >> dropped for pair in operands]


@EACH_WAY
@EACH_PIPELINE
@pytest.mark.parametrize(
    "a, b",
    [
        (signed(1), unsigned(1)),
        (signed(5), unsigned(3)),
        (signed(15), signed(16)),
        (unsigned(25), signed(18)),  # a bit too wide for a block
        (signed(19), unsigned(20)),
        (signed(44), signed(37)),
    ],
    ids=repr,
)
@pytest.mark.parametrize("constant, dropped", [(0, 0), (-77, 3), (123456789012, 5)])
def test_products(dsp, pipeline, a, b, constant, dropped):
    generator = random.Random(a.width)
    block = Block(Products(dsp, pipeline), a, b, constant, dropped)
    assert_computes(block, lambda a, b: a * b + constant, some(a, 25, generator), some(b, 25, generator), dropped)


@EACH_WAY
@EACH_PIPELINE
@pytest.mark.parametrize("a", [signed(1), unsigned(7), signed(27)], ids=repr)
@pytest.mark.parametrize("constant, dropped", [(0, 0), (-1000, 2), (1 << 30, 0)])
def test_squares(dsp, pipeline, a, constant, dropped):
    block = Block(Products(dsp, pipeline), a, None, constant, dropped)
    assert_computes(block, lambda a, _: a * a + constant, some(a, 25, random.Random(1)), [0] * 25, dropped)


@EACH_WAY
@EACH_PIPELINE
@pytest.mark.parametrize("factor", [0, 1, -40, 0b1010101, 2**31 - 5])
@pytest.mark.parametrize("a, constant", [(signed(6), 0), (signed(26), -12345678901)])
def test_multiples(dsp, pipeline, factor, a, constant):
    block = Block(Products(dsp, pipeline), a, None, constant, factor=factor)
    assert_computes(block, lambda a, _: a * factor + constant, some(a, 25, random.Random(2)), [0] * 25)


def test_an_adder_follows_on_no_more_than_the_pipeline_lets():
    # Eight Booth digits, and an adder for what of a constant the first of their rows has no room for.
    clocks = {
        name: [Products(False, pipeline).product_clocks(16, 16, constant) for constant in (0, 1 << 20)]
        for name, pipeline in PIPELINES.items()
    }
    assert clocks == {"compact": [1, 1], "balanced": [4, 5], "fast": [8, 9]}
    digits = len(signed_digits(0b1010101))
    assert Products(False, PIPELINES["fast"]).scaled_clocks(10, 0b1010101, 0) == digits


def test_a_block_has_a_register_behind_its_multiplier_and_one_behind_its_adder():
    for pipeline, clocks in zip(PIPELINES.values(), ([1, 1], [2, 3], [2, 3])):
        assert [Products(True, pipeline).product_clocks(bits, 18, 5) for bits in (25, 26)] == clocks


@pytest.mark.parametrize("width", [1, 17, 18, 19, 25, 26, 49, 50, 73])
@pytest.mark.parametrize("most", [dsp_blocks.WIDE, dsp_blocks.NARROW])
def test_pieces_of_a_factor_fit_into_blocks(width, most):
    pieces = dsp_blocks.pieces(width, most)
    assert [bit for place, bits in pieces for bit in range(place, place + bits)] == list(range(width))
    assert all(bits < most for _, bits in pieces[:-1]) and pieces[-1][1] <= most
    # One piece more than another fits only where the last one, with the sign, is all that is left.
    assert len(pieces) == max(1, int(np.ceil((width - 1) / (most - 1))))


@EACH_PIPELINE
def test_the_verilog_multiplies_only_if_the_tool_may(pipeline):
    for dsp in (True, False):
        text = convert(Block(Products(dsp, pipeline), signed(30), signed(20), 5), "product")
        assert (" * " in text) == dsp
