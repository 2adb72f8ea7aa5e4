"""What `Capture` makes of any stream of beats."""

from amaranth import Module, Mux, Signal
from amaranth.asserts import AnySeq
from amaranth.hdl import Assert, Cover, Elaboratable

from hdl.stream.capture import Capture

from .opened import Opened


class CaptureProof(Elaboratable):
    """Every frame that was started is given out whole, in step with the next start; the stream is arbitrary.

    Parameters
    ----------
    width, height : int
        px
    ahead : bool
        As of `Capture`.
    lemmas : bool
        Assert also what makes these assertions inductive.
    """

    def __init__(self, width, height, ahead=False, lemmas=True):
        self._width, self._height, self._ahead, self._lemmas = width, height, ahead, lemmas
        self._capture = Capture(width, height, ahead)

    def elaborate(self, platform):
        m = Module()
        width, height, capture = self._width, self._height, self._capture
        m.submodules.capture = opened = Opened(capture)
        m.d.comb += [signal.eq(AnySeq(1)) for signal in (capture.valid, capture.sof, capture.eol, capture.may_write)]
        taken, is_start = capture.valid & capture.ready, capture.valid & capture.sof

        # The frame that was started, its rows that are complete, and the pixels of the next one.
        started, rows, pixels = Signal(), Signal(range(height + 1)), Signal(range(width + 1))
        belongs = taken & (started | capture.sof)
        m.d.sync += started.eq((started | (taken & capture.sof)) & ~capture.frame_written)
        with m.If(capture.row_written):
            m.d.sync += [rows.eq(Mux(capture.frame_written, 0, rows + 1)), pixels.eq(0)]
        with m.Elif(capture.write):
            m.d.sync += pixels.eq(pixels + 1)

        def check(fact, name):
            m.d.comb += Assert(fact, name)

        check(capture.may_write | ~(capture.write | capture.row_written | capture.ready), "nothing moves unless it may")
        check(
            ~capture.write | (taken & (capture.x == pixels) & (pixels < width)), "pixels are written column by column"
        )
        check(~(belongs & (pixels < width)) | capture.write, "no pixel of a frame's line is lost")
        check(
            ~capture.write | (started != capture.sof), "a frame is written from its start, and no other start into it"
        )
        check(started | ~capture.frame_written | (height == 1), "a frame is complete after it was started")
        check(capture.frame_written == (capture.row_written & (rows == height - 1)), "a frame has its height in rows")
        check(~(belongs & capture.eol) | capture.row_written, "an end of line completes a row")
        check(
            ~capture.row_written | (belongs & capture.eol) | (started & is_start & ~taken),
            "but for an end of line, rows are completed only while a start waits",
        )
        check(
            ~(started & is_start & capture.may_write) | (capture.row_written & ~taken),
            "a start waits for the rest of the frame before, a row a clock",
        )
        check(
            (started & is_start) | (capture.ready == capture.may_write),
            "any other beat waits only until a row may be written",
        )
        if self._lemmas:
            check(opened.registers["in_frame"] == started, "lemma: the frame in progress")
            check((capture.x == pixels) & (pixels <= width) & (started | (pixels == 0)), "lemma: the column")
            if self._ahead:
                check(opened.registers["line_is_full"] == (pixels == width), "lemma: a line's end is known")
                check(opened.registers["is_last_line"] == (rows == height - 1), "lemma: the last line is known")
            check((opened.registers["y"] == rows) & (rows < height) & (started | (rows == 0)), "lemma: the row")
        m.d.comb += [
            Cover(capture.frame_written & ~taken, "a frame is complete before all of its lines came in"),
            Cover(belongs & ~capture.write, "a pixel beyond the line is dropped"),
            Cover(taken & ~belongs, "a beat between frames is dropped"),
            Cover(capture.row_written & taken & (pixels < width - 1), "a short line is complete"),
        ]
        return m
