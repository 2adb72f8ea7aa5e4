"""The conventional datapath: matrix product and two pipelined dividers (Eq. 3, Fig. 4a)."""

from amaranth import Const, Module, Signal, signed
from amaranth.lib import wiring

from hdl.cost import Cost
from hdl.datapaths.projective import Projective, connect_divider

PRODUCT_STAGES = 2


class Conventional(Projective):
    """u = x/z and v = y/z with (x, y, z) = C * (xr, yr, 1) multiplied out for every pixel.

    The baseline that the paper compares with: six multipliers and two dividers, pipelined to 1 px/clock, each as narrow
    as the error allows. Latency: two clocks for the product, then the dividers' quotient bits.

    Source: Hyun and Moon 2015, Eq. 1 to 3.
    """

    name = "conventional"
    summary = "Eq. 3: matrix product and two pipelined dividers"

    @property
    def cost(self):
        divider = self.divider_cost
        return Cost(lut=divider.lut + round(7.4 * self.form_bits), ff=divider.ff + 2 * self.form_bits)

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
        for name, form in self._parameters.forms.items():
            products = []
            for position, coefficient in ((self.x, form.a), (self.y, form.b)):
                factor = Const(coefficient)
                product = Signal(
                    signed(len(position) + len(factor) + 1), name=f"{name}_product_{len(products)}", reset_less=True
                )
                with m.If(self.enable):
                    m.d.sync += product.eq(position * factor)
                products.append(product)
            value = Signal(form.format.shape, name=name, reset_less=True)
            with m.If(self.enable):
                m.d.sync += value.eq(products[0] + products[1] + form.c)
            values.append(value)
        connect_divider(m, self, self._parameters, *values)
        return m
