import random
from collections import deque
from dataclasses import dataclass
from itertools import product
from unittest import mock

import pytest

from hdl.arithmetic.cuts import BALANCED, COMPACT, FAST, PIPELINES
from hdl.arithmetic.fixedpoint import Q
from hdl.geometry.coordinates import Border, Window
from hdl.stream.linebuffer import LineBuffer, LineBufferParameters
from hdl.stream.raster import NEAR
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

    def parameters(self, positions, pipeline):
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
            pipeline=pipeline,
        )

    def longest_delay(self, pipeline):
        """Of the position, enabled clocks: what `RectifierParameters` allows a datapath."""
        p = self.parameters([(0, 0)], pipeline)
        return self.width - 1 - (p.latency - pipeline.taps + NEAR * pipeline.ahead)

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


def read(case, frames, positions, pipeline, *, delay, write_pauses, read_pauses):
    """The windows (tl, tr, bl, br, fx, fy) that the block reads from ``frames`` at ``positions``, frame after frame.

    Both sides keep to the rules that `hdl.stream.flow.RowFlow` enforces, and go as far as those let them: output row y
    is issued once source row y + lead is complete, or the frame is; a source row is written while it is at most
    lead + 1 rows ahead of the output row in progress, which, as `hdl.stream.issue.Issue` has it, may be over `NEAR`
    positions before its end. A position reaches the block ``delay`` enabled clocks after it was issued.
    """
    parameters = case.parameters(positions, pipeline)
    block = LineBuffer(parameters)
    width, height, lead = case.width, case.height, max(case.d_hi, 0)
    pixels = [row for frame in frames for row in frame]
    noise = random.Random(len(pixels))

    async def testbench(ctx):
        windows = []
        last_row = False
        written = x = 0  # rows complete, pixels written to the row in progress
        issued = column = 0  # rows issued, positions issued of the row in progress
        counted = 0  # rows that count as issued
        in_flight, reading = deque([None] * delay), deque([None] * parameters.latency)
        placing, places = deque([None] * parameters.place_latency), deque()
        while len(windows) < width * len(pixels):
            frame, y = divmod(issued, height)
            write = written <= counted + lead + 1 and written < len(pixels) and not next(write_pauses)
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
                # The flag of the row stands while positions are waited for, too.
                flags = issue and column == width - 1, y == height - 1
                in_flight.append((positions[y * width + column] if issue else None, *flags))
                position, *flags = in_flight.popleft() or (None, False, False)
            u, v = position or (noise.getrandbits(4), noise.getrandbits(4))
            if enable:
                last_column, last_row = flags
            else:
                last_column, last_row = noise.getrandbits(1), last_row
            ctx.set(block.enable, enable)
            ctx.set(block.u, u)
            ctx.set(block.v, v)
            ctx.set(block.end_of_line, last_column)
            ctx.set(block.last_row, last_row)

            _, _, taps, fx, fy, odd_column, odd_row = await ctx.tick().sample(
                block.taps, block.fx, block.fy, block.odd_column, block.odd_row
            )
            if enable:
                placing.append(position)
                if placing.popleft() is not None:
                    places.append((fx, fy, odd_column, odd_row))
                reading.append(position)
                if reading.popleft() is not None:
                    fx, fy, odd_column, odd_row = places.popleft()
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
                counted += column == (width - NEAR * pipeline.ahead) % width
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


def check(case, seed, pipeline, *, frames=3, positions=None, **patterns):
    generator = random.Random(seed)
    positions = positions or case.coordinates(generator, reach=3)
    sources = [
        [[generator.getrandbits(16) for _ in range(case.width)] for _ in range(case.height)] for _ in range(frames)
    ]
    windows = read(case, sources, positions, pipeline, **patterns)
    wanted = list(expected(case, sources, positions))
    if case.border.mode == "replicate":
        # Where a coordinate is held at the edge, the taps differ from the definition's, but not what they are worth.
        windows, wanted = list(map(total, windows)), list(map(total, wanted))
    assert windows == wanted


# Each case with one pipeline; the first ones, of all windows, with all.
EACH = [(case, pipeline) for case in CASES[:5] for pipeline in PIPELINES.values()] + [
    (case, list(PIPELINES.values())[index % len(PIPELINES)]) for index, case in enumerate(CASES[5:])
]
pipelines = pytest.mark.parametrize("pipeline", PIPELINES.values(), ids=PIPELINES)


def named(value):
    return value.name if hasattr(value, "name") else str(value)


@pytest.mark.parametrize("case, pipeline", EACH, ids=named)
def test_windows_under_pauses(case, pipeline):
    delay = min(2, case.longest_delay(pipeline))
    check(case, 1, pipeline, delay=delay, write_pauses=pauses(0.3, 1), read_pauses=pauses(0.3, 2, burst=5))


@pytest.mark.parametrize("case, pipeline", EACH[:15] + EACH[25::4], ids=named)
def test_windows_while_rows_are_overwritten_as_early_as_allowed(case, pipeline):
    # The slowest pipeline that a row hides, and a read side that stands for long.
    patterns = {"write_pauses": never(), "read_pauses": pauses(0.5, 3, burst=2 * case.width)}
    check(case, 2, pipeline, delay=case.longest_delay(pipeline), **patterns)


@pytest.mark.parametrize("case, pipeline", EACH[::4], ids=named)
def test_windows_read_as_soon_as_their_rows_are_complete(case, pipeline):
    # Where rows are looked at ahead, the permission is a clock on its way.
    check(case, 3, pipeline, delay=pipeline.ahead, write_pauses=pauses(0.6, 4, burst=3), read_pauses=never())


@pytest.mark.parametrize("pipeline", [BALANCED, FAST], ids=named)
@pytest.mark.parametrize("case", CASES[:4], ids=str)
def test_windows_in_a_ring_too_large_for_a_table(case, pipeline):
    with mock.patch("hdl.stream.ring._TABLE_ROWS", 2):
        assert case.parameters([(0, 0)], pipeline).place_latency == 2
        patterns = {"write_pauses": never(), "read_pauses": pauses(0.4, 3, burst=2 * case.width)}
        check(case, 4, pipeline, delay=case.longest_delay(pipeline), **patterns)


@pipelines
@pytest.mark.parametrize("border", [CONSTANT, REPLICATE], ids=lambda border: border.mode)
def test_coordinates_far_outside_read_the_border(border, pipeline):
    case = Case(10, 8, -2, 3, border)
    generator = random.Random(5)
    positions = case.coordinates(generator, reach=300)
    sources = [[[generator.getrandbits(16) for _ in range(10)] for _ in range(8)]] * 2
    windows = read(case, sources, positions, pipeline, delay=1, write_pauses=never(), read_pauses=never())
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
    pipeline = BALANCED if beyond % 2 else COMPACT
    patterns = {"write_pauses": never(), "read_pauses": never()}
    check(case, 8, pipeline, frames=2, positions=positions, delay=int(pipeline.ahead), **patterns)


@pipelines
def test_windows_over_many_frames(pipeline):
    # 11 rows in a ring of 6: each frame starts elsewhere in the ring.
    check(Case(10, 11, -1, 1), 6, pipeline, frames=14, delay=1, write_pauses=never(), read_pauses=pauses(0.1, 7))


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
