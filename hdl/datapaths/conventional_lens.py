"""The conventional datapath with the lens: multiplications and divisions all the way to the distorted pixel."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from amaranth import Module
from amaranth.lib import wiring

from hdl.arithmetic.bands import bands
from hdl.arithmetic.cost import Cost
from hdl.arithmetic.fixedpoint import Q
from hdl.arithmetic.pipeline import Pipeline
from hdl.arithmetic.products import Products
from hdl.arithmetic.steps import Quotient, delays, evaluate, step_cost, waits
from hdl.datapaths.base import Datapath
from hdl.datapaths.conventional_lens_check import ideal
from hdl.datapaths.conventional_lens_fit import LensFit
from hdl.datapaths.projective import Projective
from hdl.geometry.coordinates import Coordinates


@dataclass(frozen=True)
class ConventionalLens(Datapath):
    """The ideal pinhole's pixel as `conventional` has it, then the lens by multiplications; 1 px/clock.

    (X, Y) = (fx*x/z, fy*y/z) is the ideal pixel relative to the principal point, and r2 = X^2 + (fx/fy)^2 Y^2. OpenCV's
    radial and tangential terms, put so that few products have two variable factors and none of the tangential ones:

        u = cx + X + s*X + (p2/fx)*r2          s = r2*(k1' + r2*(k2' + r2*k3')) + 2*(p2/fx)*X + 2*(p1/fy)*Y
        v = cy + Y + s*Y + (p1*fy/fx^2)*r2     with ki' = ki/fx^(2i)

    With k4 to k6 the radial part of s is a quotient of polynomials in r2: a third division. With a skew the pinhole
    has its share of Y in X, which is taken off for s. What has a coefficient of zero, or one that rounds to it, is left
    out.

    Each value has its own word length, chosen for adders: no one of them can lose a bit without the integer model being
    off by more than the budget at a pixel whose source is inside the image. Where the source is outside the error may
    be larger, but no value overflows: formats cover the whole frame.

    Latency: the pinhole's, and the clocks of the steps on the longest way from there: one for each, or more where
    products have registers within.

    1602 LUT and 1099 FF made of adders (README, the ladder: coordinates of the embedded rig, 640x480, 0.05 px).

    Parameters
    ----------
    pinhole : Projective
        The datapath for X and Y, to more fraction bits; it has ``dsp`` too.
    steps : tuple
        Of `hdl.arithmetic.steps`, from ``x`` and ``y`` to ``u`` and ``v``.
    dsp : bool
        Whether products are left to the synthesis tool, which has DSP blocks for them; else they are rows of adders.

    Source: Hyun and Moon 2015, Eq. 1 to 3; OpenCV, calib3d, "Detailed Description", for the lens.
    """

    name = "conventional"
    summary = "Eq. 3 and the lens: multipliers and pipelined dividers"
    supports_lens = True

    pinhole: Projective
    steps: tuple
    dsp: bool = True

    @classmethod
    def fit(cls, view, fraction_bits, max_error=None, *, pinhole):
        """See `Datapath.fit`. ``pinhole``: the `Projective` class for X and Y.

        Raises InputError for lenses other than radial-tangential and rational ones, too.
        """
        found = LensFit(pinhole, view, fraction_bits, max_error).best()
        return cls(view.width, view.height, fraction_bits, *found)

    def with_dsp(self, dsp):
        return replace(self, dsp=dsp)

    @cached_property
    def _frame(self):
        """`Coordinates` of the frame, and the `Q` of each value, which holds it in the whole frame."""
        u, v = (np.empty((self.height, self.width), np.int32) for _ in range(2))
        spans = {}
        x, y = np.arange(self.width), np.arange(self.height)[:, None]
        for rows in bands(self.shape):
            values = evaluate(self.steps, ideal(self.pinhole, x, y[rows]))
            for name, (stored, bits) in values.items():
                low, high, _ = spans.get(name, (0, 0, bits))
                spans[name] = min(low, int(stored.min())), max(high, int(stored.max())), bits
            u[rows], v[rows] = values["u"][0], values["v"][0]
        return Coordinates(u, v, self.fraction_bits), {name: Q.covering(*span) for name, span in spans.items()}

    @property
    def coordinates(self):
        return self._frame[0]

    @property
    def formats(self):
        return {**{f"pinhole {name}": q for name, q in self.pinhole.formats.items()}, **self._frame[1]}

    @property
    def latency(self):
        return max(self._delays["u"], self._delays["v"])

    @property
    def _operands(self):
        """(bits with a sign, fraction bits) of each value, as `Products` takes them."""
        operands = {name: (q.width + (not q.is_signed), q.fraction_bits) for name, q in self._frame[1].items()}
        # A divider's output has all bits of the quotient.
        quotients = (step for step in self.steps if isinstance(step, Quotient))
        return operands | {step.name: (step.quotient_bits, step.bits) for step in quotients}

    @property
    def _delays(self):
        operands = self._operands

        def clocks(step):
            return self.products.step_clocks(step, [operands[name] for name in step.operands])

        return delays(self.steps, dict.fromkeys("xy", self.hardware_pinhole.latency), clocks)

    @property
    def cost(self):
        widths = {name: q.width for name, q in self._frame[1].items()}
        pinhole = self.hardware_pinhole.cost
        if self.pipeline.products:
            operands = self._operands
            added = [
                self.products.step_cost(step, [operands[name] for name in step.operands], widths[step.name])
                for step in self.steps
            ]
        else:
            added = [step_cost(step, widths, self.dsp) for step in self.steps]
        for name, clocks in waits(self.steps, self._delays):
            added.append((*self.products.waiting_cost(widths[name], clocks), 0))
        lut, ff, dsp = (sum(column) for column in zip(*added))
        return Cost(lut=pinhole.lut + lut, ff=pinhole.ff + ff, dsp=pinhole.dsp + dsp)

    @property
    def hardware_pinhole(self):
        """``pinhole`` with its products made likewise."""
        return self.pinhole.with_dsp(self.dsp).with_pipeline(self.pipeline)

    @property
    def products(self):
        """`Products` of the lens."""
        return Products(self.dsp, self.pipeline)

    def component(self):
        return LensProducts(self)


class LensProducts(wiring.Component):
    """The pinhole, and a `Pipeline` from there. Members: `DatapathSignature`."""

    def __init__(self, parameters):
        self._parameters = parameters
        super().__init__(parameters.signature)

    def elaborate(self, platform):
        m = Module()
        p = self._parameters
        m.submodules.pinhole = pinhole = p.hardware_pinhole.component()
        m.d.comb += [pinhole.enable.eq(self.enable), pinhole.x.eq(self.x), pinhole.y.eq(self.y)]
        pipeline = Pipeline(m, self.enable, p.formats, p.products)
        for name, value, q in zip("xy", (pinhole.u, pinhole.v), p.pinhole.coordinate_formats):
            pipeline.give(name, value, q.fraction_bits, p.hardware_pinhole.latency)
        for step in p.steps:
            pipeline.add(step)
        m.d.comb += [self.u.eq(pipeline.value("u", p.latency)), self.v.eq(pipeline.value("v", p.latency))]
        return m
