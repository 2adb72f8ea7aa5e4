import numpy as np
import pytest
import rigs

from hdl.arithmetic.linear import Accumulator, LinearForm
from sim.drivers import pauses, simulate


def accumulated(form, frames, seed):
    """The values of an `Accumulator` at each position of ``frames`` frames, with gaps."""
    block = Accumulator(form)
    gaps = pauses(0.2, seed)

    async def testbench(ctx):
        values = []
        for _ in range(frames):
            for y in range(form.height):
                for x in range(form.width):
                    step = False
                    while not step:
                        step = not next(gaps)
                        ctx.set(block.step, step)
                        ctx.set(block.end_of_line, x == form.width - 1)
                        ctx.set(block.end_of_frame, (x, y) == (form.width - 1, form.height - 1))
                        _, _, value = await ctx.tick().sample(block.value)
                    values.append(value)
        return values

    (values,) = simulate(block, testbench, clocks=3 * frames * form.width * form.height + 100)
    return values


@pytest.mark.parametrize(
    "a, b, c",
    [
        (1, 1, 0),
        (-1, -1, 0),
        (0, 0, -1),
        (2**20 - 1, -(2**19), -(2**30)),
        (-(2**20), 2**21, 2**24),
        (-7, 9, 1),
        (3, -3 * 8, 0),
        (1, 8, -64),
        (0, 0, 0),
        (-1, 0, 7),
        (2**33, -(2**34), 5),
    ],
)
def test_accumulator_has_the_values_of_its_form_at_the_extremes(a, b, c):
    form = LinearForm(a, b, c, 3, 9, 7)
    values = [a * x + b * y + c for y in range(7) for x in range(9)]
    assert rigs.fits(form.format, np.array(values))
    assert accumulated(form, 3, seed=a & 7) == values * 3
    np.testing.assert_array_equal(form.values(np.arange(9), np.arange(7)[:, None]).ravel(), values)


@pytest.mark.parametrize("bits", [0, 3, 8, 17])
def test_a_quantised_form_is_off_by_no_more_than_its_steps(bits):
    generator = np.random.default_rng(bits)
    x, y = np.meshgrid(np.arange(50), np.arange(40))
    for _ in range(50):
        coefficients = generator.normal(0, (1, 1, 100))
        form = LinearForm.quantise(coefficients, bits, 50, 40)
        error = form.values(x, y) * 2.0**-bits - (coefficients[0] * x + coefficients[1] * y + coefficients[2])
        # Half a step of a over half the width, of b over half the height, and of c: centred, not accumulated.
        assert np.abs(error).max() <= 0.5 * 2.0**-bits * (49 / 2 + 39 / 2 + 1) + 1e-9
        assert abs(error.mean()) <= 0.5 * 2.0**-bits + 1e-9
        # The half goes on top of the start value.
        raised = LinearForm.quantise(coefficients, bits, 50, 40, half=2.0**-bits * 4)
        assert (raised.a, raised.b, raised.c) == (form.a, form.b, form.c + 4)
