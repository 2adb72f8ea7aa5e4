import random
from collections import deque
from dataclasses import dataclass
from itertools import product

import pytest

from hdl.arithmetic.fixedpoint import Q
from hdl.geometry.coordinates import Border, Window
from hdl.stream.linebuffer import LineBuffer, LineBufferParameters
from sim.drivers import never, pauses, simulate

BITS = 4  # of the fractions
CONSTANT, REPLICATE = Border("constant", 77), Border("replicate")


@dataclass(frozen=True)
class Case:
    """A source size, the rows that output rows may read, and a border."""

    width: int
    height: int
    d_lo: int
    d_hi: int
    border: Border = CONSTANT

    def __str__(self):
        return f"{self.width}x{self.height} {self.d_lo}..{self.d_hi} {self.border.mode}"

    def taps_allowed(self, y, top):
        """Whether both rows of a window are within the declared ones of output row y, or outside the source."""
        rows = (top, top + 1)
        if self.border.mode == "replicate":
            rows = [min(max(row, 0), self.height - 1) for row in rows]
        return all(self.d_lo <= row - y <= self.d_hi for row in rows if 0 <= row < self.height)

    def coordinates(self, generator, reach):
        """(u, v) for every output position in raster order, up to ``reach`` px outside the source; hits every row."""
        positions = []
        columns, everywhere = range(-reach, self.width + reach), range(-reach, self.height + reach)
        for y in range(self.height):
            allowed = [top for top in everywhere if self.taps_allowed(y, top)]
            # The lowest and the highest row that may be read, often: that is where a ring is too small.
            inside = [top for top in allowed if -1 <= top < self.height] or allowed
            for _ in range(self.width):
                left = generator.choice([generator.choice(columns), generator.randrange(self.width)])
                top = generator.choice([generator.choice(allowed), inside[0], inside[-1], generator.choice(inside)])
                if self.border.mode == "constant" and not -1 <= left < self.width:
                    top = generator.choice(everywhere)  # no tap is inside, whatever the row
                fx, fy = generator.randrange(2**BITS), generator.randrange(2**BITS)
                positions.append((left << BITS | fx, top << BITS | fy))
        return positions

    def parameters(self, positions):
        spans = [(min(axis), max(axis)) for axis in zip(*positions)]
        u, v = (Q.covering(*span, BITS) for span in spans)
        return LineBufferParameters(
            self.width,
            self.height,
            Window(self.d_lo, self.d_hi),
            u,
            v,
            *spans,
            self.border,
            channel_bits=16,
            channels=1,
        )

    def tap(self, source, column, row):
        if self.border.mode == "replicate":
            column, row = min(max(column, 0), self.width - 1), min(max(row, 0), self.height - 1)
        inside = 0 <= column < self.width and 0 <= row < self.height
        return source[row][column] if inside else self.border.value


CASES = [
    *(
        Case(width, height, d_lo, d_hi)
        for width, height in ((12, 10), (13, 11), (9, 14), (16, 9))
        for d_lo, d_hi in ((-3, 4), (-5, -3), (3, 5), (0, 1), (-2, 1))
    ),
    *(
        Case(width, height, d_lo, d_hi, REPLICATE)
        for width, height in ((12, 10), (13, 11))
        for d_lo, d_hi in ((-3, 4), (0, 1), (-4, 0), (-1, 5))
    ),
]


def read(case, frames, positions, *, delay, write_pauses, read_pauses):
    """The windows (tl, tr, bl, br, fx, fy) that the block reads from ``frames`` at ``positions``, frame after frame.

    Both sides keep to the rules that `hdl.stream.flow.RowFlow` enforces, and go as far as those let them: output row y
    is issued once source row y + lead is complete, or the frame is; a source row is written while it is at most
    lead + 1 rows ahead of the output row in progress. A position reaches the block ``delay`` enabled clocks after it
    was issued.
    """
    block = LineBuffer(case.parameters(positions))
    width, height, lead = case.width, case.height, max(case.d_hi, 0)
    pixels = [row for frame in frames for row in frame]
    noise = random.Random(len(pixels))

    async def testbench(ctx):
        windows = []
        written = x = 0  # rows complete, pixels written to the row in progress
        issued = column = 0  # rows issued, positions issued of the row in progress
        in_flight, reading = deque([None] * delay), deque([None] * block.latency)
        while len(windows) < width * len(pixels):
            frame, y = divmod(issued, height)
            write = written <= issued + lead + 1 and written < len(pixels) and not next(write_pauses)
            enable = not next(read_pauses)
            issue = enable and issued < len(pixels) and (written > issued + lead or written >= (frame + 1) * height)

            # The end of a row comes with its last pixel or later.
            write_pixel = write and x < width
            row_written = write and (x == width or x == width - 1 and noise.random() < 0.7)
            ctx.set(block.write, write_pixel)
            ctx.set(block.row_written, row_written)
            ctx.set(block.x, x)
            ctx.set(block.pixel, pixels[written][x] if write_pixel else noise.getrandbits(16))

            position = None
            if enable:
                flags = column == width - 1, y == height - 1
                in_flight.append((*positions[y * width + column], *flags) if issue else None)
                position = in_flight.popleft()
            u, v, last_column, last_row = position or (noise.getrandbits(4), noise.getrandbits(4), False, False)
            if not enable:
                last_column, last_row = noise.getrandbits(1), noise.getrandbits(1)
            ctx.set(block.enable, enable)
            ctx.set(block.u, u)
            ctx.set(block.v, v)
            ctx.set(block.end_of_line, last_column)
            ctx.set(block.end_of_frame, last_column and last_row)

            _, _, taps, fx, fy, odd_column, odd_row = await ctx.tick().sample(
                block.taps, block.fx, block.fy, block.odd_column, block.odd_row
            )
            if enable:
                reading.append(position)
                if reading.popleft() is not None:
                    top, bottom = taps[odd_row], taps[1 - odd_row]
                    windows.append(
                        (top[odd_column], top[1 - odd_column], bottom[odd_column], bottom[1 - odd_column], fx, fy)
                    )
            x += write_pixel
            if row_written:
                written, x = written + 1, 0
            if issue:
                column = (column + 1) % width
                issued += column == 0
        return windows

    (windows,) = simulate(block, testbench, clocks=40 * width * len(pixels) + 500)
    return windows


def expected(case, frames, positions):
    for frame in frames:
        for u, v in positions:
            left, top = u >> BITS, v >> BITS
            taps = [case.tap(frame, column, row) for row in (top, top + 1) for column in (left, left + 1)]
            yield (*taps, u % 2**BITS, v % 2**BITS)


def total(window):
    """Taps times weights: what of a window can be seen."""
    tl, tr, bl, br, fx, fy = window
    one = 2**BITS
    return (tl * (one - fx) + tr * fx) * (one - fy) + (bl * (one - fx) + br * fx) * fy


def check(case, seed, *, frames=3, positions=None, **patterns):
    generator = random.Random(seed)
    positions = positions or case.coordinates(generator, reach=3)
    sources = [
        [[generator.getrandbits(16) for _ in range(case.width)] for _ in range(case.height)] for _ in range(frames)
    ]
    windows = read(case, sources, positions, **patterns)
    wanted = list(expected(case, sources, positions))
    if case.border.mode == "replicate":
        # Where a coordinate is held at the edge, the taps differ from the definition's, but not what they are worth.
        windows, wanted = list(map(total, windows)), list(map(total, wanted))
    assert windows == wanted


@pytest.mark.parametrize("case", CASES, ids=str)
def test_windows_under_pauses(case):
    check(case, 1, delay=2, write_pauses=pauses(0.3, 1), read_pauses=pauses(0.3, 2, burst=5))


@pytest.mark.parametrize("case", CASES[:5] + CASES[15:20:2] + CASES[20::3], ids=str)
def test_windows_while_rows_are_overwritten_as_early_as_allowed(case):
    # The slowest pipeline that a row hides, and a read side that stands for long.
    check(case, 2, delay=case.width - 3, write_pauses=never(), read_pauses=pauses(0.5, 3, burst=2 * case.width))


@pytest.mark.parametrize("case", CASES[::3], ids=str)
def test_windows_read_as_soon_as_their_rows_are_complete(case):
    check(case, 3, delay=0, write_pauses=pauses(0.6, 4, burst=3), read_pauses=never())


@pytest.mark.parametrize("border", [CONSTANT, REPLICATE], ids=lambda border: border.mode)
def test_coordinates_far_outside_read_the_border(border):
    case = Case(10, 8, -2, 3, border)
    generator = random.Random(5)
    positions = case.coordinates(generator, reach=300)
    sources = [[[generator.getrandbits(16) for _ in range(10)] for _ in range(8)]] * 2
    windows = read(case, sources, positions, delay=1, write_pauses=never(), read_pauses=never())
    assert list(map(total, windows)) == list(map(total, expected(case, sources, positions)))


@pytest.mark.parametrize("border", [CONSTANT, REPLICATE], ids=lambda border: border.mode)
@pytest.mark.parametrize("beyond", [-1, 0, 1, 2**BITS - 1, 2**BITS, 2 * 2**BITS])
@pytest.mark.parametrize("before", [0, -1, -(2**BITS), -(2**BITS) - 1])
def test_coordinates_that_reach_just_so_far(before, beyond, border):
    """Comparisons with an edge that the range of the coordinates settles are not built; here they just are."""
    case = Case(9, 6, -5, 4, border)
    generator = random.Random(before + beyond)
    spans = [(before, ((size - 1) << BITS) + beyond) for size in (case.width, case.height)]
    positions = []
    for y in range(case.height):
        tops = [top for top in range(-3, case.height + 3) if case.taps_allowed(y, top)]
        for _ in range(case.width):
            v = generator.choice([v for v in range(spans[1][0], spans[1][1] + 1) if v >> BITS in tops])
            positions.append((generator.randint(*spans[0]), v))
    # Output row 1 may read every row.
    positions[9:13] = list(product(*spans))
    check(case, 8, frames=2, positions=positions, delay=0, write_pauses=never(), read_pauses=never())


def test_windows_over_many_frames():
    # 11 rows in a ring of 6: each frame starts elsewhere in the ring.
    check(Case(8, 11, -1, 1), 6, frames=14, delay=3, write_pauses=never(), read_pauses=pauses(0.1, 7))


@pytest.mark.parametrize("width, columns", [(640, 320), (752, 376), (641, 321), (33, 17), (1920, 960), (16, 8), (9, 5)])
def test_rows_are_packed_within_a_sixteenth(width, columns):
    parameters = LineBufferParameters(
        width, 100, Window(-3, 4), Q(12, 5), Q(12, 5), (0, 1), (0, 1), CONSTANT, channel_bits=10, channels=1
    )
    assert columns <= parameters.pitch * parameters.granule <= columns * 17 / 16
    assert parameters.rows == 10
    assert parameters.depth == 5 * parameters.pitch * parameters.granule
    assert parameters.bits == 4 * parameters.depth * 10
    assert parameters.pixel_width == 10


def test_a_window_beyond_the_frame_is_refused():
    def parameters(d_hi):
        return LineBufferParameters(
            20, 16, Window(0, d_hi), Q(6, 5), Q(6, 5), (0, 1), (0, 1), CONSTANT, channel_bits=8, channels=1
        )

    assert parameters(14).window.lead == 14
    with pytest.raises(ValueError) as caught:
        parameters(15)
    assert str(caught.value) == "output row 0 needs 16 source rows: more than a frame of 16 rows allows"
