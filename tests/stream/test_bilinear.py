import random
from itertools import product

import pytest

from hdl.stream.bilinear import Bilinear
from sim.drivers import feed, never, observe, pauses, simulate

FORMATS = [(8, 1), (10, 1), (12, 1), (16, 1), (8, 3)]


def interpolate(block, windows, pattern):
    """Pixels for ((taps[row][column], as wide as a pixel), fx, fy, odd_column, odd_row), one an enabled clock.

    The window's rows and columns are given from top to bottom and left to right; the banks get them by parity.
    """
    width = len(block.pixel)
    stimuli = []
    for (top, bottom), fx, fy, odd_column, odd_row in windows:
        rows = (bottom, top) if odd_row else (top, bottom)
        taps = [tap for left, right in rows for tap in ((right, left) if odd_column else (left, right))]
        stimuli.append((sum(tap << i * width for i, tap in enumerate(taps)), fx, fy, odd_column, odd_row))
    inputs = [block.taps.as_value(), block.fx, block.fy, block.odd_column, block.odd_row]
    _, results = simulate(
        block,
        feed(block.enable, inputs, stimuli, pattern),
        observe(block.enable, [block.pixel], len(stimuli), block.latency),
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


@pytest.mark.parametrize("f", range(3, 9))
@pytest.mark.parametrize("bits, channels", FORMATS, ids=lambda value: str(value))
def test_pixels_are_those_of_the_definition(bits, channels, f):
    windows = list(random_windows(random.Random(100 * bits + f), 160, bits * channels, f))
    results = interpolate(Bilinear(bits, channels, f), windows, pauses(0.25, seed=f))
    assert results == blended(windows, bits, channels, f)


def test_every_weight_at_the_extremes_of_the_pixels():
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
    assert interpolate(Bilinear(8, 1, 3), windows, never()) == blended(windows, 8, 1, 3)


def test_one_value_everywhere_stays_that_value():
    windows = [
        (((value, value), (value, value)), fx, fy, odd, 1 - odd)
        for value, fx, fy, odd in product((0, 1, 2**16 - 1, 2**15), (0, 1, 128, 255), (0, 127, 255), (0, 1))
    ]
    results = interpolate(Bilinear(16, 1, 8), windows, never())
    assert results == [window[0][0][0] for window in windows]


def test_halves_are_rounded_up():
    windows = [(((0, 1), (0, 1)), 15, 9, 0, 0), (((0, 1), (0, 1)), 16, 9, 1, 0), (((3, 3), (4, 4)), 2, 16, 0, 1)]
    assert interpolate(Bilinear(8, 1, 5), windows, never()) == [0, 1, 4]


def test_latency_is_counted_in_enabled_clocks():
    assert Bilinear.latency == 2
    # One bright window among dark ones; `observe` expects it in just one place.
    dark, bright = (((0, 0), (0, 0)), 3, 5, 0, 0), (((200, 200), (200, 200)), 3, 5, 1, 1)
    windows = [dark] * 3 + [bright] + [dark] * 4
    for seed in range(5):
        assert interpolate(Bilinear(8, 1, 5), windows, pauses(0.5, seed)) == [0, 0, 0, 200, 0, 0, 0, 0]
