"""The line buffer gives the interpolator the very pixels that the datapath asks for, whatever happens at the streams.

The pixels at s_axis are made to tell which they are: their source row's number, frames counted through, and their
column. The datapath asks for any window it may. One pixel of the source, any one, is watched: what holds for it holds
for all.
"""

from contextlib import nullcontext
from types import SimpleNamespace
from unittest import mock

from amaranth import Array, Cat, Module, Mux, Signal
from amaranth.asserts import AnyConst
from amaranth.hdl import Assert, Assume, Cover, Elaboratable
from amaranth.utils import ceil_log2

from .core import FreeCore
from .lemmas import WatchedMemory, window_lemmas


class Position:
    """A raster position between the datapath and the memories.

    Members: ``valid``; ``y``, its row; ``base``, the number of its frame's first source row; ``ends``, its row ends
    with it; ``u`` and ``v``, its coordinate.
    """

    def __init__(self, proof, stage, u=None, v=None):
        self.valid = Signal(name=f"{stage}_valid")
        self.ends = Signal(name=f"{stage}_ends")
        self.y = Signal(range(proof.height), name=f"{stage}_y")
        self.base = Signal(proof.row_bits, name=f"{stage}_base")
        self.u = Signal.like(proof.datapath.u, name=f"{stage}_u") if u is None else u
        self.v = Signal.like(proof.datapath.v, name=f"{stage}_v") if v is None else v

    def follow(self, other):
        """Statements that copy the other."""
        return [mine.eq(its) for mine, its in zip(vars(self).values(), vars(other).values())]


class WindowProof(Elaboratable):
    """Assertions over the whole core, with its real control, addresses and memories, both streams arbitrary.

    For each tap of each window that reaches the interpolator:

    - inside the source it is the pixel of the wanted row, column and frame, unless that line was too short to have it;
    - its row was complete when it was read, and its address was not written in that clock;
    - outside the source it is the border's value, or, where that is replicated, the nearest pixel.

    And the fractions are the coordinate's. Assumed is that the rows of a window are among those that the core was built
    for, and that coordinates are within their range.

    Parameters
    ----------
    parameters : RectifierParameters
        Around `AnyDatapath`, with pixels of at least `tag_bits`.
    lemmas : bool
        Assert also what makes these assertions inductive; it is said in terms of the design's registers.
    covers : bool
        Ask for the interesting situations.
    steady : bool
        Assume right frames without a pause, on both sides, and no reset: enough to find most faults, and quickly.
    """

    def __init__(self, parameters, *, lemmas=False, covers=False, steady=False):
        self.parameters, self._with_lemmas, self._with_covers = parameters, lemmas, covers
        self._steady = steady
        buffer = parameters.line_buffer
        self.width, self.height, self.window = buffer.width, buffer.height, buffer.window
        self.replicated = parameters.border.mode == "replicate"
        with mock.patch("hdl.stream.linebuffer.Memory", WatchedMemory) if lemmas else nullcontext():
            self.core = FreeCore(parameters)
        self.capture, self.datapath, self.bilinear = (
            self.core.parts[name] for name in ("capture", "datapath", "bilinear")
        )
        self.column_bits, self.row_bits = ceil_log2(self.width), row_number_bits(self.height)

        # Rows that came in, and which row of a frame is coming in.
        self.row_in, self.y_in = Signal(self.row_bits), Signal(range(self.height))
        # The pixel that is watched; whether it came in, or its line did without it.
        self.row, self.column = Signal(self.row_bits), Signal(self.column_bits)
        self.present, self.missing = Signal(), Signal()
        # Positions on their way through the datapath, the last one's column; then with coordinates, then at the
        # memories.
        self.on_the_way = SimpleNamespace(
            x=Signal(range(self.width)),
            valid=Signal(parameters.datapath.latency),
            ends=Signal(parameters.datapath.latency),
        )
        self.reading = Position(self, "reading", self.datapath.u, self.datapath.v)
        self.fetching = Position(self, "fetching")
        self.taps_valid = Signal()

    def elaborate(self, platform):
        m = Module()
        self.core.add_to(m, data=self.tag(self.capture.x, self.row_in))
        if self._steady:
            self.core.add_steady_streams_to(m)
        self._follow_input(m)
        self._follow_output(m)
        expected = self._expect(m)
        self._check_taps(m, expected)
        if self._with_lemmas:
            window_lemmas(m, self)
        if self._with_covers:
            self._cover(m, expected)
        return m

    def tag(self, column, row):
        """The pixel that comes in at this place."""
        return Cat(column[: self.column_bits], row)

    @staticmethod
    def clamped(index, size):
        """The index of the nearest pixel."""
        return Mux(index < 0, 0, Mux(index > size - 1, size - 1, index))

    def _follow_input(self, m):
        m.d.comb += [self.row.eq(AnyConst(self.row_bits)), self.column.eq(AnyConst(self.column_bits))]
        in_row = self.row_in == self.row
        comes_in = self.capture.write & in_row & (self.capture.x == self.column)
        with m.If(comes_in):
            m.d.sync += self.present.eq(1)
        with m.If(self.capture.row_written):
            m.d.sync += [self.row_in.eq(self.row_in + 1), self.y_in.eq(self.y_in + 1)]
            with m.If(self.capture.frame_written):
                m.d.sync += self.y_in.eq(0)
            with m.If(in_row & ~self.present & ~comes_in):
                m.d.sync += self.missing.eq(1)
            with m.If(self.row == (self.row_in + 1)[: self.row_bits]):
                m.d.sync += [self.present.eq(0), self.missing.eq(0)]  # the numbers have come round

    def _follow_output(self, m):
        way, reading, datapath = self.on_the_way, self.reading, self.datapath
        issue = self.core.issue
        ends = issue & (way.x == self.width - 1)
        with m.If(issue):
            m.d.sync += way.x.eq(Mux(ends, 0, way.x + 1))
        valid, ends = Cat(issue, way.valid), Cat(ends, way.ends)
        m.d.comb += [reading.valid.eq(valid[-1]), reading.ends.eq(ends[-1])]
        with m.If(datapath.enable):
            m.d.sync += [way.valid.eq(valid), way.ends.eq(ends)]
            m.d.sync += self.fetching.follow(reading)
            m.d.sync += self.taps_valid.eq(self.fetching.valid)
            with m.If(reading.ends):
                m.d.sync += reading.y.eq(reading.y + 1)
                with m.If(reading.y == self.height - 1):
                    m.d.sync += [reading.y.eq(0), reading.base.eq(reading.base + self.height)]
        m.d.comb += Assume(self.in_window(reading), "windows are as the core was built for")

    def in_window(self, position):
        """Whether the rows of the window around a coordinate are among those that the core was built for."""
        whole_v, whole_u = (c >> self.parameters.datapath.fraction_bits for c in (position.v, position.u))
        facts = []
        for dy in range(2):
            row = whole_v + dy
            is_read = (row >= 0) & (row < self.height) & (whole_u >= -1) & (whole_u < self.width)
            if self.replicated:
                row, is_read = self.clamped(row, self.height), 1
            offset = row - position.y
            facts.append(~(position.valid & is_read) | ((offset >= self.window.d_lo) & (offset <= self.window.d_hi)))
        return Cat(facts).all()

    def _expect(self, m):
        """What there should be at the taps, by (dy, dx): registers in step with them."""
        position, f = self.fetching, self.parameters.datapath.fraction_bits
        weighs = {}
        for axis, coordinate, size in (("x", position.u, self.width), ("y", position.v, self.height)):
            fraction, asked = Signal(f, name=f"fraction_{axis}"), Signal(f, name=f"asked_f{axis}")
            between = (coordinate >= 0) & (coordinate < (size - 1) << f) if self.replicated else 1
            m.d.comb += fraction.eq(Mux(between, coordinate[:f], 0))
            with m.If(self.datapath.enable):
                m.d.sync += asked.eq(fraction)
            m.d.comb += Assert(
                ~self.taps_valid | (getattr(self.bilinear, f"f{axis}") == asked),
                f"the fraction in {axis} is the coordinate's",
            )
            # Only where the border is replicated may a tap be anything if it has no weight.
            weighs[axis] = 1, fraction != 0 if self.replicated else 1

        expected = {}
        for dy in range(2):
            for dx in range(2):
                expected[dy, dx] = tap = ExpectedTap(self, f"tap ({dy}, {dx})")
                row, column = (position.v >> f) + dy, (position.u >> f) + dx
                inside = (row >= 0) & (row < self.height) & (column >= 0) & (column < self.width)
                if self.replicated:
                    row, column = self.clamped(row, self.height), self.clamped(column, self.width)
                    inside = weighs["x"][dx] & weighs["y"][dy]
                number = (position.base + row)[: self.row_bits]
                watched, age = inside & (number == self.row) & (column == self.column), Signal.like(tap.age)
                m.d.comb += [
                    age.eq(self.row_in - number),
                    Assert(
                        ~(position.valid & inside) | ((age != 0) & ~age[-1]), f"{tap.name} is read from a complete row"
                    ),
                    Assert(
                        ~(position.valid & watched) | self.present | self.missing,
                        f"{tap.name} is read from a row that came in",
                    ),
                ]
                with m.If(self.datapath.enable):
                    m.d.sync += [tap.inside.eq(inside), tap.watched.eq(watched & self.present), tap.age.eq(age)]
        return expected

    def _check_taps(self, m, expected):
        valid = self.taps_valid
        bits, channels = self.parameters.pixel_bits, self.parameters.channels
        border = sum(self.parameters.border.value << (bits * channel) for channel in range(channels))
        collided = self._collisions(m)
        for (dy, dx), tap in expected.items():
            row, column = self.bilinear.odd_row ^ dy, self.bilinear.odd_column ^ dx
            given = self.bilinear.taps[row][column]
            m.d.comb += [
                Assert(
                    ~(valid & tap.watched) | (given == self.tag(self.column, self.row)),
                    f"{tap.name} is the wanted pixel",
                ),
                Assert(
                    ~(valid & tap.inside & collided[Cat(column, row)]), f"{tap.name} is not read while it is written"
                ),
            ]
            if not self.replicated:
                m.d.comb += Assert(
                    ~(valid & ~tap.inside) | (given == border), f"{tap.name} outside is the border's value"
                )

    def _collisions(self, m):
        """For each bank, whether the address read from was written in the same clock; in step with the taps."""
        collided = []
        for row in range(2):
            for column in range(2):
                ports = [(memory.read_ports[-1], memory.write_ports[-1]) for memory in self.core.bank(row, column)]
                collided.append(Signal(name=f"collided_{row}_{column}"))
                with m.If(self.datapath.enable):
                    m.d.sync += collided[-1].eq(
                        Cat(read.en & write.en & (write.addr == read.addr) for read, write in ports).any()
                    )
        return Array(collided)

    def _cover(self, m, expected):
        valid = self.taps_valid
        later = Signal()  # not the first frame
        with m.If(self.datapath.enable):
            m.d.sync += later.eq(self.fetching.base != 0)
        top, bottom = expected[0, 0], expected[1, 1]
        oldest = self.window.lead + 2 - self.window.d_lo
        m.d.comb += [
            Cover(valid & top.watched & later, "a watched pixel of the second frame is a top left tap"),
            Cover(valid & bottom.watched & ~top.inside & later, "of a window at the edge one tap is inside"),
            Cover(valid & top.watched & (top.age >= oldest), "the oldest row that is kept is read"),
            Cover(
                valid & top.watched & (self.row_in != self.y_in) & ~later, "a frame is read while the next one comes in"
            ),
            Cover(self.core.s_axis.valid & ~self.capture.may_write, "a row waits until it may be written"),
            Cover(valid & top.watched & ~self.datapath.enable, "a window waits at the output"),
        ]


class ExpectedTap:
    """What a tap should be: ``inside`` the source, ``watched`` and there; ``age``, completed rows since, when it
    was read."""

    def __init__(self, proof, name):
        self.name = name
        self.inside, self.watched = (Signal(name=f"{name} {what}".replace(" ", "_")) for what in ("inside", "watched"))
        self.age = Signal(proof.row_bits, name=f"{name} age".replace(" ", "_"))


def row_number_bits(height):
    """Bits in which rows are numbered: half the numbers are more rows than a buffer holds, 2 * height + 1 at most."""
    return ceil_log2(4 * height + 4)


def tag_bits(width, height):
    """Bits that tell a pixel: its column and the number of its row."""
    return ceil_log2(width) + row_number_bits(height)
