"""Polynomials by forward differences: closed forms against sums of binomials, and the hardware's additions."""

import numpy as np
import pytest
from polynomials import along, differences, value

from hdl.arithmetic.differences import DifferenceAccumulator, DifferenceForm, functions_along
from sim.drivers import pauses, simulate


def some_form(degree, cell_width, cell_height, width, height, seed=0, bits=20):
    """Random coefficients, of which each is worth about as much at the far corner."""
    generator = np.random.default_rng(seed)
    coefficients = np.zeros((degree + 1, degree + 1), np.int64)
    for k in range(degree + 1):
        for n in range(degree + 1 - k):
            largest = max(along(width, k, cell_width) * along(height, n, cell_height), 1)
            most = max((1 << bits) // largest, 2)
            coefficients[k, n] = generator.integers(-most, most + 1)
    return DifferenceForm(coefficients, cell_width, cell_height, 5, width, height)


FORMS = [
    # degree, cell_width, cell_height, width, height
    (1, 1, 1, 17, 9),
    (2, 1, 1, 16, 11),
    (2, 4, 4, 23, 13),
    (2, 8, 8, 41, 27),
    (2, 2, 4, 9, 10),
    (3, 1, 1, 12, 13),
    (3, 4, 1, 29, 9),
    (4, 2, 1, 15, 9),
    (5, 1, 1, 13, 11),
    (6, 4, 1, 33, 10),
    (7, 2, 1, 21, 9),
]


@pytest.mark.parametrize("cell", [1, 2, 8])
def test_functions_are_binomials_joined_by_lines(cell):
    assert functions_along(30, 5, cell) == [[along(x, k, cell) for k in range(6)] for x in range(30)]


@pytest.mark.parametrize("parameters", FORMS, ids=str)
def test_values_are_the_sums_of_their_binomials(parameters):
    form = some_form(*parameters)
    expected = [[value(form, x, y) for x in range(form.width)] for y in range(form.height)]
    np.testing.assert_array_equal(form.values(), expected)
    np.testing.assert_array_equal(form.values(slice(None, None, 4)), expected[::4])


@pytest.mark.parametrize("parameters", FORMS, ids=str)
def test_each_sequence_covers_the_differences_of_the_values(parameters):
    form = some_form(*parameters)
    expected = differences(form)
    assert expected.keys() == form.sequences.keys() == form.formats.keys()
    for name, values in expected.items():
        flat = np.ravel(np.array(values, object)).tolist()
        sequence = form.sequences[name]
        assert (sequence.lowest, sequence.highest) == (min(flat), max(flat))
        q = form.formats[name]
        assert -(2 ** (q.width - 1)) * q.is_signed <= min(flat) and max(flat) < 2 ** (q.width - q.is_signed)
        # Of what is stored no bit can go: the lowest and the highest change, or tell the sign.
        stored = [flat_value if sequence.order % 2 == 0 else -flat_value for flat_value in flat]
        low = [flat_value >> sequence.stored.fixed_bits for flat_value in stored]
        assert len({flat_value % 2**sequence.stored.fixed_bits for flat_value in stored}) == 1
        assert len({flat_value & 1 for flat_value in low}) == 2 or sequence.bits == 0
        assert len({flat_value % 2**sequence.stored.bits for flat_value in low}) == len(set(low))


def accumulated(form, frames, seed):
    """The values of a `DifferenceAccumulator` at each position of ``frames`` frames, with pauses."""
    block = DifferenceAccumulator(form)
    stands = pauses(0.2, seed)

    async def testbench(ctx):
        values = []
        for _ in range(frames):
            for y in range(form.height):
                for x in range(form.width):
                    ctx.set(block.x, x)
                    ctx.set(block.y, y)
                    ctx.set(block.end_of_line, x == form.width - 1)
                    ctx.set(block.end_of_frame, (x, y) == (form.width - 1, form.height - 1))
                    step = False
                    while not step:
                        step = not next(stands)
                        ctx.set(block.step, step)
                        _, _, found = await ctx.tick().sample(block.value)
                    values.append(found)
        return values

    (values,) = simulate(block, testbench, clocks=3 * frames * form.width * form.height + 100)
    return np.array(values, dtype=object).reshape(frames, form.height, form.width)


@pytest.mark.parametrize("parameters", FORMS, ids=str)
@pytest.mark.parametrize("bits", [6, 58])
def test_additions_give_the_values_in_every_frame(parameters, bits):
    form = some_form(*parameters, seed=bits, bits=bits)
    for frame in accumulated(form, 3, seed=bits):
        np.testing.assert_array_equal(frame, form.values())


@pytest.mark.parametrize(
    "coefficients",
    [
        [[0, 0, 0], [0, 0, 0], [0, 0, 0]],
        [[-1, 0, 0], [0, 0, 0], [0, 0, 0]],
        [[7, -1, 0], [1, 0, 0], [0, 0, 0]],
        [[0, 0, 1], [0, 1, 0], [1, 0, 0]],
        [[-(2**55), 2**52, -(2**49)], [2**51, -(2**46), 0], [-(2**48), 0, 0]],
        [[2**55, 0, 0], [-(2**52), 2**46 + 1, 0], [2**48 - 1, 0, 0]],
        [[-8, 8, 16], [24, 32, 0], [-64, 0, 0]],
    ],
)
def test_additions_give_the_values_at_the_extremes(coefficients):
    for cell in (1, 4):
        form = DifferenceForm(np.array(coefficients), cell, cell, 0, 10, 9)
        for frame in accumulated(form, 2, seed=cell):
            np.testing.assert_array_equal(frame, form.values())


def test_registers_are_as_many_as_the_degree_says():
    for degree in range(1, 8):
        assert len(some_form(degree, 1, 1, 20, 20).registers) == degree * (degree + 1) // 2
