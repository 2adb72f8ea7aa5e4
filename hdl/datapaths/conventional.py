"""The conventional datapath: matrix product and two pipelined dividers (Eq. 3, Fig. 4a)."""

from dataclasses import dataclass, replace

from amaranth import Module, Signal
from amaranth.lib import wiring

from hdl.arithmetic.cost import Cost
from hdl.arithmetic.fixedpoint import Q
from hdl.arithmetic.pipeline import scaled
from hdl.datapaths.conventional_lens import ConventionalLens
from hdl.datapaths.projective import Projective, connect_divider
from hdl.lens import polynomial

PRODUCT_STAGES = 2


@dataclass(frozen=True)
class Conventional(Projective):
    """u = x/z and v = y/z with (x, y, z) = C * (xr, yr, 1) multiplied out for every pixel.

    The baseline that the paper compares with: six multipliers and two dividers, pipelined to 1 px/clock, each as narrow
    as the error allows. Latency: two clocks for the product, then the dividers' quotient bits. With a lens it is
    `ConventionalLens` that `fit` returns.

    776 LUT and 818 FF made of adders (README, the ladder: coordinates of the embedded rig, 640x480, 0.05 px).

    Parameters
    ----------
    dsp : bool
        Whether products are left to the synthesis tool, which has DSP blocks for them; else they are rows of adders.

    Source: Hyun and Moon 2015, Eq. 1 to 3.
    """

    name = "conventional"
    summary = "Eq. 3: matrix product and pipelined dividers; multipliers for the lens"
    supports_lens = True

    dsp: bool = True

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None):
        if view.lens and (view.camera.D.any() or view.camera.model not in polynomial.NAMES):
            return ConventionalLens.fit(view, fraction_bits, max_error, pinhole=cls)
        return super().fit(view, fraction_bits, max_error)

    def with_dsp(self, dsp):
        return replace(self, dsp=dsp)

    @property
    def cost(self):
        divider = self.divider_cost
        if self.dsp:
            # The blocks have registers for most of what is multiplied and added.
            return Cost(lut=divider.lut + self.form_bits, ff=divider.ff, dsp=6)
        return Cost(lut=divider.lut + 4 * self.form_bits, ff=divider.ff + 2 * self.form_bits)

    @property
    def latency(self):
        return PRODUCT_STAGES + self.quotient_bits

    def component(self):
        return DividedProducts(self)


class DividedProducts(wiring.Component):
    """Products, sums and a `Divider`. Members: `DatapathSignature`."""

    def __init__(self, parameters):
        self._parameters = parameters
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        values = []
        p = self._parameters
        for name, form in p.forms.items():
            terms = []
            for position, size, coefficient, start in (
                (self.x, p.width, form.a, 0),
                (self.y, p.height, form.b, form.c),
            ):
                extremes = start, start + (size - 1) * coefficient
                term = Signal(
                    Q.covering(min(extremes), max(extremes), 0).shape, name=f"{name}_term_{len(terms)}", reset_less=True
                )
                exact = scaled(m, term.name, position, coefficient, start, p.dsp)
                with m.If(self.enable):
                    m.d.sync += term.eq(exact)
                terms.append(term)
            value = Signal(form.format.shape, name=name, reset_less=True)
            with m.If(self.enable):
                m.d.sync += value.eq(terms[0] + terms[1])
            values.append(value)
        connect_divider(m, self, p, *values)
        return m
