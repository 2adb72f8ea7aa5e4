"""Positions of the rectified frame in raster order."""

from amaranth import Module
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2

from hdl.errors import at_least

# How many positions before its row's last one a position is near the end.
NEAR = 3


class Raster(wiring.Component):
    """Counts through a frame, row by row, and starts the next frame after the last position.

    Parameters
    ----------
    width, height : int
        Frame size, px.
    warm_up : int
        After reset, begin this many positions before the first one, with the last ones of a row; less than ``width``.
    ahead : bool
        What is said of the position is looked at a position ahead, and registered.

    Raises
    ------
    ValueError
        For values outside these ranges, and with ``ahead`` for a width of `NEAR` or less.

    Members
    -------
    step : In(1)
        Go to the next position after this clock.
    x, y : Out
        The position, px.
    start_of_frame, end_of_line, last_row : Out(1)
        It is the frame's first one, its row's last one, in the frame's last row.
    near_end : Out(1)
        It is the one `NEAR` positions before its row's last one.
    """

    def __init__(self, width, height, warm_up=0, ahead=False):
        at_least(NEAR + 1 if ahead else 1, width=width)
        at_least(1, height=height)
        at_least(0, warm_up=warm_up)
        if warm_up >= width:
            raise ValueError(f"warm_up = {warm_up}: less than the width, {width}, is needed")
        self._width = width
        self._height = height
        self._ahead = ahead
        x, y = -warm_up % width, height - 1 if warm_up else 0
        super().__init__(
            {
                "step": In(1),
                "x": Out(ceil_log2(width), init=x),
                "y": Out(ceil_log2(height), init=y),
                "start_of_frame": Out(1, init=not warm_up),
                "end_of_line": Out(1, init=ahead and x == width - 1),
                "last_row": Out(1, init=ahead and y == height - 1),
                "near_end": Out(1, init=ahead and x == width - 1 - NEAR),
            }
        )

    def elaborate(self, platform):
        m = Module()
        flags = (self.end_of_line, self._width - 1), (self.near_end, self._width - 1 - NEAR)
        with m.If(self.step):
            m.d.sync += [self.x.eq(self.x + 1), self.start_of_frame.eq(self.end_of_line & self.last_row)]
            with m.If(self.end_of_line):
                m.d.sync += [self.x.eq(0), self.y.eq(self.y + 1)]
                with m.If(self.last_row):
                    m.d.sync += self.y.eq(0)
        if self._ahead:
            with m.If(self.step):
                m.d.sync += [flag.eq(self.x == (place - 1) % self._width) for flag, place in flags]
                with m.If(self.end_of_line):
                    m.d.sync += self.last_row.eq(self.y == (self._height - 2) % self._height)
        else:
            m.d.comb += [flag.eq(self.x == place) for flag, place in flags if place >= 0]
            m.d.comb += self.last_row.eq(self.y == self._height - 1)
        return m
