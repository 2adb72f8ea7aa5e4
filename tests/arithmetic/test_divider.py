import random

import pytest

from hdl.arithmetic.divider import Divider
from sim.drivers import feed, never, observe, pauses, simulate


def divide(divider, operands, count, pattern):
    """The quotients of (divisor, dividend_0, dividend_1, ...), one set an enabled clock."""
    inputs = [divider.divisor, *(getattr(divider, f"dividend_{i}") for i in range(count))]
    outputs = [getattr(divider, f"quotient_{i}") for i in range(count)]
    _, results = simulate(
        divider,
        feed(divider.enable, inputs, operands, pattern),
        observe(divider.enable, outputs, len(operands), divider.latency),
        clocks=10 * len(operands) + 200,
    )
    return results


def quotients(operands, shifts):
    return [
        tuple((dividend << shift) // divisor for dividend, shift in zip(dividends, shifts))
        for divisor, *dividends in operands
    ]


@pytest.mark.parametrize(
    "dividend_bits, shift, divisor_bits, quotient_bits",
    [
        (6, 0, 4, 6),
        (5, 2, 4, 5),
        (6, 0, 4, 3),
        (4, 3, 5, 1),
        (3, 0, 4, 4),
        (7, 0, 1, 7),
    ],
)
def test_every_small_division_is_exactly_the_floor(dividend_bits, shift, divisor_bits, quotient_bits):
    operands = [
        (divisor, dividend)
        for divisor in range(1, 2**divisor_bits)
        for dividend in range(2**dividend_bits)
        if dividend << shift < divisor << quotient_bits
    ]
    divider = Divider([(dividend_bits, shift)], divisor_bits=divisor_bits, quotient_bits=quotient_bits)
    assert divide(divider, operands, 1, never()) == quotients(operands, [shift])


@pytest.mark.parametrize(
    "formats, divisor_bits, quotient_bits, seed",
    [
        ([(24, 0), (24, 0)], 14, 16, 1),
        ([(20, 5), (23, 2)], 16, 15, 2),  # as the datapaths have it: unequal shifts, one divisor
        ([(30, 1), (12, 18), (31, 0)], 15, 16, 3),
        ([(9, 0)], 20, 4, 4),
    ],
)
@pytest.mark.parametrize("share", [0.0, 0.4], ids=["every clock", "with gaps"])
def test_wide_divisions_are_exactly_the_floor(formats, divisor_bits, quotient_bits, seed, share):
    generator = random.Random(seed)
    operands = []
    for _ in range(250):
        divisor = generator.choice([generator.randrange(1, 2**divisor_bits), 2**divisor_bits - 1, 1])
        dividends = []
        for width, shift in formats:
            most = min(2**width, -(-(divisor << quotient_bits) >> shift)) - 1
            multiple = divisor * generator.randrange(2**quotient_bits) >> shift
            dividends.append(
                min(
                    most,
                    generator.choice(
                        [generator.randint(0, most), most, 0, multiple, max(multiple - 1, 0), multiple + 1]
                    ),
                )
            )
        operands.append((divisor, *dividends))
    operands = [o for o in operands if all(d << s < o[0] << quotient_bits for d, (_, s) in zip(o[1:], formats))]
    assert len(operands) > 200
    divider = Divider(formats, divisor_bits=divisor_bits, quotient_bits=quotient_bits)
    results = divide(divider, operands, len(formats), pauses(share, seed, burst=3))
    assert results == quotients(operands, [shift for _, shift in formats])


@pytest.mark.parametrize("quotient_bits", [1, 2, 9, 17])
def test_latency_is_one_clock_a_quotient_bit(quotient_bits):
    divider = Divider([(quotient_bits + 3, 0)], divisor_bits=4, quotient_bits=quotient_bits)
    assert divider.latency == quotient_bits
    # A single quotient of all ones among zeros shows in one clock, and `observe` expects it in just that one.
    operands = [(1, 0)] * 5 + [(5, 5 * (2**quotient_bits - 1) + 4)] + [(15, 0)] * 5
    assert divide(divider, operands, 1, never()) == quotients(operands, [0])
