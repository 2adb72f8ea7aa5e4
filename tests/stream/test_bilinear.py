import random
from itertools import product

import pytest

from hdl.arithmetic.cuts import PIPELINES
from hdl.stream.bilinear import Bilinear, latency
from sim.drivers import feed, never, observe, pauses, simulate

FORMATS = [(8, 1), (10, 1), (12, 1), (16, 1), (8, 3)]


def interpolate(block, windows, pattern, lead=0):
    """Pixels for ((taps[row][column], as wide as a pixel), fx, fy, odd_column, odd_row), one an enabled clock.

    The window's rows and columns are given from top to bottom and left to right; the banks get them by parity. The taps
    come ``lead`` enabled clocks after the rest.
    """
    width = len(block.pixel)
    said, taken = [], []
    for (top, bottom), fx, fy, odd_column, odd_row in windows:
        rows = (bottom, top) if odd_row else (top, bottom)
        taps = [tap for left, right in rows for tap in ((right, left) if odd_column else (left, right))]
        said.append((fx, fy, odd_column, odd_row))
        taken.append(sum(tap << i * width for i, tap in enumerate(taps)))
    stimuli = [
        (later, *more)
        for later, more in zip([2 ** (4 * width) - 1] * lead + taken, said + [(1, 1, 1, 0)] * lead, strict=True)
    ]
    inputs = [block.taps.as_value(), block.fx, block.fy, block.odd_column, block.odd_row]
    _, results = simulate(
        block,
        feed(block.enable, inputs, stimuli, pattern),
        observe(block.enable, [block.pixel], len(windows), block.latency + lead),
        clocks=10 * len(stimuli) + 100,
    )
    return [pixel for (pixel,) in results]


def blended(windows, bits, channels, f):
    """The same by the definition, channel by channel."""
    one, mask = 1 << f, (1 << bits) - 1
    pixels = []
    for (top, bottom), fx, fy, _, _ in windows:
        pixel = 0
        for channel in range(channels):
            (tl, tr), (bl, br) = ([tap >> channel * bits & mask for tap in row] for row in (top, bottom))
            total = tl * (one - fx) * (one - fy) + tr * fx * (one - fy) + bl * (one - fx) * fy + br * fx * fy
            pixel |= (total + one * one // 2) // (one * one) << channel * bits
        pixels.append(pixel)
    return pixels


def random_windows(generator, count, width, f):
    for index in range(count):
        taps = [generator.choice([generator.getrandbits(width), 0, 2**width - 1]) for _ in range(4)]
        fx, fy = (generator.choice([generator.randrange(2**f), 0, 2**f - 1, 2 ** (f - 1)]) for _ in range(2))
        yield ((taps[0], taps[1]), (taps[2], taps[3])), fx, fy, index & 1, index >> 1 & 1


pipelines = pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)


@pipelines
@pytest.mark.parametrize(
    "bits, channels, f",
    [(*FORMATS[f % len(FORMATS)], f) for f in range(1, 9)] + [(*form, 5) for form in FORMATS[1:]],
    ids=str,
)
def test_pixels_are_those_of_the_definition(bits, channels, f, pipeline):
    windows = list(random_windows(random.Random(100 * bits + f), 120, bits * channels, f))
    lead = f % 4
    block = Bilinear(bits, channels, f, lead, pipeline)
    assert block.latency == latency(f, pipeline)
    assert interpolate(block, windows, pauses(0.25, seed=f), lead) == blended(windows, bits, channels, f)


@pipelines
def test_every_weight_at_the_extremes_of_the_pixels(pipeline):
    taps = [
        ((0, 255), (255, 0)),
        ((255, 255), (255, 255)),
        ((255, 0), (0, 0)),
        ((0, 0), (0, 255)),
        ((255, 1), (0, 254)),
    ]
    windows = [
        (taps[(fx + fy + 2 * odd_row + odd_column) % 5], fx, fy, odd_column, odd_row)
        for fx, fy, odd_column, odd_row in product(range(8), range(8), (0, 1), (0, 1))
    ]
    assert interpolate(Bilinear(8, 1, 3, pipeline=pipeline), windows, never()) == blended(windows, 8, 1, 3)


@pipelines
def test_one_value_everywhere_stays_that_value(pipeline):
    windows = [
        (((value, value), (value, value)), fx, fy, odd, 1 - odd)
        for value, fx, fy, odd in product((0, 1, 2**16 - 1, 2**15), (0, 1, 128, 255), (0, 127, 255), (0, 1))
    ]
    results = interpolate(Bilinear(16, 1, 8, pipeline=pipeline), windows, never())
    assert results == [window[0][0][0] for window in windows]


@pipelines
def test_halves_are_rounded_up(pipeline):
    windows = [(((0, 1), (0, 1)), 15, 9, 0, 0), (((0, 1), (0, 1)), 16, 9, 1, 0), (((3, 3), (4, 4)), 2, 16, 0, 1)]
    assert interpolate(Bilinear(8, 1, 5, pipeline=pipeline), windows, never()) == [0, 1, 4]


@pipelines
def test_latency_is_counted_in_enabled_clocks(pipeline):
    # One bright window among dark ones; `observe` expects it in just one place.
    dark, bright = (((0, 0), (0, 0)), 3, 5, 0, 0), (((200, 200), (200, 200)), 3, 5, 1, 1)
    windows = [dark] * 3 + [bright] + [dark] * 4
    for seed in range(5):
        assert interpolate(Bilinear(8, 1, 5, 2, pipeline), windows, pauses(0.5, seed), 2) == [0, 0, 0, 200, 0, 0, 0, 0]
