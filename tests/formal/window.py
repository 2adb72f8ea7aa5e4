"""The line buffer gives the interpolator the very pixels that the datapath asks for, whatever happens at the streams.

The pixels at s_axis are made to tell which they are: their source row's number, frames counted through, and their
column. The datapath asks for any window it may. One pixel of the source, any one, is watched: what holds for it holds
for all.
"""

from contextlib import nullcontext
from types import SimpleNamespace
from unittest import mock

from amaranth import Array, Cat, Const, Module, Mux, Signal
from amaranth.asserts import AnyConst
from amaranth.hdl import Assert, Assume, Cover, Elaboratable
from amaranth.utils import ceil_log2, exact_log2

from .core import FreeCore
from .lemmas import WatchedMemory, window_lemmas


class Position:
    """A raster position between the datapath and the memories.

    Members: ``valid``; ``x`` and ``y``, its column and row; ``base``, the number of its frame's first source row;
    ``ends``, its row ends with it; ``u`` and ``v``, its coordinate.
    """

    def __init__(self, proof, stage, **given):
        kinds = {
            "valid": 1,
            "ends": 1,
            "x": range(proof.width),
            "y": range(proof.height),
            "base": proof.row_bits,
            "u": proof.datapath.u.shape(),
            "v": proof.datapath.v.shape(),
        }
        for name, shape in kinds.items():
            setattr(self, name, given[name] if name in given else Signal(shape, name=f"{stage}_{name}"))

    def follow(self, other):
        """Statements that copy the other."""
        return [mine.eq(its) for mine, its in zip(vars(self).values(), vars(other).values())]


class Taps:
    """A window on its way from the memories to the interpolator.

    Members: ``valid``; ``odd_row`` and ``odd_column``, where its top left tap comes from; by (dy, dx) of its taps
    ``inside``, the tap is inside the source, and ``watched``, it is the watched pixel, which came in.
    """

    def __init__(self, stage):
        self.valid, self.odd_row, self.odd_column = (
            Signal(name=f"{stage}_{name}") for name in ("valid", "odd_row", "odd_column")
        )
        self.inside, self.watched = (
            {(dy, dx): Signal(name=f"{stage}_{name}_{dy}_{dx}") for dy in range(2) for dx in range(2)}
            for name in ("inside", "watched")
        )

    def bank(self, dy, dx):
        """Parity of slot and column of the bank that a tap comes from."""
        return self.odd_row ^ dy, self.odd_column ^ dx

    def follow(self, other):
        """Statements that copy the other."""
        return [
            self.valid.eq(other.valid),
            self.odd_row.eq(other.odd_row),
            self.odd_column.eq(other.odd_column),
            *(
                mine[at].eq(its[at])
                for mine, its in ((self.inside, other.inside), (self.watched, other.watched))
                for at in mine
            ),
        ]


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
        with mock.patch("hdl.stream.bank.Memory", WatchedMemory) if lemmas else nullcontext():
            self.core = FreeCore(parameters)
        self.capture, self.datapath, self.bilinear = (
            self.core.parts[name] for name in ("capture", "datapath", "bilinear")
        )
        self.column_bits, self.row_bits = ceil_log2(self.width), row_number_bits(self.height)

        # Rows that came in, those of them that are in the memories, and which row of a frame is coming in.
        self.row_in, self.y_in = Signal(self.row_bits), Signal(range(self.height))
        self.row_stored, self.just_written = Signal(self.row_bits), Signal()
        # The pixel that is watched; whether it came in, or its line did without it.
        self.row, self.column = Signal(self.row_bits), Signal(self.column_bits)
        self.present, self.missing = Signal(), Signal()
        # Positions on their way through the datapath, the newest first.
        self.x = Signal(range(self.width))
        self.on_the_way = [
            SimpleNamespace(
                valid=Signal(name=f"way_{stage}_valid"),
                ends=Signal(name=f"way_{stage}_ends"),
                x=Signal.like(self.x, name=f"way_{stage}_x"),
            )
            for stage in range(parameters.datapath.latency)
        ]
        # With coordinates, up to the memories.
        self.issued = SimpleNamespace(valid=self.core.issue, ends=Signal(), x=self.x)
        last = vars(([self.issued, *self.on_the_way])[-1])
        self.reading = Position(self, "reading", u=self.datapath.u, v=self.datapath.v, **last)
        clocks = buffer.place_latency + buffer.pipeline.address
        self.windows = [Position(self, f"window_{stage}") for stage in range(1, clocks + 1)]
        self.placed, self.fetching = self.windows[buffer.place_latency - 1], self.windows[-1]
        # In the clock in which they are read, and in those after it.
        self.read = Taps("read")
        self.taps = [Taps(f"taps_{stage}") for stage in range(clocks + 1, buffer.latency + 1)]
        self.age = {at: Signal(self.row_bits, name=f"age_{at[0]}_{at[1]}") for at in self.read.inside}

    def elaborate(self, platform):
        m = Module()
        self.core.add_to(m)
        if self._steady:
            self.core.add_steady_streams_to(m)
        self._follow_input(m)
        self._follow_output(m)
        self._expect(m)
        self._check_taps(m)
        if self._with_lemmas:
            window_lemmas(m, self)
        if self._with_covers:
            self._cover(m)
        return m

    def tag(self, column, row):
        """The pixel that comes in at this place."""
        return Cat(column[: self.column_bits], row)

    @staticmethod
    def clamped(index, size):
        """The index of the nearest pixel."""
        return Mux(index < 0, 0, Mux(index > size - 1, size - 1, index))

    def _follow_input(self, m):
        # Nothing but the pixels' way depends on them, so each may be told which it is before its place is known.
        pixel = self.core.parts["line_buffer"].pixel
        told = pixel[: self.column_bits + self.row_bits] == self.tag(self.capture.x, self.row_in)
        m.d.comb += Assume(~self.capture.write | told, "pixels tell which they are")
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
        if self.parameters.pipeline.writes:
            m.d.sync += self.just_written.eq(self.capture.row_written)
        m.d.comb += self.row_stored.eq(self.row_in - self.just_written)

    def _follow_output(self, m):
        reading, issue = self.reading, self.core.issue
        m.d.comb += self.issued.ends.eq(issue & (self.x == self.width - 1))
        with m.If(issue):
            m.d.sync += self.x.eq(Mux(self.issued.ends, 0, self.x + 1))
        with m.If(self.datapath.enable):
            for before, after in zip([self.issued, *self.on_the_way], self.on_the_way):
                m.d.sync += [getattr(after, name).eq(its) for name, its in vars(before).items()]
            for before, after in zip([reading, *self.windows], self.windows):
                m.d.sync += after.follow(before)
            for before, after in zip([self.read, *self.taps], self.taps):
                m.d.sync += after.follow(before)
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

    def whole(self, position):
        """Of a window, by axis: the first of its two places, the fraction, and which of them are inside the source; as
        the line buffer has them."""
        f, found = self.parameters.datapath.fraction_bits, {}
        for axis, coordinate, size in (("x", position.u, self.width), ("y", position.v, self.height)):
            place, fraction = coordinate >> f, coordinate[:f]
            inside = [(place >= -tap) & (place < size - tap) for tap in range(2)]
            if self.replicated:
                fraction = Mux((coordinate >= 0) & (coordinate < (size - 1) << f), fraction, 0)
                place, inside = self.clamped(place, size), [1, 1]
            found[axis] = place, fraction, inside
        return found

    def _expect(self, m):
        """What the window that is being read is to hold."""
        placed, position, read = self.placed, self.fetching, self.read
        for axis, (_, fraction, _) in self.whole(placed).items():
            m.d.comb += Assert(
                ~placed.valid | (getattr(self.bilinear, f"f{axis}") == fraction),
                f"the fraction in {axis} is the coordinate's",
            )
        odd = self.bilinear.odd_row, self.bilinear.odd_column
        if self.placed is not self.fetching:
            before, odd = odd, (Signal(name="odd_row"), Signal(name="odd_column"))
            with m.If(self.datapath.enable):
                m.d.sync += [mine.eq(its) for mine, its in zip(odd, before)]
        m.d.comb += [read.valid.eq(position.valid), Cat(read.odd_row, read.odd_column).eq(Cat(odd))]

        whole = self.whole(position)
        for (dy, dx), inside in read.inside.items():
            (column, weight_x, inside_x), (row, weight_y, inside_y) = (
                (place + tap, fraction != 0 if tap else 1, inside[tap])
                for (place, fraction, inside), tap in ((whole["x"], dx), (whole["y"], dy))
            )
            is_inside = inside_x & inside_y
            if self.replicated:
                # Only where the border is replicated may a tap be anything if it has no weight.
                is_inside = weight_x & weight_y
            number, tap = (position.base + row)[: self.row_bits], f"tap ({dy}, {dx})"
            watched, age = Signal(name=f"watched_{dy}_{dx}"), self.age[dy, dx]
            m.d.comb += [
                inside.eq(is_inside),
                watched.eq(is_inside & (number == self.row) & (column == self.column)),
                read.watched[dy, dx].eq(watched & self.present),
                age.eq(self.row_stored - number),
                Assert(~(position.valid & inside) | ((age != 0) & ~age[-1]), f"{tap} is read from a complete row"),
                Assert(
                    ~(position.valid & watched) | self.present | self.missing, f"{tap} is read from a row that came in"
                ),
            ]

    def _check_taps(self, m):
        taps = self.taps[-1]
        bits, channels = self.parameters.pixel_bits, self.parameters.channels
        border = sum(self.parameters.border.value << (bits * channel) for channel in range(channels))
        collided = self._collisions()
        for dy, dx in taps.inside:
            row, column = taps.bank(dy, dx)
            given, tap = self.bilinear.taps[row][column], f"tap ({dy}, {dx})"
            told = given[: self.column_bits + self.row_bits] == self.tag(self.column, self.row)
            row, column = self.read.bank(dy, dx)
            m.d.comb += [
                Assert(~(taps.valid & taps.watched[dy, dx]) | told, f"{tap} is the wanted pixel"),
                Assert(
                    ~(self.read.valid & self.read.inside[dy, dx] & collided[Cat(column, row)]),
                    f"{tap} is not read while it is written",
                ),
            ]
            if not self.replicated:
                m.d.comb += Assert(
                    ~(taps.valid & ~taps.inside[dy, dx]) | (given == border), f"{tap} outside is the border's value"
                )

    def _collisions(self):
        """For each bank, whether the address that is read is written in this clock."""
        collided, layout = [], self.parameters.line_buffer.bank
        for row in range(2):
            for column in range(2):
                chosen = Const(0)
                if layout.stack > 1:
                    address = self.core.registers[f"line_buffer.address_{row}_{column}"]
                    chosen = address[exact_log2(layout.words) :]
                ports = [
                    (index, memory.read_ports[-1], memory.write_ports[-1])
                    for index, memories in enumerate(self.core.bank(row, column))
                    for memory in memories
                ]
                collided.append(
                    Cat(
                        (chosen == index) & read.en & write.en & (write.addr == read.addr)
                        for index, read, write in ports
                    ).any()
                )
        return Array(collided)

    def _cover(self, m):
        taps, later = self.taps[0], Signal()  # not the first frame
        age = Signal(self.row_bits)
        with m.If(self.datapath.enable):
            m.d.sync += [later.eq(self.fetching.base != 0), age.eq(self.age[0, 0])]
        top, bottom = (taps.valid & taps.watched[at] for at in ((0, 0), (1, 1)))
        oldest = self.window.lead + 2 - self.window.d_lo
        m.d.comb += [
            Cover(top & later, "a watched pixel of the second frame is a top left tap"),
            Cover(bottom & ~taps.inside[0, 0] & later, "of a window at the edge one tap is inside"),
            Cover(top & (age >= oldest), "the oldest row that is kept is read"),
            Cover(top & (self.row_in != self.y_in) & ~later, "a frame is read while the next one comes in"),
            Cover(self.core.inner.valid & ~self.capture.may_write, "a row waits until it may be written"),
            Cover(top & ~self.datapath.enable, "a window waits at the output"),
        ]


def row_number_bits(height):
    """Bits in which rows are numbered: half the numbers are more rows than a buffer holds, 2 * height + 1 at most."""
    return ceil_log2(4 * height + 4)


def tag_bits(width, height):
    """Bits that tell a pixel: its column and the number of its row."""
    return ceil_log2(width) + row_number_bits(height)
