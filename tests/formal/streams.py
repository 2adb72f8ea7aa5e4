"""What the core promises at its streams: beats that stay, frames that are whole, input that never waits, frames
that drain."""

from amaranth import Module, Mux, ResetSignal, Signal
from amaranth.asserts import AnySeq
from amaranth.hdl import Assert, Assume, Cover, Elaboratable

from hdl.stream.raster import NEAR

from .axi import Stability, VideoFormat
from .control import Control
from .core import FreeCore
from .drain import frames_lemmas


class StabilityProof(Elaboratable):
    """Beats at m_axis stay until they are taken, and there are none in reset; inputs and resets are arbitrary.

    Parameters
    ----------
    parameters : RectifierParameters
    """

    def __init__(self, parameters):
        self._core = FreeCore(parameters)

    def elaborate(self, platform):
        m = Module()
        self._core.add_to(m)
        out = self._core.m_axis
        m.submodules.stability = Stability(out)
        in_reset = Signal(reset_less=True)
        m.d.sync += in_reset.eq(ResetSignal())
        m.d.comb += Assert(~(in_reset & out.valid), "m_axis: tvalid is low in reset")
        waited = Signal()
        m.d.sync += waited.eq(out.valid & ~out.ready)
        m.d.comb += Cover(waited & out.transfer & out.last, "a beat that ends a line has waited")
        return m


class ZeroStallProof(Elaboratable):
    """While m_axis_tready is high, s_axis_tready is never low where a beat of a right frame is offered.

    Pauses of the input are arbitrary: none, between beats, lines and frames. And right frames go in as they are.

    Parameters
    ----------
    parameters : RectifierParameters
    """

    def __init__(self, parameters, lemmas=True):
        self._parameters, self._lemmas = parameters, lemmas
        self._core = FreeCore(parameters)

    def elaborate(self, platform):
        m = Module()
        core, datapath, capture = self._core, self._parameters.datapath, self._core.parts["capture"]
        core.add_to(m)
        m.submodules.source = source = VideoFormat(core.s_axis, datapath.width, datapath.height, Assume)
        m.submodules.inner = inner = VideoFormat(core.inner, datapath.width, datapath.height)
        frames = Signal(2)
        m.d.sync += frames.eq(frames + (inner.end_of_frame & ~frames.all()))
        m.d.comb += [
            Assume(core.m_axis.ready, "m_axis_tready is high"),
            Assert(core.s_axis.ready | ~core.inner.valid, "s_axis_tready is high"),
            Assert(~core.inner.valid | core.inner.ready, "no beat waits"),
            Assert(~core.inner.valid | (capture.write & (capture.x == inner.x)), "every pixel is written"),
            Assert(capture.frame_written == inner.end_of_frame, "a frame is complete with its last beat"),
            Cover(frames == 3, "three frames came in"),
        ]
        if self._lemmas:
            control = Control(m, core)
            control.rows_agree()
            lemma, x_in, y_in = control.lemma, control.x_in, control.y_in
            lemma((x_in == inner.x) & (y_in == inner.y), "capture is in step with its beats")
            lemma((inner.x < datapath.width) & (inner.y < datapath.height), "its beats are a frame's")
            lemma(control.in_frame == ((inner.x != 0) | (inner.y != 0)), "capture is in a frame")
            if self._parameters.pipeline.ports:
                held = core.registers["input_register.held"]
                beat = core.registers["input_register.o_valid"]
                following = inner.following
                lemma(source.x == Mux(beat, following[0], inner.x), "the source is a beat ahead")
                lemma(source.y == Mux(beat, following[1], inner.y), "the source is a beat ahead in its rows")
                lemma(~beat | (held[-2:] == inner.marks), "the beat that is held is marked")
            else:
                lemma((source.x == inner.x) & (source.y == inner.y), "the source is in step")
            lemma(~control.stopped, "the pipeline moves")
            lemma((core.warming == 0) | ((y_in == 0) & (x_in + core.warming <= datapath.warm_up)), "it is warm in time")
            came, width = control.came * datapath.width + x_in, datapath.width
            late = control.permitted if self._parameters.pipeline.ahead else 0
            lemma(came <= (control.lead + 1) * width + control.x + late, "the output keeps up with the input")
        return m


class WaitsProof(Elaboratable):
    """Beats at s_axis wait for no more clocks than there is cause for, counted from reset; both streams are arbitrary.

    Cause is given, a clock each, by beats that wait at m_axis and by pixels that are missing from lines, and frames,
    that are too short, or by the tlast that is missing from a frame's last line. Right frames have none
    (`ZeroStallProof`). Of all that is left over never more than two lines'
    worth is counted: what was long ago makes no beat wait.

    Parameters
    ----------
    parameters : RectifierParameters
    """

    def __init__(self, parameters, lemmas=True):
        self._parameters, self._lemmas = parameters, lemmas
        self._core = FreeCore(parameters)

    @property
    def least(self):
        """Clocks of cause that there are when a beat waits."""
        return NEAR - 1 if self._parameters.pipeline.ahead else 1

    def elaborate(self, platform):
        m = Module()
        core, capture, ahead = self._core, self._core.parts["capture"], self._parameters.pipeline.ahead
        width = self._parameters.datapath.width
        core.add_to(m)
        paused, waits = core.m_axis.valid & ~core.m_axis.ready, core.s_axis.valid & ~core.s_axis.ready
        held = core.inner.valid & ~core.inner.ready
        missing, cause, left = Signal(range(width + 1)), Signal(range(3 * width + 2)), Signal(range(2 * width + 1))
        with m.If(capture.row_written):
            m.d.comb += missing.eq(Mux(held & (capture.x == width), 1, width - capture.x - capture.write))
        m.d.comb += [
            cause.eq(left + paused + missing),
            Assert(~waits | (cause >= Mux(capture.row_written, 1, self.least)), "no beat waits without a cause"),
            Cover((left == self.least) & waits & ~capture.row_written, "the last cause makes a beat wait"),
        ]
        m.d.sync += left.eq(Mux(cause > 2 * width, 2 * width, cause) - waits)
        if self._lemmas:
            control = Control(m, core)
            control.rows_agree()
            lemma, lead = control.lemma, control.lead
            came = Signal(range((lead + 5) * width))
            m.d.comb += came.eq(control.came * width + control.x_in)
            lemma(left <= 2 * width, "of what is left over two lines' worth is counted")
            lemma(
                (control.x == 0) | control.early | (control.ahead > lead) | control.complete,
                "a row that was begun is given out",
            )
            lemma(
                came + control.stopped <= (lead + 1) * width + control.x + left + (control.permitted if ahead else 0),
                "the output is behind by no more than it has cause",
            )
            lemma(
                (core.warming == 0) | ~(core.m_axis.valid | core.registers["valid"].any()),
                "nothing is given out before it is warm",
            )
            lemma(
                (core.warming == 0) | (left + control.warmed >= Mux(came > 2 * width, 2 * width, came)),
                "what comes before it is warm is missing from lines",
            )
        return m


class FramesProof(Elaboratable):
    """Frames come out whole, each one that went in, in bounded time; both streams are arbitrary, broken frames too.

    - at m_axis, tuser and tlast mark frames of the core's size;
    - a frame is out, and those before it, once m_axis_tready was high for as many clocks as the frame has pixels and
    the
      pipeline has stages (and the datapath steps to warm up), counted from the clock that completed it at the input,
      with or without further input;
    - no frame comes out that did not go in;
    - a beat at s_axis is taken after at most (height + 1) * (width + 1) clocks with m_axis_tready high.

    Parameters
    ----------
    parameters : RectifierParameters
    """

    def __init__(self, parameters, lemmas=True):
        self.parameters, self._with_lemmas = parameters, lemmas
        self.width, self.height = parameters.datapath.width, parameters.datapath.height
        self.core = FreeCore(parameters)
        self.capture = self.core.parts["capture"]
        self.out = VideoFormat(self.core.m_axis, self.width, self.height)
        # Frames that are complete at the input and not yet out.
        self.owed, self.in_pipeline = Signal(range(4)), Signal(range(4))
        # One frame, any one: how many frames must come out until it has, and for how many clocks it has been complete.
        self.chosen, self.left, self.clocks = Signal(), Signal(range(4)), Signal(range(self.drain_clocks + 1))
        self.waits_for_issue, self.waits_for_other = Signal(), Signal()
        # A beat at the input: for how many clocks it has waited, and the lines that were declared complete meanwhile.
        self.waited, self.declared = Signal(range(self.wait_clocks + 2)), Signal(range(self.height + 2))

    @property
    def drain_clocks(self):
        """Bound on the clocks from the completion of a frame at the input to its last beat, while m_axis_tready is
        high."""
        frame = self.width * self.height + self.parameters.datapath.warm_up
        return frame + self.parameters.pipeline_latency + self.late

    @property
    def late(self):
        """Clocks that a frame's positions may wait although it is complete: for the permission, which is a register;
        for the last `NEAR` positions of the frame before, which count as issued while a whole frame comes in if
        the next one's first row needs all rows but one."""
        needs_all = self.parameters.line_buffer.window.lead == self.height - 2
        return (1 + NEAR * needs_all) * self.parameters.pipeline.ahead

    @property
    def wait_clocks(self):
        """Bound on the clocks for which a beat at the input waits, while m_axis_tready is high."""
        lines = (self.height + 1) * self.line_clocks
        return lines + self.parameters.datapath.warm_up + self.parameters.pipeline.ports

    @property
    def line_clocks(self):
        """Of those, for each line."""
        return self.width + 1 + self.parameters.pipeline.ahead

    def elaborate(self, platform):
        m = Module()
        self.core.add_to(m)
        m.submodules.out = self.out
        s_axis, inner, ready = self.core.s_axis, self.core.inner, self.core.m_axis.ready
        frame_in, frame_out = self.capture.frame_written, self.out.end_of_frame

        m.d.sync += self.owed.eq(self.owed + frame_in - frame_out)
        m.d.comb += Assert(~frame_out | (self.owed != 0), "no frame comes out that did not go in")

        choose = Signal()
        m.d.comb += choose.eq(AnySeq(1) & frame_in & ~self.chosen)
        with m.If(choose):
            m.d.sync += [self.chosen.eq(1), self.left.eq(self.owed + 1 - frame_out)]
        with m.Elif(self.left != 0):
            m.d.sync += [self.left.eq(self.left - frame_out), self.clocks.eq(self.clocks + ready)]
        end = self.core.issue & self.core.parts["datapath"].end_of_frame
        # Frames whose last position was issued, and is not yet out.
        m.d.sync += self.in_pipeline.eq(self.in_pipeline + end - frame_out)
        with m.If(choose):
            m.d.sync += [
                self.waits_for_issue.eq(1),
                self.waits_for_other.eq((self.owed + 1 - frame_out > self.in_pipeline + 1) & ~end),
            ]
        with m.Elif(end):
            m.d.sync += [self.waits_for_issue.eq(self.waits_for_other), self.waits_for_other.eq(0)]
        m.d.comb += [
            Assert((self.left == 0) | (self.clocks < self.drain_clocks), "a frame drains in time"),
            Cover(
                self.chosen & (self.left == 0) & (self.clocks == self.drain_clocks), "a frame takes as long as it may"
            ),
        ]

        m.d.comb += Assert(
            ~s_axis.valid | s_axis.ready | (inner.valid & ~inner.ready), "no beat waits but for one at capture"
        )
        with m.If(~inner.valid | inner.ready):
            m.d.sync += [self.waited.eq(0), self.declared.eq(0)]
        with m.Else():
            m.d.sync += [
                self.waited.eq(self.waited + ready),
                self.declared.eq(self.declared + self.capture.row_written),
            ]
        m.d.comb += Assert(self.waited < self.wait_clocks, "a beat does not wait for ever")
        if self._with_lemmas:
            frames_lemmas(m, self)
        return m
