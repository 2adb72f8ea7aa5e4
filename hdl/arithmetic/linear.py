"""Linear forms of the raster position, a*x + b*y + c: the rows of Eq. 3, quantised, and their accumulation (Eq. 4)."""

from dataclasses import dataclass

import numpy as np
from amaranth import Module, Mux, ResetInserter
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from hdl.arithmetic.fixedpoint import Q


@dataclass(frozen=True)
class LinearForm:
    """a*x + b*y + c with integer coefficients in units of 2**-fraction_bits.

    Parameters
    ----------
    a, b, c : int
        Increment per column, increment per row, value at (0, 0).
    fraction_bits : int
    width, height : int
        Frame size in px: the domain is 0 <= x < width, 0 <= y < height.
    """

    a: int
    b: int
    c: int
    fraction_bits: int
    width: int
    height: int

    @classmethod
    def quantise(cls, coefficients, fraction_bits, width, height, half=0.0):
        """The closest form with this many fraction bits.

        The start value absorbs the mean of what rounding ``a`` and ``b`` costs over the frame, so the error
        x*e11 + y*e12 + e13 (DESIGN section 4) is centred, and ``half`` (in the form's own unit) on top: half an output
        unit turns the truncation that follows into rounding half up, at no cost.
        """
        scale = 2.0**fraction_bits
        a, b = (round(float(value) * scale) for value in coefficients[:2])
        drift = (coefficients[0] - a / scale) * (width - 1) / 2 + (coefficients[1] - b / scale) * (height - 1) / 2
        return cls(a, b, round(float(coefficients[2] + drift + half) * scale), fraction_bits, width, height)

    def values(self, x, y):
        """The values at the positions (x, y), int64, broadcast; closed form, no accumulation."""
        return np.int64(self.a) * x + (np.int64(self.b) * y + self.c)

    @property
    def format(self):
        """The narrowest format for every value in the frame; a linear form has its extremes in the corners."""
        corners = [self.a * x + self.b * y + self.c for x in (0, self.width - 1) for y in (0, self.height - 1)]
        return Q.covering(min(corners), max(corners), self.fraction_bits)


def connect_accumulator(m, datapath, name, accumulator):
    """The value of a coordinate's ``accumulator`` inside ``datapath``, whose raster position it follows."""
    m.submodules[f"{name}_accumulator"] = accumulator
    for port in ("step", "x", "y", "end_of_line", "end_of_frame"):
        if port in accumulator.signature.members:
            m.d.comb += getattr(accumulator, port).eq(getattr(datapath, port))
    return accumulator.value


class Accumulator(wiring.Component):
    """The value of a `LinearForm` at the raster position, by one addition a pixel (Eq. 4).

    Each frame starts from the same state and the row increment is derived from the quantised coefficients, so errors
    grow neither with the row nor with the number of frames.

    Latency: none; ``value`` belongs to the position that is stepped over in the same clock. Throughput: 1 px/clock.

    Parameters
    ----------
    form : LinearForm

    Members
    -------
    step : In(1)
        Go to the next raster position after this clock.
    end_of_line, end_of_frame : In(1)
        The position is its row's, its frame's, last one.
    value : Out(form.format.shape)
    """

    def __init__(self, form):
        self.form = form
        super().__init__(
            {
                "step": In(1),
                "end_of_line": In(1),
                "end_of_frame": In(1),
                "value": Out(form.format.shape, init=form.c),
            }
        )

    def elaborate(self, platform):
        m = Module()
        form = self.form
        row_increment = form.b - (form.width - 1) * form.a
        # Of a difference the register itself feeds the carry chain, and each bit takes one look-up table.
        with m.If(self.step):
            m.d.sync += self.value.eq(self.value - Mux(self.end_of_line, -row_increment, -form.a))
        # Unlike a condition on the assignment, a reset costs nothing a bit.
        return ResetInserter(self.step & self.end_of_frame)(m)
