"""Accumulators in place of the matrix product, the division kept (Eq. 4)."""

from amaranth import Module
from amaranth.lib import wiring

from hdl.arithmetic.cost import Cost
from hdl.arithmetic.linear import Accumulator, connect_accumulator
from hdl.datapaths.projective import Projective, connect_divider


class Accumulate(Projective):
    """u = x/z and v = y/z with x, y and z accumulated over the raster.

    As exact as `conventional`, without its multipliers. Latency: that of the division, `division_clocks`; 1 px/clock.

    608 LUT and 740 FF (README, the ladder: coordinates of the embedded rig, 640x480, 0.05 px).

    Source: Hyun and Moon 2015, Eq. 4.
    """

    name = "accumulate"
    summary = "Eq. 4: three accumulators and two pipelined dividers"

    @property
    def cost(self):
        divider = self.divider_cost
        return Cost(lut=divider.lut + self.form_bits, ff=divider.ff + self.form_bits)

    @property
    def latency(self):
        return self.division_clocks

    def component(self):
        return DividedAccumulators(self)


class DividedAccumulators(wiring.Component):
    """Three `Accumulator` and a `Divider`. Members: `DatapathSignature`."""

    def __init__(self, parameters):
        self._parameters = parameters
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        values = []
        for name, form in self._parameters.forms.items():
            values.append(connect_accumulator(m, self, name, Accumulator(form)))
        connect_divider(m, self, self._parameters, *values)
        return m
