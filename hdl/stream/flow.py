"""Which row may be written and which may be read: the flow control between the two sides of the line buffer."""

from amaranth import Module, Mux, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from hdl.errors import at_least


class RowFlow(wiring.Component):
    """Compares the rows that came in with the rows that went out.

    ``ahead`` is the number of source rows completed minus the output row in progress, frames counted through. Output
    row y may start once source row y + lead is complete, or the whole frame is. A source row may be written while it is
    at most lead + 1 rows ahead of the output row in progress. The buffer holds lead - d_lo + 3 rows, so what is
    overwritten lies two rows or more below the lowest row of the output row in progress, one or more below that of the
    previous one: its last pixels may still be on their way to the memories (the pipeline is shorter than a row).

    Zero stall: where both sides move one pixel per clock, source row y + lead + 2 starts in the very clock in which
    output row y + 1 starts, so ``may_write`` never drops. Where the read side fell behind (its output paused, or source
    rows were shorter than they should be), ``may_write`` drops until it has caught up, for as many clocks as it fell
    behind, or fewer.

    Parameters
    ----------
    lead : int
        `Window.lead`; ValueError below 0.

    Members
    -------
    row_written, frame_written : In(1)
        A source row, the frame's last one, becomes complete with this clock.
    row_issued, frame_issued : In(1)
        An output row's, the frame's, last position is issued in this clock.
    may_write : Out(1)
        The next source row may be written. Depends on registers only.
    may_issue : Out(1)
        The output row in progress has its source rows. Depends on registers only.
    """

    def __init__(self, lead):
        at_least(0, lead=lead)
        self._lead = lead
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
        ahead = Signal(range(self._lead + 3))
        complete = Signal()  # the frame whose row is in progress is complete
        with m.If(self.row_written ^ self.row_issued):
            m.d.sync += ahead.eq(ahead + Mux(self.row_issued, -1, 1))
        with m.If(self.frame_written):
            m.d.sync += complete.eq(1)
        with m.Elif(self.frame_issued):
            m.d.sync += complete.eq(0)
        m.d.comb += [
            self.may_write.eq(ahead != self._lead + 2),
            self.may_issue.eq((ahead > self._lead) | complete),
        ]
        return m
