"""From the beats of an AXI4-Stream video to pixels of numbered columns and complete rows."""

from amaranth import Module, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2

from hdl.errors import at_least


class Capture(wiring.Component):
    """Finds frames and lines in the input stream and keeps to them when the stream does not.

    A frame starts at a beat with ``sof`` and has ``height`` lines; a line ends at a beat with ``eol``. Where the stream
    deviates, every frame that was started is still given out whole, and the next start of frame is in step again:

    - beats before a start of frame, after reset or after the last line of a frame, are taken and dropped;
    - of a line that is too long, the pixels beyond ``width`` are dropped;
    - of a line that is too short, the missing pixels are what the line buffer held there before;
    - a start of frame before the last line: the beat waits while the missing lines, and the rest of the current one,
      are declared complete, with what the line buffer held there before.

    Parameters
    ----------
    width, height : int
        Frame size, px; ValueError below 1.

    Members
    -------
    valid, sof, eol : In(1), ready : Out(1)
        The input stream. ``ready`` waits for a row to write to, and for missing lines.
    may_write : In(1)
        A row may be written (`RowFlow`).
    write : Out(1)
        The beat in transfer is pixel ``x`` of the row in progress.
    x : Out
        Column, px; meaningful with ``write``.
    row_written, frame_written : Out(1)
        The row in progress, the frame's last one, becomes complete with this clock.
    """

    def __init__(self, width, height):
        at_least(1, width=width, height=height)
        self._width = width
        self._height = height
        super().__init__(
            {
                "valid": In(1),
                "ready": Out(1),
                "sof": In(1),
                "eol": In(1),
                "may_write": In(1),
                "write": Out(1),
                "x": Out(ceil_log2(width + 1)),
                "row_written": Out(1),
                "frame_written": Out(1),
            }
        )

    def elaborate(self, platform):
        m = Module()
        y = Signal(range(self._height))
        in_frame = Signal()
        missing_lines = Signal()
        transfer = Signal()
        m.d.comb += [
            missing_lines.eq(in_frame & self.valid & self.sof),
            self.ready.eq(self.may_write & ~missing_lines),
            transfer.eq(self.valid & self.ready & (in_frame | self.sof)),
            self.write.eq(transfer & (self.x != self._width)),
            self.row_written.eq((transfer & self.eol) | (missing_lines & self.may_write)),
            self.frame_written.eq(self.row_written & (y == self._height - 1)),
        ]
        with m.If(self.write):
            m.d.sync += [self.x.eq(self.x + 1), in_frame.eq(1)]
        with m.If(self.row_written):
            m.d.sync += [self.x.eq(0), y.eq(y + 1)]
        with m.If(self.frame_written):
            m.d.sync += [y.eq(0), in_frame.eq(0)]
        return m
