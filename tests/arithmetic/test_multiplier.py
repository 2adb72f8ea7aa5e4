import itertools
import random

import pytest
from amaranth import Module, Signal, signed, unsigned
from amaranth.sim import Simulator

from hdl.arithmetic import multiplier
from hdl.arithmetic.multiplier import signed_digits


def assert_computes(build, function, shapes, operands):
    """Assert that the expression of ``build`` is ``function`` of each of ``operands``."""
    m = Module()
    inputs = [Signal(shape, name=f"operand_{index}") for index, shape in enumerate(shapes)]
    result = Signal(signed(60))
    m.d.comb += result.eq(build(m, *inputs))

    async def testbench(ctx):
        for values in operands:
            for signal, value in zip(inputs, values):
                ctx.set(signal, value)
            assert ctx.get(result) == function(*values), values

    simulator = Simulator(m)
    simulator.add_testbench(testbench)
    simulator.run()


def everything(*shapes):
    return itertools.product(*(values(shape) for shape in shapes))


def some(count, seed, *shapes):
    """Random operands, the extremes among them."""
    generator = random.Random(seed)
    for _ in range(count):
        yield [generator.choice([v[0], v[-1], generator.choice(v), generator.choice(v)]) for v in map(values, shapes)]


def values(shape):
    most = 1 << (shape.width - shape.signed)
    return range(-most if shape.signed else 0, most)


SIGNEDNESS = [signed, unsigned]


@pytest.mark.parametrize("constant", [0, 5, -77])
@pytest.mark.parametrize("a", SIGNEDNESS)
@pytest.mark.parametrize("b", SIGNEDNESS)
def test_every_small_product(a, b, constant):
    for shapes in itertools.product([a(1), a(2), a(4)], [b(1), b(3), b(4)]):
        assert_computes(
            lambda m, x, y: multiplier.product(m, "product", x, y, constant),
            lambda x, y: x * y + constant,
            shapes,
            everything(*shapes),
        )


@pytest.mark.parametrize("shapes", [(signed(18), signed(15)), (unsigned(11), signed(17)), (unsigned(16), unsigned(16))])
@pytest.mark.parametrize("constant", [0, 1 << 14, -123456789])
def test_wide_products(shapes, constant):
    assert_computes(
        lambda m, x, y: multiplier.product(m, "product", x, y, constant),
        lambda x, y: x * y + constant,
        shapes,
        some(200, 1, *shapes),
    )


@pytest.mark.parametrize("shape", [kind(width) for kind in SIGNEDNESS for width in (1, 2, 3, 6, 7)])
@pytest.mark.parametrize("constant", [0, 3, -100, 1000])
def test_every_small_square(shape, constant):
    assert_computes(
        lambda m, x: multiplier.square(m, "square", x, constant), lambda x: x * x + constant, [shape], everything(shape)
    )


@pytest.mark.parametrize("shape", [signed(17), unsigned(18), signed(20)])
def test_wide_squares(shape):
    assert_computes(
        lambda m, x: multiplier.square(m, "square", x, 4096), lambda x: x * x + 4096, [shape], some(300, 2, shape)
    )


@pytest.mark.parametrize("factor", [0, 1, -1, 7, -40, 93, 1000, -(2**20) - 1])
@pytest.mark.parametrize("shape", [signed(1), signed(5), unsigned(1), unsigned(4)])
@pytest.mark.parametrize("constant", [0, 3, -1000])
def test_every_small_multiple(factor, shape, constant):
    assert_computes(
        lambda m, x: multiplier.scaled(m, "multiple", x, factor, constant),
        lambda x: x * factor + constant,
        [shape],
        everything(shape),
    )


@pytest.mark.parametrize("factor", [0, 1, -1, 3, 7, -40, 93, 0b1010101, 2**31 - 1, -12345678])
def test_signed_digits_are_few_and_apart(factor):
    digits = signed_digits(factor)
    assert sum(digit << place for place, digit in digits) == factor
    places = [place for place, _ in digits]
    assert all(later - place >= 2 for place, later in itertools.pairwise(places))
    assert {digit for _, digit in digits} <= {1, -1}
