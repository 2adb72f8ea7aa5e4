"""What an AXI4-Stream of video promises: assumed of an input, asserted of an output."""

from dataclasses import dataclass

from amaranth import Cat, Module, Mux, Signal
from amaranth.hdl import Assert, Elaboratable, Value
from amaranth.utils import ceil_log2


@dataclass(frozen=True)
class Stream:
    """The signals of an AXI4-Stream of video."""

    name: str
    data: Value
    valid: Value
    ready: Value
    user: Value
    last: Value

    @classmethod
    def of(cls, component, name):
        """The port ``name`` of a component with the ports of an exported core."""
        return cls(
            name, *(getattr(component, f"{name}_t{part}") for part in ("data", "valid", "ready", "user", "last"))
        )

    @property
    def transfer(self):
        return self.valid & self.ready


class Stability(Elaboratable):
    """A beat that is offered stays as it is until it is taken, or until the reset.

    Parameters
    ----------
    stream : Stream
    check : Assert or Assume

    Source: AMBA AXI4-Stream, 2.2.1.
    """

    def __init__(self, stream, check=Assert):
        self._stream, self._check = stream, check

    def elaborate(self, platform):
        m = Module()
        s, check = self._stream, self._check
        waits = Signal()
        before = Signal(len(s.data) + 2)
        m.d.sync += [waits.eq(s.valid & ~s.ready), before.eq(Cat(s.data, s.user, s.last))]
        with m.If(waits):
            m.d.comb += [
                check(s.valid, f"{s.name}: tvalid stays until tready"),
                check(Cat(s.data, s.user, s.last) == before, f"{s.name}: tdata, tuser and tlast stay until tready"),
            ]
        return m


class VideoFormat(Elaboratable):
    """Frames of ``height`` lines of ``width`` beats, tuser on the first only, tlast on each line's last only.

    Nothing is said of the time between beats.

    Parameters
    ----------
    stream : Stream
    width, height : int
        px
    check : Assert or Assume

    Attributes
    ----------
    x, y : Signal
        Place of the beat that is offered or comes next.
    end_of_frame : Value
        The frame's last beat is taken in this clock.

    Source: AMD UG934.
    """

    def __init__(self, stream, width, height, check=Assert):
        self._stream, self._width, self._height, self._check = stream, width, height, check
        self.x = Signal(ceil_log2(width))
        self.y = Signal(ceil_log2(height))
        self.end_of_frame = stream.transfer & (self.x == width - 1) & (self.y == height - 1)

    @property
    def marks(self):
        """tuser and tlast of the beat at this place."""
        return Cat((self.x == 0) & (self.y == 0), self.x == self._width - 1)

    @property
    def following(self):
        """The place after this one, (x, y)."""
        last_column, last_row = self.x == self._width - 1, self.y == self._height - 1
        y = Mux(last_column, Mux(last_row, 0, self.y + 1), self.y)
        return Mux(last_column, 0, self.x + 1), y

    def elaborate(self, platform):
        m = Module()
        s, check = self._stream, self._check
        with m.If(s.valid):
            m.d.comb += [
                check(s.user == self.marks[0], f"{s.name}: tuser on a frame's first beat only"),
                check(s.last == self.marks[1], f"{s.name}: tlast on a line's last beat only"),
            ]
        with m.If(s.transfer):
            m.d.sync += [place.eq(value) for place, value in zip((self.x, self.y), self.following)]
        return m
