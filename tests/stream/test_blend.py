"""Weighted means by adders, each way of them, against integers."""

import random
from itertools import product

import pytest
from amaranth import Module, Signal

from hdl.arithmetic.cuts import Stages
from hdl.stream.blend import BLENDS
from sim.drivers import feed, never, observe, pauses, simulate

ways = pytest.mark.parametrize("way", BLENDS)
roundings = pytest.mark.parametrize("half", [False, True], ids=["cut", "rounded"])


def totals(way, f, half, width, stimuli, stands):
    """The totals for ((even, odd, of each pair), weight, swapped), one an enabled clock."""
    blend, count = BLENDS[way](f), len(stimuli[0][0])
    m, enable, weight, swapped = Module(), Signal(), Signal(f), Signal()
    values = [Signal(width, name=f"value_{index}") for index in range(count)]
    stages = Stages(m, enable)
    found = blend.totals(
        m, stages, "blend", list(zip(values[::2], values[1::2])), blend.recoded(weight, swapped), half=half
    )
    assert [len(total) for total in found] == [width + f] * (count // 2)
    outputs = [stages.after(f"total_{index}", total) for index, total in enumerate(found)]
    _, results = simulate(
        m,
        feed(enable, [*values, weight, swapped], [(*given, *more) for given, *more in stimuli], stands),
        observe(enable, outputs, len(stimuli), blend.latency),
        clocks=4 * len(stimuli) + 100,
    )
    return results


def expected(f, half, stimuli):
    for values, weight, swapped in stimuli:
        odd = 2**f - weight if swapped else weight
        yield tuple(
            values[at] * (2**f - odd) + values[at + 1] * odd + half * 2 ** (f - 1) for at in range(0, len(values), 2)
        )


@ways
@roundings
@pytest.mark.parametrize("f", range(1, 9))
def test_every_weight_either_way(way, f, half):
    # The second pair has the same weight as the first, and other values.
    generator, width = random.Random(f), 5
    ends = (0, 2**width - 1)
    stimuli = [
        ([generator.choice((*ends, generator.getrandbits(width))) for _ in range(4)], weight, swapped)
        for weight, swapped in product(range(2**f), range(2))
    ]
    assert totals(way, f, half, width, stimuli, pauses(0.2, f)) == list(expected(f, half, stimuli))


@ways
@roundings
@pytest.mark.parametrize("f, width", [(1, 2), (2, 3), (3, 1), (4, 2), (5, 1)])
def test_every_input_of_small_ones(way, f, width, half):
    every = range(2**width)
    stimuli = [(values, *more) for *values, more in product(every, every, product(range(2**f), range(2)))]
    assert totals(way, f, half, width, stimuli, never()) == list(expected(f, half, stimuli))
