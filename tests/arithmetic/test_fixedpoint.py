import numpy as np
import pytest
from amaranth import signed, unsigned

from hdl.arithmetic.fixedpoint import Q


def holds(q, value):
    """Whether the stored integer fits, from the definition of two's complement."""
    return -(2 ** (q.width - 1)) <= value < 2 ** (q.width - 1) if q.is_signed else 0 <= value < 2**q.width


def test_covering_is_the_narrowest_format_of_every_small_range():
    for lowest in range(-34, 35):
        for highest in range(lowest, 35):
            q = Q.covering(lowest, highest, 0)
            assert q.is_signed == (lowest < 0)
            assert holds(q, lowest) and holds(q, highest)
            narrower = Q(q.integer_bits - 1, 0, q.is_signed)
            assert q.width == 1 or not (holds(narrower, lowest) and holds(narrower, highest)), (lowest, highest)


@pytest.mark.parametrize("bits", [1, 7, 31, 40])
def test_covering_turns_at_the_powers_of_two(bits):
    power = 2**bits
    assert Q.covering(0, power - 1, 0).width == bits
    assert Q.covering(0, power, 0).width == bits + 1
    assert Q.covering(-power, power - 1, 0).width == bits + 1
    assert Q.covering(-power - 1, 0, 0).width == bits + 2
    assert Q.covering(-1, power, 0).width == bits + 2


@pytest.mark.parametrize("fraction_bits, text", [(0, "Q7.0"), (5, "Q2.5"), (9, "Q-2.9"), (-3, "Q10.-3")])
def test_fraction_bits_move_the_point_and_not_the_width(fraction_bits, text):
    q = Q.covering(-40, 50, fraction_bits)
    assert (q.width, q.fraction_bits, str(q)) == (7, fraction_bits, text)


def test_unsigned_formats_are_marked():
    assert str(Q.covering(0, 1000, 5)) == "UQ5.5"
    assert str(Q(11, 5, is_signed=False)) == "UQ11.5"


def test_shape_is_that_of_the_stored_integer():
    assert Q(11, 5).shape == signed(16)
    assert Q(11, 5, is_signed=False).shape == unsigned(16)
    assert Q(-3, 20).shape == signed(17)


def test_covering_takes_the_integers_of_numpy():
    values = np.array([-(2**40), 2**40 - 1])
    assert Q.covering(values.min(), values.max(), 30) == Q(11, 30)
    assert Q.covering(np.int32(-5), np.int32(3), 0) == Q(4, 0)


def test_covering_refuses_an_empty_range():
    with pytest.raises(ValueError) as caught:
        Q.covering(3, 2, 0)
    assert str(caught.value) == "empty range 3..2"
