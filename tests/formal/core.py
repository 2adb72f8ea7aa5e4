"""The core around a datapath that may give any coordinates its window allows, with free inputs on all sides."""

from dataclasses import dataclass
from types import SimpleNamespace

from amaranth import ClockSignal, Module, ResetSignal, Signal, Value
from amaranth.asserts import AnySeq
from amaranth.hdl import Assume
from amaranth.lib import wiring

from hdl.arithmetic.cuts import COMPACT
from hdl.datapaths.base import Datapath
from hdl.geometry.coordinates import Border, Window
from hdl.stream.rectifier import Rectifier, RectifierParameters

from .axi import Stream, VideoFormat
from .opened import Opened


@dataclass(frozen=True)
class AnyDatapath(Datapath):
    """Not fitted to any map: the coordinates are free in every clock, and `coordinates` knows of them only the bounds.

    Parameters
    ----------
    window : Window
    clocks : int
        Its latency.
    reach : int
        How many pixels beyond the source, on each side, the coordinates go at most.
    warm_up : int
        Its `warm_up`.
    """

    name = "any"

    window: Window
    clocks: int
    reach: int
    warm_up: int = 0

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        raise NotImplementedError

    @property
    def coordinates(self):
        def span(size):
            return -self.reach << self.fraction_bits, (size - 1 + self.reach) << self.fraction_bits

        return SimpleNamespace(
            u_range=span(self.width), v_range=span(self.height), window=lambda border, source: self.window
        )

    @property
    def formats(self):
        return {}

    @property
    def cost(self):
        raise NotImplementedError

    @property
    def latency(self):
        return self.clocks

    def component(self):
        return FreeCoordinates(self)


class FreeCoordinates(wiring.Component):
    """Members: `DatapathSignature`, ``u`` and ``v`` free within their ranges."""

    def __init__(self, parameters):
        self._parameters = parameters
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        coordinates = self._parameters.coordinates
        for out, (low, high) in ((self.u, coordinates.u_range), (self.v, coordinates.v_range)):
            m.d.comb += [
                out.eq(AnySeq(out.shape())),
                Assume((out >= low) & (out <= high), "coordinates are within their range"),
            ]
        return m


class FreeCore:
    """A `Rectifier` whose every input is free; proofs add what they assume.

    Parameters
    ----------
    parameters : RectifierParameters

    Attributes
    ----------
    s_axis, m_axis : Stream
    inner : Stream
        At `Capture`: s_axis, or what is in the register behind it.
    parts, registers
        As in `Opened`.
    warming : Signal
        Steps to come until the datapath is warm: those are no positions.
    issue : Signal
        A position goes into the datapath.
    """

    def __init__(self, parameters):
        self.parameters = parameters
        self.component = Rectifier(parameters)
        self._opened = Opened(self.component)
        self.parts, self.registers = self._opened.parts, self._opened.registers
        self.warming, self.issue = (
            Signal(range(parameters.datapath.warm_up + 1), init=parameters.datapath.warm_up),
            Signal(),
        )
        self.s_axis, self.m_axis = (Stream.of(self.component, name) for name in ("s_axis", "m_axis"))
        capture = self.parts["capture"]
        self.inner = Stream("capture", Value.cast(0), capture.valid, capture.ready, capture.sof, capture.eol)

    def bank(self, row, column):
        """The memories that hold the line buffer's bank of this parity of slots and columns.

        A list, for memories on top of each other, of lists, the lowest bits first.
        """
        layout = self.parameters.line_buffer.bank
        name = f"line_buffer.{bank_name(row, column)}"
        return [
            [
                self.parts["_".join([name] + [str(index)] * (layout.stack > 1) + [str(low)] * (len(layout.slices) > 1))]
                for low, _ in layout.slices
            ]
            for index in range(layout.stack)
        ]

    def add_to(self, m):
        """Make it the submodule ``core`` of ``m``."""
        m.submodules.core = self._opened
        m.d.comb += [
            self.component.aclk.eq(ClockSignal()),
            self.component.aresetn.eq(~ResetSignal()),
            self.s_axis.data.eq(AnySeq(self.s_axis.data.shape())),
            *(signal.eq(AnySeq(1)) for signal in (self.s_axis.valid, self.s_axis.user, self.s_axis.last)),
            self.m_axis.ready.eq(AnySeq(1)),
        ]
        is_warm, step = self.warming == 0, self.parts["datapath"].step
        m.d.comb += self.issue.eq(step & is_warm)
        with m.If(step & ~is_warm):
            m.d.sync += self.warming.eq(self.warming - 1)

    def add_steady_streams_to(self, m):
        """Assume whole frames without a pause, an output that is always ready, and no reset."""
        datapath = self.parameters.datapath
        m.submodules.source = VideoFormat(self.s_axis, datapath.width, datapath.height, Assume)
        m.d.comb += Assume(self.s_axis.valid & self.m_axis.ready & ~ResetSignal(), "nothing pauses")


def bank_name(row, column):
    """Of the line buffer's bank of this parity of slots and columns."""
    return f"bank_{('even', 'odd')[row]}_row_{('even', 'odd')[column]}_column"


def any_core(
    width, height, d_lo, d_hi, *, latency=0, warm_up=0, reach=2, border=Border(), tag_bits=8, pipeline=COMPACT
):
    """The `RectifierParameters` of a core around `AnyDatapath`, pixels of at least ``tag_bits``."""
    pixel = next(pixel for pixel in ((8, 1), (10, 1), (12, 1), (16, 1), (8, 3)) if pixel[0] * pixel[1] >= tag_bits)
    datapath = AnyDatapath(width, height, 3, Window(d_lo, d_hi), latency, reach, warm_up, pipeline=pipeline)
    return RectifierParameters(datapath, *pixel, border)
