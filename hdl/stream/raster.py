"""Positions of the rectified frame in raster order."""

from amaranth import Module
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out
from amaranth.utils import ceil_log2

from hdl.errors import at_least


class Raster(wiring.Component):
    """Counts through a frame, row by row, and starts the next frame after the last position.

    Parameters
    ----------
    width, height : int
        Frame size, px.
    warm_up : int
        After reset, begin this many positions before the first one, with the last ones of a row; less than ``width``.

    Raises
    ------
    ValueError
        For values outside these ranges.

    Members
    -------
    step : In(1)
        Go to the next position after this clock.
    x, y : Out
        The position, px.
    start_of_frame, end_of_line, end_of_frame : Out(1)
        It is the frame's first one, its row's last one, the frame's last one.
    """

    def __init__(self, width, height, warm_up=0):
        at_least(1, width=width, height=height)
        at_least(0, warm_up=warm_up)
        if warm_up >= width:
            raise ValueError(f"warm_up = {warm_up}: less than the width, {width}, is needed")
        self._width = width
        self._height = height
        super().__init__(
            {
                "step": In(1),
                "x": Out(ceil_log2(width), init=-warm_up % width),
                "y": Out(ceil_log2(height), init=height - 1 if warm_up else 0),
                "start_of_frame": Out(1, init=not warm_up),
                "end_of_line": Out(1),
                "end_of_frame": Out(1),
            }
        )

    def elaborate(self, platform):
        m = Module()
        m.d.comb += [
            self.end_of_line.eq(self.x == self._width - 1),
            self.end_of_frame.eq(self.end_of_line & (self.y == self._height - 1)),
        ]
        with m.If(self.step):
            m.d.sync += [self.x.eq(self.x + 1), self.start_of_frame.eq(self.end_of_frame)]
            with m.If(self.end_of_line):
                m.d.sync += [self.x.eq(0), self.y.eq(self.y + 1)]
            with m.If(self.end_of_frame):
                m.d.sync += self.y.eq(0)
        return m
