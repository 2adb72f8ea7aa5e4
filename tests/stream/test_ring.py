"""The slots of source rows, for every row that may be asked for, until the ring comes around."""

from math import lcm
from unittest import mock

import pytest
from amaranth import Module, Signal

from hdl.arithmetic.cuts import Stages
from hdl.stream.ring import Ring
from sim.drivers import never, pauses, simulate

WIDTH = 4  # positions of an output row; what is known a row ahead is there after two


def addresses(ring, rows, pitch, height, lowest, stands):
    """(what the block says, what it should) of (address in the even bank, in the odd one, is the upper row odd)."""
    m, enable, row, end_of_line, last_row = Module(), Signal(), Signal(range(-64, 64)), Signal(), Signal()
    (even, odd), odd_row = ring.pair(m, Stages(m, enable), row, end_of_line, last_row)
    asked = [
        (frame, y, x, y + lowest + distance)
        for frame in range(lcm(rows, height) // height + 1)
        for y in range(height)
        # Each position of an output row asks for another row; so many output rows alike reach all of them.
        for x, distance in enumerate([(y + frame + step * rows // WIDTH) % rows for step in range(WIDTH)])
    ]

    async def testbench(ctx):
        said, index = [], 0
        while len(said) < len(asked):
            moves = not next(stands)
            frame, y, x, asked_row = asked[min(index, len(asked) - 1)]
            ctx.set(enable, moves)
            ctx.set(row, asked_row)
            ctx.set(last_row, y == height - 1)
            ctx.set(end_of_line, x == WIDTH - 1)
            await ctx.tick()
            index += moves
            if moves and index >= ring.latency:
                said.append((ctx.get(even), ctx.get(odd), ctx.get(odd_row)))
        return said

    (said,) = simulate(m, testbench, clocks=5 * len(asked) + 100)
    wanted = []
    for frame, _, _, upper in asked:
        slots = [(frame * height + row) % rows for row in (upper, upper + 1)]
        even_slot, odd_slot = sorted(slots, key=lambda slot: slot % 2)
        wanted.append((even_slot // 2 * pitch, odd_slot // 2 * pitch, slots[0] % 2))
    return said, wanted


@pytest.mark.parametrize("registered, more", [(False, 0), (True, 0), (True, -1)], ids=["slot", "table", "sums"])
@pytest.mark.parametrize(
    "rows, height, lowest, pitch", [(4, 7, -2, 5), (6, 11, -1, 3), (10, 8, 2, 1), (8, 9, -9, 6), (6, 6, 0, 7)]
)
def test_every_row_of_the_window_is_found(rows, height, lowest, pitch, registered, more):
    # The table is for so many rows.
    table = rows + more
    with mock.patch("hdl.stream.ring._TABLE_ROWS", table):
        ring = Ring(rows, pitch, height, lowest, registered)
        assert ring.latency == (2 if registered and rows > table else 1)
        for stands in (never(), pauses(0.4, rows)):
            said, wanted = addresses(ring, rows, pitch, height, lowest, stands)
            assert said == wanted
