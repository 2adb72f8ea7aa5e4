"""The rows of the source that are still needed, in four banks that give a 2x2 window each clock."""

from dataclasses import dataclass

from amaranth import Cat, Const, Module, Mux, Shape, Signal
from amaranth.lib import data, wiring
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2, exact_log2

from hdl.arithmetic.cuts import COMPACT, Pipeline, Stages
from hdl.arithmetic.fixedpoint import Q
from hdl.geometry.coordinates import Border, Window
from hdl.stream.bank import Bank, BankLayout
from hdl.stream.ring import Ring


@dataclass(frozen=True)
class LineBufferParameters:
    """Geometry of the line buffer.

    Parameters
    ----------
    width, height : int
        Source size, px.
    window : Window
        Source rows that each output row needs; sets the rows kept.
    u, v : Q
        Formats of the coordinates.
    u_range, v_range : (int, int)
        Least and greatest coordinate, in units of 2**-fraction_bits px. What cannot happen is not built.
    border : Border
    channel_bits, channels : int
        A pixel is that many channels of that many bits.
    pipeline : Pipeline
    """

    width: int
    height: int
    window: Window
    u: Q
    v: Q
    u_range: tuple[int, int]
    v_range: tuple[int, int]
    border: Border
    channel_bits: int
    channels: int
    pipeline: Pipeline = COMPACT

    def __post_init__(self):
        if not self.window.leaves_room(self.height):
            raise ValueError(
                f"output row 0 needs {self.window.lead + 1} source rows: more than a frame of {self.height} rows allows"
            )

    @property
    def pixel_width(self):
        """Bits of a pixel, all channels."""
        return self.channel_bits * self.channels

    @property
    def rows(self):
        """Source rows kept."""
        return self.window.rows

    @property
    def granule(self):
        """Addresses are summed in units of this many columns, a power of two: the bits below need no adder."""
        columns = (self.width + 1) // 2
        granule = 1
        while -columns % (2 * granule) <= columns // 16:
            granule *= 2
        return granule

    @property
    def pitch(self):
        """Granules from one row to the next within a bank; at most a sixteenth more than the row fills."""
        return -(-((self.width + 1) // 2) // self.granule)

    @property
    def depth(self):
        """Pixels in each of the four banks."""
        return self.rows // 2 * self.pitch * self.granule

    @property
    def bank(self):
        """The `BankLayout` of each of the four banks."""
        return BankLayout.of(self.depth, self.pixel_width, self.pipeline.blocks, self.pipeline.narrow)

    @property
    def ring(self):
        """The `Ring` of the rows kept; one row below the window a tap pair may start, if only its lower row is inside
        the source."""
        return Ring(self.rows, self.pitch, self.height, self.window.d_lo - 1, self.pipeline.ring)

    @property
    def place_latency(self):
        """Enabled clocks from a coordinate to the place of its window."""
        return self.ring.latency

    @property
    def latency(self):
        """Enabled clocks from a coordinate to the taps of its window."""
        return self.place_latency + self.pipeline.address + self.bank.latency + self.pipeline.taps

    @property
    def bits(self):
        """Bits of memory, all banks."""
        return 4 * self.depth * self.pixel_width


class LineBuffer(wiring.Component):
    """Keeps source rows in a ring and reads the window around a source coordinate.

    Row r of the stream of all source rows, frames counted through, is stored in slot r mod rows; slots alternate
    between two pairs of banks, columns between the two banks of a pair, so the four taps of a window always come from
    four banks. Within a bank the address is slot // 2 * pitch + column // 2. The banks are never read where the write
    side may write.

    Latency: `LineBufferParameters.latency` enabled clocks from ``u`` and ``v`` to ``taps``, ``place_latency`` to what
    is said of the window. Throughput: 1 px/clock.

    Parameters
    ----------
    parameters : LineBufferParameters

    Members
    -------
    write : In(1), x : In, pixel : In(pixel_width)
        Store ``pixel`` in column ``x`` of the row in progress.
    row_written : In(1)
        The row in progress is complete with this clock.
    enable : In(1)
        The read side moves on in this clock.
    u, v : In(formats of the parameters)
        Source coordinate.
    end_of_line : In(1)
        The coordinate is that of its output row's last position; low where there is none.
    last_row : In(1)
        The output row is its frame's last one; so for the whole row.
    taps : Out(ArrayLayout(ArrayLayout(pixel_width, 2), 2))
        Indexed [slot parity][column parity]; border values in place.
    fx, fy : Out(fraction_bits), odd_column, odd_row : Out(1)
        Position within the window; which bank holds its left column, its top row.
    """

    def __init__(self, parameters):
        self._parameters = p = parameters
        super().__init__(
            {
                "write": In(1),
                "x": In(ceil_log2(p.width + 1)),
                "pixel": In(p.pixel_width),
                "row_written": In(1),
                "enable": In(1),
                "u": In(p.u.shape),
                "v": In(p.v.shape),
                "end_of_line": In(1),
                "last_row": In(1),
                "taps": Out(data.ArrayLayout(data.ArrayLayout(p.pixel_width, 2), 2)),
                "fx": Out(p.u.fraction_bits),
                "fy": Out(p.v.fraction_bits),
                "odd_column": Out(1),
                "odd_row": Out(1),
            }
        )

    def elaborate(self, platform):
        m = Module()
        p = self._parameters
        stages = Stages(m, self.enable)
        names = [[f"bank_{row}_row_{column}_column" for column in ("even", "odd")] for row in ("even", "odd")]
        banks = [[Bank(m, name, p.bank) for name in pair] for pair in names]
        self._write_side(m, banks)

        u, left, right = _window_edges(m, "u", self.u, p.u_range, p.u.fraction_bits, p.width, p.border)
        v, top, bottom = _window_edges(m, "v", self.v, p.v_range, p.v.fraction_bits, p.height, p.border)

        # Place in the ring, and which edges of the window are inside the source.
        bases, odd_row = p.ring.pair(m, stages, v >> p.v.fraction_bits, self.end_of_line, self.last_row)
        # Signed where the left tap may be in column -1; farther outside it does not matter.
        column = Signal(Shape(ceil_log2(p.width) + (p.u_range[0] < 0), p.u_range[0] < 0))
        m.d.comb += column.eq(u >> p.u.fraction_bits)

        def placed(name, value):
            return stages.after(name, value, p.place_latency)

        column = placed("column", column)
        column_inside, row_inside = placed("column_inside", Cat(left, right)), placed("row_inside", Cat(top, bottom))
        m.d.comb += [
            self.fx.eq(placed("fraction_x", u[: len(self.fx)])),
            self.fy.eq(placed("fraction_y", v[: len(self.fy)])),
            self.odd_column.eq(column[0]),
            self.odd_row.eq(odd_row),
        ]

        # The memories.
        border = Const(p.border.value, p.channel_bits).replicate(p.channels)
        for row in range(2):
            for col in range(2):
                place = f"{row}_{col}"
                address = Signal(ceil_log2(p.depth), name=f"read_address_{place}")
                inside = Signal(name=f"reads_{place}")
                m.d.comb += [
                    # The even column of a pair is the pair's first, or the next pair's.
                    address.eq(self._address(bases[row], column >> 1, None if col else column[0])),
                    # The bank of parity 1 holds the window's first edge if and only if that edge is odd.
                    inside.eq(row_inside.bit_select(odd_row ^ row, 1) & column_inside.bit_select(column[0] ^ col, 1)),
                ]
                address = stages.after(f"address_{place}", address, p.pipeline.address)
                inside = stages.after(f"inside_{place}", inside, p.pipeline.address + p.bank.latency)
                tap = Mux(inside, banks[row][col].read(stages, self.enable, address), border)
                m.d.comb += self.taps[row][col].eq(stages.after(f"tap_{place}", tap, p.pipeline.taps))
        return m

    def _address(self, base, pair, carry=None):
        """Address of a pair of columns, or with ``carry`` the next one, in the row whose address, in granules, is
        ``base``."""
        p = self._parameters
        low, bits = exact_log2(p.granule), ceil_log2(p.depth)
        if carry is None:
            return Cat(pair[:low], (base + (pair >> low))[: bits - low])
        # The carry comes in by a bit of its own, below.
        following = Cat(carry, pair)
        total = Cat(Const(1), Const(0, low), base) + (following.as_signed() if pair.shape().signed else following)
        return total[1 : bits + 1]

    def _write_side(self, m, banks):
        p = self._parameters
        odd_slot = Signal()
        base = Signal(p.ring.address_bits)
        end = Signal(reset_less=p.pipeline.writes)
        # Registered it is right a clock later; the base changes with every second row only.
        domain = m.d.sync if p.pipeline.writes else m.d.comb
        domain += end.eq(base == (p.rows // 2 - 1) * p.pitch)
        with m.If(self.row_written):
            m.d.sync += odd_slot.eq(~odd_slot)
            with m.If(odd_slot):
                m.d.sync += base.eq(base + p.pitch)
                with m.If(end):
                    m.d.sync += base.eq(0)
        clocks = Stages(m, 1)
        address = clocks.after("write_address", self._address(base, self.x >> 1), p.pipeline.writes)
        pixel = clocks.after("write_pixel", self.pixel, p.pipeline.writes)
        for row in range(2):
            for col in range(2):
                enable = self.write & (odd_slot == row) & (self.x[0] == col)
                banks[row][col].write(clocks.after(f"write_{row}_{col}", enable, p.pipeline.writes), address, pixel)


def _window_edges(m, name, coordinate, span, fraction_bits, size, border):
    """A coordinate, held within the source where the border is replicated, and whether its two taps are inside.

    Comparisons that the coordinate's range settles are left out.
    """
    low, high = (limit >> fraction_bits for limit in span)
    if border.mode == "replicate":
        # At the last row or column the fraction is zero, so the tap beyond it has no weight.
        last = (size - 1) << fraction_bits
        held = Signal.like(coordinate, name=f"{name}_held")
        m.d.comb += held.eq(coordinate)
        if span[0] < 0:
            with m.If(coordinate < 0):
                m.d.comb += held.eq(0)
        if span[1] > last:
            with m.If(coordinate > last):
                m.d.comb += held.eq(last)
        return held, Const(1), Const(1)

    whole = coordinate >> fraction_bits
    edges = []
    for tap in range(2):
        conditions = [Const(1, 1)]
        if low < -tap:
            conditions.append(whole >= -tap)
        if high > size - 1 - tap:
            conditions.append(whole <= size - 1 - tap)
        edges.append(Cat(*conditions).all())
    return coordinate, *edges
