"""The rows of the source that are still needed, in four banks that give a 2x2 window each clock."""

from dataclasses import dataclass

from amaranth import Cat, Const, Module, Mux, Signal
from amaranth.lib import data, wiring
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2, exact_log2

from hdl.arithmetic.fixedpoint import Q
from hdl.geometry.coordinates import Border, Window

# Block RAMs on top of each other that still share an output cheaply.
STACKED = 4


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
    def slice_width(self):
        """Bits of a pixel that are kept in a memory of their own.

        All of them, unless that would stack more than ``STACKED`` block RAMs of a 7-series FPGA (as many words of 9, 4,
        2 or 1 bits; AMD UG473) on each other, whose outputs take more look-up tables to choose from than narrower ones.
        """
        for words, width in ((4096, self.pixel_width), (8192, 4), (16384, 2)):
            if self.depth <= STACKED * words:
                return width
        return 1

    @property
    def bits(self):
        """Bits of memory, all banks."""
        return 4 * self.depth * self.pixel_width


class LineBuffer(wiring.Component):
    """Keeps source rows in a ring and reads the window around a source coordinate.

    Row r of the stream of all source rows, frames counted through, is stored in slot r mod rows; slots alternate
    between two pairs of banks, columns between the two banks of a pair, so the four taps of a window always come from
    four banks. Within a bank the address is slot // 2 * pitch + column // 2. The banks are simple dual-port memories
    with one registered read, never initialised, and never read where the write side may write.

    The slot of source row v is found without a division: ``offset`` is the row number that the ring's slot 0 stands
    for, and changes only as the window passes slot 0 and when a frame ends; one conditional subtraction brings v -
    offset into the ring.

    Latency: 2 enabled clocks from ``u`` and ``v`` to ``taps``. Throughput: 1 px/clock.

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
    end_of_line, end_of_frame : In(1)
        The coordinate is that of its output row's, the frame's, last position; end_of_line is low where there is none.
    taps : Out(ArrayLayout(ArrayLayout(pixel_width, 2), 2))
        Indexed [slot parity][column parity]; border values in place.
    fx, fy : Out(fraction_bits), odd_column, odd_row : Out(1)
        Position within the window; which bank holds its left column, its top row.
    """

    latency = 2

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
                "end_of_frame": In(1),
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
        banks = self._banks(m)
        self._write_side(m, banks)

        u, left, right = _window_edges(m, "u", self.u, p.u_range, p.u.fraction_bits, p.width, p.border)
        v, top, bottom = _window_edges(m, "v", self.v, p.v_range, p.v.fraction_bits, p.height, p.border)

        slot_of_row = self._slot(m, v >> p.v.fraction_bits)

        # First stage: place in the ring, and which edges of the window are inside the source.
        column = Signal(ceil_log2(p.width), reset_less=True)
        slot = Signal(range(p.rows), reset_less=True)
        fraction_x = Signal.like(self.fx, reset_less=True)
        fraction_y = Signal.like(self.fy, reset_less=True)
        column_inside = Signal(2, reset_less=True)
        row_inside = Signal(2, reset_less=True)
        with m.If(self.enable):
            m.d.sync += [
                column.eq(u >> p.u.fraction_bits),
                slot.eq(slot_of_row),
                fraction_x.eq(u),
                fraction_y.eq(v),
                column_inside.eq(Cat(left, right)),
                row_inside.eq(Cat(top, bottom)),
            ]

        # Second stage: the memories, whose output registers it shares.
        odd_base = Signal(range(p.rows // 2 * p.pitch + 1))
        even_base = Signal.like(odd_base)
        m.d.comb += [
            odd_base.eq((slot >> 1) * p.pitch),
            even_base.eq(Mux(slot[0], Mux(slot == p.rows - 1, 0, odd_base + p.pitch), odd_base)),
        ]
        bases = (even_base, odd_base)
        # Column -1, whose right tap is column 0, is all ones here: the sum must wrap.
        columns = ((column + 1)[: len(column)] >> 1, column >> 1)
        with m.If(self.enable):
            m.d.sync += [
                self.fx.eq(fraction_x),
                self.fy.eq(fraction_y),
                self.odd_column.eq(column[0]),
                self.odd_row.eq(slot[0]),
            ]
        border = Const(p.border.value, p.channel_bits).replicate(p.channels)
        for row in range(2):
            for col in range(2):
                address = Signal(ceil_log2(p.depth), name=f"read_address_{row}_{col}")
                inside = Signal(name=f"inside_{row}_{col}", reset_less=True)
                pixel = Cat(read.data for _, read in banks[row][col])
                m.d.comb += [
                    address.eq(self._address(bases[row], columns[col])),
                    self.taps[row][col].eq(Mux(inside, pixel, border)),
                ]
                for _, read in banks[row][col]:
                    m.d.comb += [read.en.eq(self.enable), read.addr.eq(address)]
                with m.If(self.enable):
                    # The bank of parity 1 holds the window's first edge if and only if that edge is odd.
                    m.d.sync += inside.eq(
                        row_inside.bit_select(slot[0] ^ row, 1) & column_inside.bit_select(column[0] ^ col, 1)
                    )
        return m

    def _banks(self, m):
        """Write and read ports of each bank's slices, lowest bits first, indexed [slot parity][column parity]."""
        p = self._parameters
        banks = [[None, None], [None, None]]
        for row, row_name in enumerate(("even", "odd")):
            for col, col_name in enumerate(("even", "odd")):
                slices = []
                for low in range(0, p.pixel_width, p.slice_width):
                    width = min(p.slice_width, p.pixel_width - low)
                    memory = Memory(shape=width, depth=p.depth, init=[], attrs={"ram_style": "block"})
                    name = f"bank_{row_name}_row_{col_name}_column"
                    m.submodules[name if width == p.pixel_width else f"{name}_{low}"] = memory
                    slices.append((memory.write_port(), memory.read_port()))
                banks[row][col] = slices
        return banks

    def _address(self, base, column):
        """Address of a column in the row whose address, in granules, is ``base``."""
        p = self._parameters
        low = exact_log2(p.granule)
        return Cat(column[:low], (base + (column >> low))[: ceil_log2(p.depth) - low])

    def _write_side(self, m, banks):
        p = self._parameters
        odd_slot = Signal()
        base = Signal(range(p.rows // 2 * p.pitch))
        with m.If(self.row_written):
            m.d.sync += odd_slot.eq(~odd_slot)
            with m.If(odd_slot):
                m.d.sync += base.eq(base + p.pitch)
                with m.If(base == (p.rows // 2 - 1) * p.pitch):
                    m.d.sync += base.eq(0)
        address = self._address(base, self.x >> 1)
        for row in range(2):
            for col in range(2):
                for index, (write, _) in enumerate(banks[row][col]):
                    m.d.comb += [
                        write.en.eq(self.write & (odd_slot == row) & (self.x[0] == col)),
                        write.addr.eq(address),
                        write.data.eq(self.pixel >> index * p.slice_width),
                    ]

    def _slot(self, m, row):
        """The ring slot of a source row."""
        p = self._parameters
        # One row below the window: a tap pair may start there when only its lower row is inside the source.
        lowest = p.window.d_lo - 1
        first = Signal(range(p.rows), init=lowest % p.rows)  # slot of the lowest row of the output row in progress
        bits = ceil_log2(2 * p.rows)
        offset = Signal(bits, init=(lowest - lowest % p.rows) % 2**bits)
        with m.If(self.enable & self.end_of_line):
            passes_end = first == p.rows - 1
            m.d.sync += first.eq(Mux(passes_end, 0, first + 1))
            m.d.sync += offset.eq(offset + Mux(passes_end, p.rows, 0) - Mux(self.end_of_frame, p.height % 2**bits, 0))
        unwrapped = Signal(bits)
        m.d.comb += unwrapped.eq(row - offset)
        return Mux(unwrapped >= p.rows, unwrapped - p.rows, unwrapped)


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
