"""From the beats of an AXI4-Stream video to pixels of numbered columns and complete rows."""

from amaranth import Module, Mux, Signal
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
    ahead : bool
        Whether a line is full, and the last one, is looked at a beat ahead, and registered.

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

    def __init__(self, width, height, ahead=False):
        at_least(1, width=width, height=height)
        self._width = width
        self._height = height
        self._ahead = ahead
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
        # Each on a line of its own, from which Amaranth has its name.
        in_frame = Signal()
        in_step = Signal()
        moves = Signal()
        line_is_full = Signal()
        is_last_line = Signal(init=self._ahead and self._height == 1)
        m.d.comb += [
            # Out of step are beats between frames, and a start of frame within one: then lines are missing.
            in_step.eq(in_frame ^ self.sof),
            moves.eq(self.valid & self.may_write),
            self.ready.eq(self.may_write & ~(in_frame & self.valid & self.sof)),
            self.write.eq(moves & in_step & ~line_is_full),
            self.row_written.eq(moves & Mux(in_step, self.eol, in_frame)),
            self.frame_written.eq(self.row_written & is_last_line),
        ]
        with m.If(self.write):
            m.d.sync += [self.x.eq(self.x + 1), in_frame.eq(1)]
        with m.If(self.row_written):
            m.d.sync += [self.x.eq(0), y.eq(y + 1)]
        with m.If(self.frame_written):
            m.d.sync += [y.eq(0), in_frame.eq(0)]
        if self._ahead:
            with m.If(self.write):
                m.d.sync += line_is_full.eq(self.x == self._width - 1)
            with m.If(self.row_written):
                m.d.sync += [line_is_full.eq(0), is_last_line.eq(y == (self._height - 2) % self._height)]
        else:
            m.d.comb += [line_is_full.eq(self.x == self._width), is_last_line.eq(y == self._height - 1)]
        return m
