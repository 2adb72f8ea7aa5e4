"""Where in the line buffer's banks source rows and columns are."""

from amaranth import Array, Const, Mux, Signal
from amaranth.utils import ceil_log2

# Rows up to which the addresses of rows come from a table, as look-up tables.
_TABLE_ROWS = 64


class Ring:
    """The slots of source rows: the row that comes in as number r, frames counted through, is in slot r mod rows.

    The slot of source row v is found without a division: ``offset`` is the row number that the ring's slot 0 stands
    for, and changes only as the window passes slot 0 and when a frame ends; v - offset is a slot, or rows more than
    one.

    Parameters
    ----------
    rows : int
        Rows kept; even, so that a row's parity is its slot's.
    pitch : int
        From the address of a slot to that of the next but one, which is in the same bank.
    height : int
        Frame height, px.
    lowest : int
        Distance from an output row to the lowest source row that its windows may begin at.
    registered : bool
        Whether what is known a row ahead is computed a row ahead, and addresses are registered.
    """

    def __init__(self, rows, pitch, height, lowest, registered=False):
        self._rows, self._pitch, self._height, self._lowest = rows, pitch, height, lowest
        self._registered = registered

    @property
    def address_bits(self):
        """Of a row's address, which is (rows / 2 - 1) * pitch at most."""
        return ceil_log2((self._rows // 2 - 1) * self._pitch + 1)

    @property
    def latency(self):
        """Enabled clocks from a source row to the addresses of its pair."""
        return 2 if self._registered and self._rows > _TABLE_ROWS else 1

    def pair(self, m, stages, row, end_of_line, last_row):
        """Addresses of a source row and the one below it, `latency` enabled clocks late.

        Parameters
        ----------
        m : Module
        stages : Stages
            Of the pipeline.
        row : Value
            The upper of the two; one of those that the output row may ask for.
        end_of_line : Value
            ``row`` is that of its output row's last position.
        last_row : Value
            The output row is its frame's last one; known all along the row.

        Returns
        -------
        (even, odd), odd_row
            Addresses in the banks of even and of odd slots, and whether the upper row is in an odd slot.
        """
        unwrapped = Signal(ceil_log2(2 * self._rows))
        m.d.comb += unwrapped.eq(row - self._offset(m, stages.enable & end_of_line, last_row))
        if self._registered and self._rows <= _TABLE_ROWS:
            odd_row = unwrapped[0]
            even, odd = (
                Array(self._address(place + more) for place in range(1 << len(unwrapped)))[unwrapped]
                for more in (1, 0)
            )
        else:
            slot = Signal(range(self._rows), reset_less=True)
            with m.If(stages.enable):
                m.d.sync += slot.eq(Mux(unwrapped >= self._rows, unwrapped - self._rows, unwrapped))
            odd_row = slot[0]
            even = Signal(self.address_bits)
            odd = Signal(self.address_bits)
            below = Mux(slot == self._rows - 1, 0, odd + self._pitch)
            m.d.comb += [odd.eq((slot >> 1) * self._pitch), even.eq(Mux(odd_row, below, odd))]
        if self._registered:
            even, odd, odd_row = (
                stages.after(name, value)
                for name, value in (("even_base", even), ("odd_base", odd), ("odd_row", odd_row))
            )
        return (even, odd), odd_row

    def _address(self, place):
        """Of the pair of banks' slot with the number ``place``, which may be rows more than it is."""
        return Const(place // 2 % (self._rows // 2) * self._pitch, self.address_bits)

    def _offset(self, m, end_of_line, last_row):
        """The row number that slot 0 stands for."""
        rows, bits = self._rows, ceil_log2(2 * self._rows)
        first = Signal(range(rows), init=self._lowest % rows)  # slot of the lowest row of the output row in progress
        offset = Signal(bits, init=(self._lowest - self._lowest % rows) % 2**bits)
        # Registered they are right two clocks later; a row takes longer.
        passes_end = Signal(init=self._registered and self._lowest % rows == rows - 1)
        following = Signal(bits, reset_less=self._registered)
        domain = m.d.sync if self._registered else m.d.comb
        domain += [
            passes_end.eq(first == rows - 1),
            following.eq(offset + Mux(passes_end, rows, 0) - Mux(last_row, self._height % 2**bits, 0)),
        ]
        with m.If(end_of_line):
            m.d.sync += [offset.eq(following), first.eq(Mux(passes_end, 0, first + 1))]
        return offset
