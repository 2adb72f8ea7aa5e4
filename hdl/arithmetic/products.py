"""Who makes products, the synthesis tool or rows of adders, and how many clocks they take."""

from dataclasses import dataclass

from amaranth import Cat, Const, Signal, signed

from hdl.arithmetic import dsp, multiplier
from hdl.arithmetic.cost import waiting
from hdl.arithmetic.cuts import COMPACT, Pipeline, Stages
from hdl.arithmetic.rows import Registers
from hdl.arithmetic.steps import Product, Scaled, step_clocks, step_cost


@dataclass(frozen=True)
class Products:
    """How products are made, each with the register behind it.

    Parameters
    ----------
    dsp : bool
        Whether they are left to the synthesis tool, which has DSP blocks for them; else they are rows of adders.
    pipeline : Pipeline
        With its ``products`` there are registers within, those of a DSP block or behind every few adders.
    """

    dsp: bool
    pipeline: Pipeline = COMPACT

    @property
    def in_blocks(self):
        """Whether the registers are those of DSP blocks."""
        return self.dsp and bool(self.pipeline.products)

    @property
    def in_rows(self):
        """Whether there are registers between rows of adders."""
        return bool(self.pipeline.products) and not self.dsp

    def product(self, m, enable, name, a, b, constant, shape, dropped=None):
        """The register ``name`` of a*b + constant without its last ``dropped`` bits; late by `product_clocks`.

        ``a`` and ``b``, of registers, may be the same.
        """
        if self.in_blocks:
            exact = dsp.product(m, name, multiplier.as_signed(a), multiplier.as_signed(b), constant, Stages(m, enable))
        elif self.dsp:
            exact = a * b + constant
        elif a is b:
            exact = multiplier.square(m, name, a, constant, self._registers(m, enable))
        else:
            exact = multiplier.product(m, name, a, b, constant, self._registers(m, enable))
        return self._registered(m, enable, name, exact, shape, dropped)

    def scaled(self, m, enable, name, a, factor, constant, shape, dropped=None):
        """The register ``name`` of a*factor + constant, of integers, likewise; late by `scaled_clocks`."""
        if self.in_blocks:
            odd, zeros = _odd(factor)
            exact = dsp.product(m, name, multiplier.as_signed(a), odd, constant >> zeros, Stages(m, enable))
            exact = Cat(Const(constant % (1 << zeros), zeros), exact).as_signed()
        elif self.dsp:
            exact = a * Const(factor) + constant
        else:
            exact = multiplier.scaled(m, name, a, factor, constant, self._registers(m, enable))
        return self._registered(m, enable, name, exact, shape, dropped)

    def _registered(self, m, enable, name, exact, shape, dropped):
        result = Signal(shape, name=name, reset_less=True)
        value = exact if dropped is None else exact >> dropped
        if self.in_blocks:
            m.d.comb += result.eq(value)
        else:
            with m.If(enable):
                m.d.sync += result.eq(value)
        return result

    def product_clocks(self, a, b, constant, square=False):
        """Clocks of a product, that of the register behind it included; signed factors of ``a`` and ``b`` bits."""
        if self.in_blocks:
            return dsp.clocks(a, b)
        if square:
            return self._clocks(multiplier.square_adders(a, constant))
        return self._clocks(multiplier.product_adders(a, b, constant))

    def scaled_clocks(self, a, factor, constant):
        """Likewise of a multiple of what has ``a`` bits, its sign included."""
        if self.in_blocks:
            return dsp.clocks(a, len(_odd(factor)[0]))
        return self._clocks(multiplier.scaled_adders(a, factor, constant))

    def step_clocks(self, step, operands):
        """Clocks of a step whose operands are ``operands``, (bits with a sign, fraction bits) of each."""
        (a, a_bits), (b, b_bits) = operands[0], operands[-1]
        match step:
            case Product():
                _, constant = rounding(step, a_bits, b_bits)
                return self.product_clocks(a, b, constant, square=step.a == step.b)
            case Scaled():
                return self.scaled_clocks(a, step.factor, rounding(step, a_bits, b_bits)[1])
        return step_clocks(step)

    def step_cost(self, step, operands, width):
        """Look-up tables, flip-flops and DSP blocks of a step, about; ``operands`` as above, ``width`` of its value."""
        (a, _), (b, _) = operands[0], operands[-1]
        widths = {step.operands[-1]: b, step.a: a, step.name: width}
        lut, ff, blocks = step_cost(step, widths, self.dsp)
        if not self.pipeline.products or not isinstance(step, Product | Scaled):
            return lut, ff, blocks
        if self.dsp:
            other = b if isinstance(step, Product) else len(_odd(step.factor)[0])
            return lut, ff, len(dsp.blocks(a, other))
        clocks = self.step_clocks(step, operands)
        if isinstance(step, Scaled):
            more = self.scaled_registers(a, step.factor, clocks)
        elif step.a == step.b:
            more = self._row_registers(0, a, a, 4, clocks)
        else:
            more = self._row_registers(max(a, b), min(a, b), max(a, b), 2, clocks)
        return lut + more[0], ff + more[1], 0

    def scaled_registers(self, a, factor, clocks, sharing=1):
        """Look-up tables and flip-flops of the registers between the rows of a multiple, where as many as
        ``sharing`` have the operand's in common."""
        rows = max(len(multiplier.signed_digits(factor)), 1)
        return self._row_registers(a // sharing, 0, a, factor.bit_length() / rows, clocks)

    def waiting_cost(self, bits, clocks):
        """Look-up tables and flip-flops of a value of ``bits`` bits that waits for a step.

        DSP blocks have two registers for each factor.
        """
        if self.in_blocks:
            return waiting(bits, max(clocks - 2, 0))
        return waiting(bits, clocks, ends=self.in_rows)

    def _row_registers(self, kept, used, total, places, clocks):
        """Those between rows that are ``places`` bits apart: of an operand that is kept, one that is used up from row
        to row, the sum, and its bits that are final."""
        lut = ff = 0
        for left in range(1, clocks):
            done = (clocks - left) * self.pipeline.products
            ff += kept + max(used - 2 * done, 0) + total - 2 * done * (not kept)
            final = waiting(round(places * self.pipeline.products), left)
            lut, ff = lut + final[0], ff + final[1]
        return lut, ff

    def _clocks(self, adders):
        return -(-adders // self.pipeline.products) if self.in_rows else 1

    def _registers(self, m, enable):
        return Registers(Stages(m, enable), self.pipeline.products) if self.in_rows else None


def rounding(step, a_bits, b_bits):
    """(bits dropped, the constant with their half) of a `Product` or `Scaled` of values with these fraction bits."""
    dropped = a_bits + (step.factor_bits if isinstance(step, Scaled) else b_bits) - step.bits
    return dropped, step.constant + (1 << dropped >> 1)


def _odd(factor):
    """A factor without its trailing zeros, as a constant of as few bits as hold its sign, and their number.

    With them the adder behind the multiplier would be narrower than it, and not go into its block.
    """
    zeros = (factor & -factor).bit_length() - 1 if factor else 0
    return Const(factor >> zeros, signed((factor >> zeros).bit_length() + 1)), zeros
