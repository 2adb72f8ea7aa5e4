"""Hardware of the fixed-point programs of `hdl.arithmetic.steps`: each value with its fraction bits and its delay."""

from dataclasses import dataclass, field

from amaranth import Cat, Const, Module, Signal, Value

from hdl.arithmetic import multiplier
from hdl.arithmetic.divider import Divider
from hdl.arithmetic.steps import Product, Quotient, Scaled, Sum


def scaled(m, name, a, factor, constant, dsp):
    """The expression a*factor + constant of integers: `*` with ``dsp``, else `hdl.arithmetic.multiplier.scaled`."""
    return a * Const(factor) + constant if dsp else multiplier.scaled(m, name, a, factor, constant)


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

    Each step takes one clock, but a `Quotient` as many as it has bits. Registers move on with ``enable`` and are not
    reset, so that those that only wait become shift registers.

    Parameters
    ----------
    m : Module
        Takes the hardware.
    enable : Value
    formats : dict of str to Q
        Formats that hold every value of the step of that name.
    dsp : bool
        Whether products are left to the synthesis tool, which has DSP blocks for them; else they are rows of adders.
    """

    def __init__(self, m: Module, enable, formats, dsp):
        self._m, self._enable, self._formats, self._dsp = m, enable, formats, dsp
        self._stages = {}

    def give(self, name, value, fraction_bits, delay):
        """Have a value that comes from elsewhere."""
        self._stages[name] = Stage(value, fraction_bits, delay)

    def add(self, step):
        """The hardware of one step."""
        a, b = self._stages[step.operands[0]], self._stages[step.operands[-1]]
        delay = max(a.delay, b.delay)
        left, right = self.value(step.operands[0], delay), self.value(step.operands[-1], delay)
        match step:
            case Product():
                dropped = a.fraction_bits + b.fraction_bits - step.bits
                constant = step.constant + (1 << dropped >> 1)
                if self._dsp:
                    exact = left * right + constant
                elif a is b:
                    exact = multiplier.square(self._m, step.name, left, constant)
                else:
                    exact = multiplier.product(self._m, step.name, left, right, constant)
                self._register(step, exact >> dropped, delay)
            case Scaled():
                dropped = a.fraction_bits + step.factor_bits - step.bits
                constant = step.constant + (1 << dropped >> 1)
                exact = scaled(self._m, step.name, left, step.factor, constant, self._dsp)
                self._register(step, exact >> dropped, delay)
            case Sum():
                bits = max(a.fraction_bits, b.fraction_bits, step.bits)
                exact = (left << (bits - a.fraction_bits)) + (right << (bits - b.fraction_bits))
                self._register(step, exact >> (bits - step.bits), delay)
            case Quotient():
                self._divide(step, left, right, b.fraction_bits + step.bits - a.fraction_bits, delay)
            case _:
                raise TypeError(f"{step!r} is no step")

    def value(self, name, delay):
        """The stored integer of a value ``delay`` enabled clocks late; waiting registers are shared among its uses."""
        stage = self._stages[name]
        taps = {stage.delay: stage.stored, **stage.later}
        if delay not in taps:
            start = max(tap for tap in taps if tap < delay)
            width = len(stage.stored)
            waiting = Signal(width * (delay - start), name=f"{name}_until_{delay}", reset_less=True)
            with self._m.If(self._enable):
                self._m.d.sync += waiting.eq(Cat(taps[start], waiting))
            last = waiting[-width:]
            taps[delay] = stage.later[delay] = last.as_signed() if stage.stored.shape().signed else last
        return taps[delay]

    def _register(self, step, value, delay):
        result = Signal(self._formats[step.name].shape, name=step.name, reset_less=True)
        with self._m.If(self._enable):
            self._m.d.sync += result.eq(value)
        self._stages[step.name] = Stage(result, step.bits, delay + 1)

    def _divide(self, step, dividend, divisor, shift, delay):
        block = Divider([(len(dividend), shift)], divisor_bits=len(divisor), quotient_bits=step.quotient_bits)
        self._m.submodules[f"{step.name}_divider"] = block
        self._m.d.comb += [
            block.enable.eq(self._enable),
            block.dividend_0.eq(dividend),
            block.divisor.eq(divisor),
        ]
        # Taking off half the range turns the highest bit round; then it is the sign.
        difference = Cat(block.quotient_0[:-1], ~block.quotient_0[-1]).as_signed()
        self._stages[step.name] = Stage(difference, step.bits, delay + block.latency)
