"""Hardware of the fixed-point programs of `hdl.arithmetic.steps`: each value with its fraction bits and its delay."""

from dataclasses import dataclass, field

from amaranth import Cat, Module, Signal, Value

from hdl.arithmetic.cuts import Stages
from hdl.arithmetic.divider import Divider
from hdl.arithmetic.multiplier import as_signed
from hdl.arithmetic.products import Products, rounding
from hdl.arithmetic.steps import Product, Quotient, Scaled, Sum


@dataclass(eq=False)
class Stage:
    """A value in the pipeline.

    Members
    -------
    stored : Value
        Its integer.
    fraction_bits : int
    delay : int
        Enabled clocks from the position to it.
    later : dict of int to Value
        The same in later clocks, by their delay.
    """

    stored: Value
    fraction_bits: int
    delay: int
    later: dict = field(default_factory=dict)


class Pipeline:
    """Steps as registered operations; the operand that comes early waits for the other one.

    Each step takes the clocks that `Products.step_clocks` tells. Registers move on with ``enable`` and are not reset,
    so that those that only wait become shift registers.

    Parameters
    ----------
    m : Module
        Takes the hardware.
    enable : Value
    formats : dict of str to Q
        Formats that hold every value of the step of that name.
    products : Products
    """

    def __init__(self, m: Module, enable, formats, products: Products):
        self._m, self._enable, self._formats, self._products = m, enable, formats, products
        self._stages = {}

    def give(self, name, value, fraction_bits, delay):
        """Have a value that comes from elsewhere."""
        self._stages[name] = Stage(value, fraction_bits, delay)

    def add(self, step):
        """The hardware of one step."""
        a, b = self._stages[step.operands[0]], self._stages[step.operands[-1]]
        delay = max(a.delay, b.delay)
        left, right = self.value(step.operands[0], delay), self.value(step.operands[-1], delay)
        operands = [(len(as_signed(stage.stored)), stage.fraction_bits) for stage in (a, b)]
        ready = delay + self._products.step_clocks(step, operands)
        place = self._m, self._enable, step.name
        shape = self._formats[step.name].shape
        match step:
            case Product():
                dropped, constant = rounding(step, a.fraction_bits, b.fraction_bits)
                result = self._products.product(*place, left, right, constant, shape, dropped)
            case Scaled():
                dropped, constant = rounding(step, a.fraction_bits, 0)
                result = self._products.scaled(*place, left, step.factor, constant, shape, dropped)
            case Sum():
                bits = max(a.fraction_bits, b.fraction_bits, step.bits)
                exact = (left << (bits - a.fraction_bits)) + (right << (bits - b.fraction_bits))
                result = Signal(shape, name=step.name, reset_less=True)
                with self._m.If(self._enable):
                    self._m.d.sync += result.eq(exact >> (bits - step.bits))
            case Quotient():
                result = self._divide(step, left, right, b.fraction_bits + step.bits - a.fraction_bits)
            case _:
                raise TypeError(f"{step!r} is no step")
        self._stages[step.name] = Stage(result, step.bits, ready)

    def value(self, name, delay):
        """The stored integer of a value ``delay`` enabled clocks late; waiting registers are shared among its uses."""
        stage = self._stages[name]
        taps = {stage.delay: stage.stored, **stage.later}
        if delay in taps:
            return taps[delay]
        start = max(tap for tap in taps if tap < delay)
        # Where products have registers, adders follow that leave no time for a shift register.
        stages = Stages(self._m, self._enable, ends=bool(self._products.pipeline.products))
        stage.later[delay] = stages.after(f"{name}_until_{delay}", taps[start], delay - start)
        return stage.later[delay]

    def _divide(self, step, dividend, divisor, shift):
        block = Divider([(len(dividend), shift)], divisor_bits=len(divisor), quotient_bits=step.quotient_bits)
        self._m.submodules[f"{step.name}_divider"] = block
        self._m.d.comb += [
            block.enable.eq(self._enable),
            block.dividend_0.eq(dividend),
            block.divisor.eq(divisor),
        ]
        # Taking off half the range turns the highest bit round; then it is the sign.
        return Cat(block.quotient_0[:-1], ~block.quotient_0[-1]).as_signed()
