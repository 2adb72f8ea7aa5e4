"""The conventional datapath: matrix product and two pipelined dividers (Eq. 3, Fig. 4a)."""

from dataclasses import dataclass, replace
from itertools import chain

from amaranth import Module, Signal
from amaranth.lib import wiring
from amaranth.utils import ceil_log2

from hdl.arithmetic.cost import Cost
from hdl.arithmetic.cuts import Stages
from hdl.arithmetic.fixedpoint import Q
from hdl.arithmetic.products import Products
from hdl.datapaths.conventional_lens import ConventionalLens
from hdl.datapaths.projective import Projective, connect_divider
from hdl.lens import polynomial


@dataclass(frozen=True)
class Conventional(Projective):
    """u = x/z and v = y/z with (x, y, z) = C * (xr, yr, 1) multiplied out for every pixel.

    The baseline that the paper compares with: six multipliers and two dividers, pipelined to 1 px/clock, each as narrow
    as the error allows. Latency: two clocks for the product, or more where it has registers within, then those
    of the division, `division_clocks`. With a lens it is `ConventionalLens` that `fit` returns.

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
        divider, forms = self.divider_cost, self.form_bits
        if self.dsp:
            # The blocks have registers for most of what is multiplied and added.
            return Cost(lut=divider.lut + forms, ff=divider.ff + forms * bool(self.pipeline.products), dsp=self.blocks)
        lut, ff = divider.lut + 4 * forms, divider.ff + 2 * forms
        for _, size, coefficient, start in chain(*self.terms.values()):
            if self.pipeline.products:
                clocks = self.term_clocks(size, coefficient, start)
                more = self.products.scaled_registers(ceil_log2(size), coefficient, clocks, sharing=len(self.forms))
                lut, ff = lut + more[0], ff + more[1]
        return Cost(lut, ff)

    @property
    def blocks(self):
        """DSP blocks of the matrix."""
        if not self.pipeline.products:
            return 6
        return sum(self.term_clocks(*term) - 1 for _, *term in chain(*self.terms.values()))

    @property
    def products(self):
        """`Products` of the matrix."""
        return Products(self.dsp, self.pipeline)

    @property
    def terms(self):
        """What each linear form is the sum of: a (position, frame size, coefficient, constant) along x and along y."""
        return {
            name: (("x", self.width, form.a, 0), ("y", self.height, form.b, form.c))
            for name, form in self.forms.items()
        }

    def term_clocks(self, size, coefficient, start):
        """Clocks from a position to one of `terms`."""
        return self.products.scaled_clocks(ceil_log2(size) + 1, coefficient, start)

    @property
    def form_clocks(self):
        """Clocks from a position to the terms of the linear forms, and to their sums."""
        terms = max(self.term_clocks(*term) for _, *term in chain(*self.terms.values()))
        return terms, terms + 1

    @property
    def latency(self):
        return self.form_clocks[1] + self.division_clocks

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
        at, _ = p.form_clocks
        waited, stages = {}, Stages(m, self.enable, ends=True)
        for name, terms in p.terms.items():
            made = []
            for axis, size, coefficient, start in terms:
                extremes = start, start + (size - 1) * coefficient
                shape = Q.covering(min(extremes), max(extremes), 0).shape
                clocks = at - p.term_clocks(size, coefficient, start)
                key = f"{axis}_{clocks}"
                if key not in waited:
                    waited[key] = stages.after(key, getattr(self, axis), clocks)
                place = m, self.enable, f"{name}_term_{len(made)}"
                made.append(p.products.scaled(*place, waited[key], coefficient, start, shape))
            value = Signal(p.forms[name].format.shape, name=name, reset_less=True)
            with m.If(self.enable):
                m.d.sync += value.eq(made[0] + made[1])
            values.append(value)
        connect_divider(m, self, p, *values)
        return m
