"""Programs of fixed-point steps: the hardware against the integer model, and that against real numbers."""

import numpy as np
import pytest
from amaranth import Module, Signal, signed
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from hdl.arithmetic.cuts import COMPACT, PIPELINES
from hdl.arithmetic.fixedpoint import Q
from hdl.arithmetic.pipeline import Pipeline
from hdl.arithmetic.products import Products
from hdl.arithmetic.steps import Product, Quotient, Scaled, Sum, delays, evaluate, in_range
from sim.drivers import feed, observe, pauses, simulate

# x comes 2 clocks late, y in the clock of its position.
GIVEN = {"x": (9, 4, 2), "y": (11, 6, 0)}  # bits, fraction bits, delay
POLYNOMIAL = (
    Product("square", 1, "x", "x", 0),
    Product("product", 3, "square", "y", -12345),
    Scaled("scaled", 4, "product", -43, 5, 77),
    Sum("sum", 4, "scaled", "x"),
    Sum("result", 0, "sum", "y"),
)
RATIO = (
    Scaled("numerator", 7, "y", 3, 2, 1 << 14),
    Scaled("denominator", 6, "x", 5, 3, 1 << 14),
    Quotient("ratio", 9, "numerator", "denominator", 0),
    Product("wide", 13, "ratio", "x", 0),
    Sum("result", 14, "wide", "ratio"),
)


def operands(count, seed):
    generator = np.random.default_rng(seed)
    return {
        name: (generator.integers(-1 << (bits - 1), 1 << (bits - 1), count), fraction)
        for name, (bits, fraction, _) in GIVEN.items()
    }


def scheduled(steps, formats, products):
    """`delays` with the clocks that the products take; what is given has all of its bits."""
    operands = {name: (q.width + (not q.is_signed), q.fraction_bits) for name, q in formats.items()}
    operands |= {name: (bits, fraction) for name, (bits, fraction, _) in GIVEN.items()}
    operands |= {step.name: (step.quotient_bits, step.bits) for step in steps if isinstance(step, Quotient)}
    given = {name: delay for name, (_, _, delay) in GIVEN.items()}
    return delays(steps, given, lambda step: products.step_clocks(step, [operands[name] for name in step.operands]))


class Block(wiring.Component):
    """A program whose given values come from the same clock, delayed here as `GIVEN` says."""

    def __init__(self, steps, values, products):
        self._steps, self._products = steps, products
        self._formats = {name: Q.covering(min(0, v.min()), max(0, v.max()), bits) for name, (v, bits) in values.items()}
        self.latency = scheduled(steps, self._formats, products)["result"]
        super().__init__(
            {
                "enable": In(1),
                **{name: In(signed(bits)) for name, (bits, _, _) in GIVEN.items()},
                "result": Out(self._formats["result"].shape),
            }
        )

    def elaborate(self, platform):
        m = Module()
        pipeline = Pipeline(m, self.enable, self._formats, self._products)
        for name, (_, fraction_bits, delay) in GIVEN.items():
            value = getattr(self, name)
            for _ in range(delay):
                later = Signal.like(value, reset_less=True)
                with m.If(self.enable):
                    m.d.sync += later.eq(value)
                value = later
            pipeline.give(name, value, fraction_bits, delay)
        for step in self._steps:
            pipeline.add(step)
        m.d.comb += self.result.eq(pipeline.value("result", self.latency))
        return m


@pytest.mark.parametrize("steps", [POLYNOMIAL, RATIO], ids=["polynomial", "ratio"])
@pytest.mark.parametrize("dsp", [True, False])
@pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)
@pytest.mark.parametrize("share", [0.0, 0.4], ids=["every clock", "with gaps"])
def test_hardware_computes_the_integer_model(steps, dsp, pipeline, share):
    given = operands(200, seed=3)
    values = evaluate(steps, given)
    assert in_range(steps, values)
    block = Block(steps, values, Products(dsp, pipeline))
    stimuli = [(int(x), int(y)) for x, y in zip(given["x"][0], given["y"][0])]
    _, results = simulate(
        block,
        feed(block.enable, [block.x, block.y], stimuli, pauses(share, 5, burst=2)),
        observe(block.enable, [block.result], len(stimuli), block.latency),
        clocks=2000,
    )
    assert [value for (value,) in results] == values["result"][0].tolist()


def test_delays_count_the_longest_way():
    clocks = delays(POLYNOMIAL, {"x": 2, "y": 0})
    assert clocks == {"x": 2, "y": 0, "square": 3, "product": 4, "scaled": 5, "sum": 6, "result": 7}
    # A bit each of the quotient, 1 before the point and 9 after it.
    assert delays(RATIO, {"x": 2, "y": 0})["ratio"] == 3 + 10


@pytest.mark.parametrize("dsp", [True, False])
def test_only_products_take_more_clocks_with_registers_within(dsp):
    values = evaluate(RATIO, operands(200, seed=3))
    formats = {name: Q.covering(min(0, v.min()), max(0, v.max()), bits) for name, (v, bits) in values.items()}
    given = {"x": 2, "y": 0}
    compact = scheduled(RATIO, formats, Products(dsp, COMPACT))
    assert compact == delays(RATIO, given)
    for pipeline in PIPELINES.values():
        clocks = scheduled(RATIO, formats, Products(dsp, pipeline))
        for step in RATIO:
            took = clocks[step.name] - max(clocks[operand] for operand in step.operands)
            if pipeline.products and isinstance(step, Product | Scaled) and (dsp or step.name == "wide"):
                assert took > 1
            elif isinstance(step, Sum | Quotient):
                assert took == compact[step.name] - max(compact[operand] for operand in step.operands)


def real(values, name):
    stored, fraction_bits = values[name]
    return stored * 2.0**-fraction_bits


def test_model_rounds_products_half_up_and_sums_down():
    values = evaluate(POLYNOMIAL, operands(5000, seed=1))
    x, y = real(values, "x"), real(values, "y")
    np.testing.assert_array_equal(real(values, "square"), np.floor(x**2 * 2 + 0.5) / 2)
    exact = real(values, "square") * y - 12345 * 2.0**-7
    np.testing.assert_array_equal(real(values, "product"), np.floor(exact * 8 + 0.5) / 8)
    exact = real(values, "product") * (-43 / 32) + 77 * 2.0**-8
    np.testing.assert_array_equal(real(values, "scaled"), np.floor(exact * 16 + 0.5) / 16)
    np.testing.assert_array_equal(real(values, "result"), np.floor(real(values, "scaled") + x + y))


def test_quotients_are_rounded_down():
    values = evaluate(RATIO, operands(5000, seed=2))
    exact = real(values, "numerator") / real(values, "denominator") - 1
    np.testing.assert_array_equal(real(values, "ratio"), np.floor(exact * 512) / 512)


@pytest.mark.parametrize("x, y, fits", [(0, 0, True), (-256, 0, False), (0, -1025, False), (-120, 1023, False)])
def test_what_a_divider_cannot_hold_is_known(x, y, fits):
    steps = (
        Scaled("denominator", 4, "x", 1, 0, 256),
        Scaled("numerator", 6, "y", 1, 0, 1024),
        Quotient("ratio", 4, "numerator", "denominator", 0),
    )
    values = evaluate(steps, {"x": (np.array([x]), 4), "y": (np.array([y]), 6)})
    assert in_range(steps, values) == fits


@pytest.mark.parametrize("bits, fits", [(30, True), (31, False)])
@pytest.mark.parametrize(
    "step",
    [Product("a", 0, "x", "y", 1 << 61), Scaled("a", 0, "x", -(1 << 31), 0, 1), Sum("a", 31, "x", "y")],
    ids=["product", "scaled", "sum"],
)
def test_what_int64_cannot_hold_is_known(step, bits, fits):
    # y has 31 fraction bits, which the sum gives to x too.
    given = {"x": (np.array([1 << bits]), 0), "y": (np.array([-1 << bits]), 31)}
    assert in_range([step], evaluate([step], given)) == fits
