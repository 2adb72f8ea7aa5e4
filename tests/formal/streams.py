"""What the core promises at its streams: beats that stay, frames that are whole, input that never waits, frames
that drain."""

from amaranth import Cat, Module, Mux, ResetSignal, Signal
from amaranth.asserts import AnySeq
from amaranth.hdl import Assert, Assume, Cover, Elaboratable

from .axi import Stability, VideoFormat
from .core import FreeCore
from .lemmas import frames_lemmas, issued_position


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
        lead = self._parameters.line_buffer.window.lead
        core.add_to(m)
        m.submodules.source = source = VideoFormat(core.s_axis, datapath.width, datapath.height, Assume)
        frames = Signal(2)
        m.d.sync += frames.eq(frames + (source.end_of_frame & ~frames.all()))
        m.d.comb += [
            Assume(core.m_axis.ready, "m_axis_tready is high"),
            Assert(~core.s_axis.valid | core.s_axis.ready, "s_axis_tready is high"),
            Assert(~core.s_axis.transfer | (capture.write & (capture.x == source.x)), "every pixel is written"),
            Assert(capture.frame_written == source.end_of_frame, "a frame is complete with its last beat"),
            Cover(frames == 3, "three frames came in"),
        ]
        if self._lemmas:
            registers = core.registers
            ahead, x_in, y_in = (registers[name] for name in ("flow.ahead", "capture.x", "capture.y"))
            x_out, y_out = issued_position(m, core)
            complete = registers["flow.complete"]
            m.d.comb += [
                Assert(fact, f"lemma: {name}")
                for fact, name in (
                    (Cat(x_in == source.x, y_in == source.y).all(), "capture is in step with the source"),
                    (Cat(source.x < datapath.width, source.y < datapath.height).all(), "the source counts its frame"),
                    (registers["capture.in_frame"] == ((source.x != 0) | (source.y != 0)), "capture is in a frame"),
                    (ahead == y_in - y_out + Mux(complete, datapath.height, 0), "ahead is the difference of the rows"),
                    (
                        (core.warming == 0) | ((y_in == 0) & (x_in + core.warming <= datapath.warm_up)),
                        "it is warm in time",
                    ),
                    ((ahead <= lead) | ((ahead == lead + 1) & (x_in <= x_out)), "the output keeps up with the input"),
                )
            ]
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

    def elaborate(self, platform):
        m = Module()
        core, capture = self._core, self._core.parts["capture"]
        width, height = self._parameters.datapath.width, self._parameters.datapath.height
        core.add_to(m)
        paused, waits = core.m_axis.valid & ~core.m_axis.ready, core.s_axis.valid & ~core.s_axis.ready
        missing, cause, left = Signal(range(width + 1)), Signal(range(3 * width + 2)), Signal(range(2 * width + 1))
        with m.If(capture.row_written):
            m.d.comb += missing.eq(Mux(waits & (capture.x == width), 1, width - capture.x - capture.write))
        m.d.comb += [
            cause.eq(left + paused + missing),
            Assert(~waits | (cause != 0), "no beat waits without a cause"),
            Cover((left == 1) & waits & ~capture.row_written, "the last cause makes a beat wait"),
        ]
        m.d.sync += left.eq(Mux(cause > 2 * width, 2 * width, cause) - waits)
        if self._lemmas:
            registers, lead = core.registers, self._parameters.line_buffer.window.lead
            ahead, x_in, y_in = (registers[name] for name in ("flow.ahead", "capture.x", "capture.y"))
            in_frame, complete = registers["capture.in_frame"], registers["flow.complete"]
            x_out, y_out = issued_position(m, core)
            came, warmed = ahead * width + x_in, self._parameters.datapath.warm_up - core.warming
            m.d.comb += [
                Assert(fact, f"lemma: {name}")
                for fact, name in (
                    ((x_in <= width) & (y_in < height), "capture counts its frame"),
                    (left <= 2 * width, "of what is left over two lines' worth is counted"),
                    (in_frame | ((y_in == 0) & (x_in == 0)), "capture waits for a frame's first beat"),
                    (ahead == y_in - y_out + Mux(complete, height, 0), "ahead is the difference of the rows"),
                    ((ahead < lead + 2) | ((ahead == lead + 2) & (x_in == 0)), "a row waits until it may be written"),
                    ((x_out == 0) | (ahead > lead) | complete, "a row that was begun is given out"),
                    (came <= (lead + 1) * width + x_out + left, "the output is behind by no more than it has cause"),
                    ((core.warming == 0) | (registers["valid"] == 0), "nothing is given out before it is warm"),
                    (
                        (core.warming == 0) | (left + warmed >= Mux(came > 2 * width, 2 * width, came)),
                        "what comes before it is warm is missing from lines",
                    ),
                )
            ]
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
        self.owed = Signal(range(4))
        # One frame, any one: how many frames must come out until it has, and for how many clocks it has been complete.
        self.chosen, self.left, self.clocks = Signal(), Signal(range(4)), Signal(range(self.drain_clocks + 1))
        self.waits_for_issue = Signal()
        # A beat at the input: for how many clocks it has waited, and the lines that were declared complete meanwhile.
        self.waited, self.declared = Signal(range(self.wait_clocks + 2)), Signal(range(self.height + 2))

    @property
    def drain_clocks(self):
        """Bound on the clocks from the completion of a frame at the input to its last beat, while m_axis_tready is
        high."""
        return self.width * self.height + self.parameters.pipeline_latency + self.parameters.datapath.warm_up

    @property
    def wait_clocks(self):
        """Bound on the clocks for which a beat at the input waits, while m_axis_tready is high."""
        return (self.height + 1) * (self.width + 1) + self.parameters.datapath.warm_up

    def elaborate(self, platform):
        m = Module()
        self.core.add_to(m)
        m.submodules.out = self.out
        s_axis, ready = self.core.s_axis, self.core.m_axis.ready
        frame_in, frame_out = self.capture.frame_written, self.out.end_of_frame

        m.d.sync += self.owed.eq(self.owed + frame_in - frame_out)
        m.d.comb += Assert(~frame_out | (self.owed != 0), "no frame comes out that did not go in")

        choose = Signal()
        m.d.comb += choose.eq(AnySeq(1) & frame_in & ~self.chosen)
        with m.If(choose):
            m.d.sync += [self.chosen.eq(1), self.left.eq(self.owed + 1 - frame_out)]
        with m.Elif(self.left != 0):
            m.d.sync += [self.left.eq(self.left - frame_out), self.clocks.eq(self.clocks + ready)]
        datapath = self.core.parts["datapath"]
        with m.If(choose):
            m.d.sync += self.waits_for_issue.eq(1)
        with m.Elif(self.core.issue & datapath.end_of_frame):
            m.d.sync += self.waits_for_issue.eq(0)
        m.d.comb += [
            Assert((self.left == 0) | (self.clocks < self.drain_clocks), "a frame drains in time"),
            Cover(
                self.chosen & (self.left == 0) & (self.clocks == self.drain_clocks), "a frame takes as long as it may"
            ),
        ]

        with m.If(~s_axis.valid | s_axis.ready):
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
