"""The paper's datapath: two accumulators, z taken as 1 (Eq. 6, Fig. 4b)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from amaranth import Module
from amaranth.lib import wiring

from hdl.arithmetic.bands import spread
from hdl.arithmetic.cost import Cost
from hdl.arithmetic.linear import Accumulator, LinearForm, connect_accumulator
from hdl.datapaths.base import ARITHMETIC_ERROR, Datapath, default_budget
from hdl.geometry.coordinates import Coordinates

MOST_FRACTION_BITS = 48


@dataclass(frozen=True)
class Proposed(Datapath):
    """u = c11*x + c12*y + c13 and v = c21*x + c22*y + c23, accumulated.

    Two adders and two registers make both coordinates; latency 0, 1 px/clock. How far off the missing division by z is
    depends on the rig alone: 2.9 px on the embedded one.

    45 LUT and 55 FF (README, the ladder: coordinates of the embedded rig, 640x480).

    Parameters
    ----------
    u_form, v_form : LinearForm
        Rows 1 and 2 of C (Eq. 2), in px.

    Source: Hyun and Moon 2015, Eq. 6.
    """

    name = "proposed"
    summary = "the paper's Eq. 6: two accumulators, z taken as 1"
    has_default_budget = False

    u_form: LinearForm
    v_form: LinearForm

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        u_form, v_form = (_narrowest(row, view.width, view.height, fraction_bits) for row in view.homography[:2])
        return cls(view.width, view.height, fraction_bits, u_form, v_form)

    @cached_property
    def coordinates(self):
        x, y = np.arange(self.width), np.arange(self.height)[:, None]

        def used(form):
            return lambda rows: form.values(x, y[rows]) >> (form.fraction_bits - self.fraction_bits)

        return Coordinates.banded(self.shape, self.fraction_bits, used(self.u_form), used(self.v_form))

    @property
    def formats(self):
        return {"u": self.u_form.format, "v": self.v_form.format}

    @property
    def latency(self):
        return 0

    @property
    def cost(self):
        bits = sum(q.width for q in self.formats.values())
        return Cost(lut=round(0.82 * bits), ff=bits)

    def component(self):
        return AccumulatedCoordinates(self, Accumulator)


def _narrowest(row, width, height, fraction_bits):
    """The form with the fewest fraction bits that is within `default_budget` of ``row`` everywhere, once rounded."""
    x, y = np.arange(width), np.arange(height)[:, None]
    half = 2.0 ** -(fraction_bits + 1)

    def exact(x, y):
        return row[0] * x + row[1] * y + row[2]

    for bits in range(fraction_bits, MOST_FRACTION_BITS):
        form = LinearForm.quantise(row, bits, width, height, half=half)
        # Before rounding the error is largest in a corner, which rejects hopeless formats without the whole frame.
        unrounded = form.values(x[[0, -1]], y[[0, -1]]) * 2.0**-bits - half
        if np.abs(unrounded - exact(x[[0, -1]], y[[0, -1]])).max() > 2 * ARITHMETIC_ERROR:
            continue

        def error(rows, form=form):
            rounded = (form.values(x, y[rows]) >> (form.fraction_bits - fraction_bits)) * 2.0**-fraction_bits
            return np.abs(rounded - exact(x, y[rows])).max()

        if all(error(rows) <= default_budget(fraction_bits) for rows in spread((height, width))):
            return form
    raise AssertionError(f"no accumulator of up to {MOST_FRACTION_BITS} fraction bits follows {row}")


class AccumulatedCoordinates(wiring.Component):
    """Both coordinates straight from an accumulator each; the rounding half is in the start values.

    Latency 0, 1 px/clock. Members: `DatapathSignature`.

    Parameters
    ----------
    parameters : Datapath
        With ``u_form`` and ``v_form``.
    accumulator : class
        The `wiring.Component` that accumulates such a form.
    """

    def __init__(self, parameters, accumulator):
        self._parameters = parameters
        self._accumulator = accumulator
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        p = self._parameters
        for name, form, out in (("u", p.u_form, self.u), ("v", p.v_form, self.v)):
            value = connect_accumulator(m, self, name, self._accumulator(form))
            m.d.comb += out.eq(value >> (form.fraction_bits - p.fraction_bits))
        return m
