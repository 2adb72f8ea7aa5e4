"""What the registers say of the rows that come in and go out: what all proofs of whole cores stand on."""

from amaranth import Mux, Signal
from amaranth.hdl import Assert

from hdl.stream.raster import NEAR


class Control:
    """Rows and positions by the design's registers, with the lemmas that these agree with each other.

    Parameters
    ----------
    m : Module
        Takes the lemmas.
    core : FreeCore

    Attributes
    ----------
    x_in, y_in, in_frame : Signal
        `Capture`'s.
    x, y : Signal
        The next position to be issued.
    early : Signal
        Its row counts as issued already.
    ahead : Signal
        Rows that came in beyond those that count as issued.
    came : Value
        Rows that came in beyond those that were issued.
    complete : Signal
        The frame of the row that is issued next, as it counts, came in whole.
    permitted : Value
        That row, as it counts, may be issued.
    stopped : Value
        The pipeline waits with a beat more than its last register holds.
    """

    def __init__(self, m, core):
        registers, datapath = core.registers, core.parameters.datapath
        self._width, self._height = datapath.width, datapath.height
        self.lead = core.parameters.line_buffer.window.lead
        self.x_in, self.y_in, self.in_frame, self.complete = (
            registers[name] for name in ("capture.x", "capture.y", "capture.in_frame", "flow.complete")
        )
        self.x, self.y = issued_position(m, core)
        margin = registers["flow.margin"]
        self.ahead, self.early, self.permitted, self.stopped = Signal.like(margin), Signal(), 1, 0
        m.d.comb += self.ahead.eq(margin + self.lead + 1)
        self.came = self.ahead + self.early
        self.warmed = Signal(range(datapath.warm_up + 1))
        m.d.comb += self.warmed.eq(datapath.warm_up - core.warming)

        self._m = m
        self.lemma((self.x_in <= self._width) & (self.y_in < self._height), "capture counts the rows")
        self.lemma(self.in_frame | ((self.y_in == 0) & (self.x_in == 0)), "capture waits for a frame's first beat")
        self.lemma(
            (self.ahead < self.lead + 2) | ((self.ahead == self.lead + 2) & (self.x_in == 0)),
            "a row waits until it may be written",
        )
        if core.parameters.pipeline.ahead:
            self._registered(core)
        if core.parameters.pipeline.ports:
            self.stopped = registers["skid.standing"]
            self.lemma(registers["skid.enable"] == ~self.stopped, "the pipeline moves unless a beat stands aside")
            self.lemma(~self.stopped | core.m_axis.valid, "a beat stands aside only behind another")

    def lemma(self, fact, name):
        self._m.d.comb += Assert(fact, f"lemma: {name}")

    @property
    def y_counted(self):
        """The row in progress, as it counts."""
        return Mux(self.early, Mux(self.y == self._height - 1, 0, self.y + 1), self.y)

    @property
    def early_frame(self):
        """The frame in progress counts as issued already."""
        return self.early & (self.y == self._height - 1)

    def rows_agree(self):
        """The lemma that `RowFlow` has the difference between the rows of input and output."""
        self.lemma(
            self.ahead == self.y_in - self.y_counted + Mux(self.complete, self._height, 0),
            "flow counts how far the input is ahead",
        )

    def _registered(self, core):
        """Of what is known a clock or more ahead."""
        registers, width, height = core.registers, self._width, self._height
        raster_x, raster_y = registers["raster.x"], registers["raster.y"]
        pulse, self.permitted = registers["issuing.row_issued"], registers["issuing.permitted"]
        is_warm = core.warming == 0
        self._m.d.comb += self.early.eq((self.x > width - 1 - NEAR) & ~pulse)
        self.lemma(registers["capture.line_is_full"] == (self.x_in == width), "a line's end is known a beat ahead")
        self.lemma(
            registers["capture.is_last_line"] == (self.y_in == height - 1), "the last line is known a line ahead"
        )
        self.lemma(registers["raster.end_of_line"] == (raster_x == width - 1), "a row's end is known ahead")
        self.lemma(registers["raster.near_end"] == (raster_x == width - 1 - NEAR), "a row's end is known to be near")
        self.lemma(registers["raster.last_row"] == (raster_y == height - 1), "the last row is known ahead")
        self.lemma(~pulse | ((self.x == width - NEAR) & is_warm), "a row counts as issued once, near its end")
        self.lemma(registers["issuing.frame_issued"] == (pulse & (self.y == height - 1)), "and so does a frame")
        self.lemma(self.permitted | (is_warm & (self.x == 0)), "a row that was begun is permitted")
        self.lemma(self.permitted | (self.ahead != self.lead + 2), "a row is permitted a clock after it may be issued")
        self.lemma(
            ~(self.permitted & is_warm) | self.early | (self.ahead > self.lead) | self.complete,
            "a row that is permitted has its source rows",
        )


def issued_position(m, core):
    """The next position to be issued, (x, y), with the lemmas that it is what the raster counts once it is warm."""
    width, height = core.parameters.datapath.width, core.parameters.datapath.height
    raster_x, raster_y = core.registers["raster.x"], core.registers["raster.y"]
    x, y, is_warm = Signal.like(raster_x), Signal.like(raster_y), core.warming == 0
    m.d.comb += [x.eq(Mux(is_warm, raster_x, 0)), y.eq(Mux(is_warm, raster_y, 0))]
    m.d.comb += [
        Assert((x < width) & (y < height), "lemma: raster counts positions"),
        Assert(core.warming <= core.parameters.datapath.warm_up, "lemma: warming up is counted down"),
        Assert(
            is_warm | ((raster_x == width - core.warming) & (raster_y == height - 1)),
            "lemma: raster begins before the frame, to warm up",
        ),
        Assert(
            ~is_warm | (core.registers["raster.start_of_frame"] == ((x == 0) & (y == 0))),
            "lemma: raster starts its frame",
        ),
    ]
    if core.parameters.datapath.warm_up:
        m.d.comb += Assert(core.registers["issuing.warm"] == is_warm, "lemma: it is warm after so many steps")
    return x, y
