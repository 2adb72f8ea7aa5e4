"""Which row may be written and which may be read: the flow control between the two sides of the line buffer."""

from amaranth import Module, Mux, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2

from hdl.errors import at_least


class RowFlow(wiring.Component):
    """Compares the rows that came in with the rows that went out.

    Output row y may start once source row y + lead is complete, or the whole frame is. A source row may be written
    while it is at most lead + 1 rows ahead of the output row in progress. The buffer holds lead - d_lo + 3 rows, so
    what is overwritten lies two rows or more below the lowest row of the output row in progress, one or more below that
    of the previous one: its last pixels may still be on their way to the memories, or even wait to be issued (the
    pipeline, and the positions by which `Issue` counts a row early, are together shorter than a row).

    ``margin`` is the number of source rows completed beyond those that the output row in progress needs, frames counted
    through: -lead - 1 to 1.

    Parameters
    ----------
    lead : int
        `Window.lead`; ValueError below 0.
    ahead : bool
        One more bit, so that the permission to issue is a sign rather than a comparison.

    Members
    -------
    row_written, frame_written : In(1)
        A source row, the frame's last one, becomes complete with this clock.
    row_issued, frame_issued : In(1)
        An output row, the frame's last one, counts as issued with this clock.
    may_write : Out(1)
        The next source row may be written. Depends on registers only.
    may_issue : Out(1)
        The output row in progress has its source rows. Depends on registers only.
    """

    def __init__(self, lead, ahead=False):
        at_least(0, lead=lead)
        self._lead, self._ahead = lead, ahead
        super().__init__(
            {
                "row_written": In(1),
                "frame_written": In(1),
                "row_issued": In(1),
                "frame_issued": In(1),
                "may_write": Out(1),
                "may_issue": Out(1),
            }
        )

    def elaborate(self, platform):
        m = Module()
        bits = ceil_log2(self._lead + 3) + self._ahead
        margin = Signal(bits, init=-(self._lead + 1) % 2**bits)
        complete = Signal()  # the frame whose row is in progress is complete
        with m.If(self.row_written ^ self.row_issued):
            m.d.sync += margin.eq(margin + Mux(self.row_issued, -1, 1))
        with m.If(self.frame_written):
            m.d.sync += complete.eq(1)
        with m.Elif(self.frame_issued):
            m.d.sync += complete.eq(0)
        enough = ~margin[-1] if self._ahead else margin[1:] == 0
        m.d.comb += [
            self.may_write.eq(~(enough & margin[0])),
            self.may_issue.eq(enough | complete),
        ]
        return m
