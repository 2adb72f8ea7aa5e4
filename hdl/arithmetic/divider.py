"""Pipelined non-restoring division, one quotient bit a stage."""

from amaranth import Cat, Const, Module, Mux, Signal
from amaranth.lib import wiring
from amaranth.lib.wiring import In, Out

from hdl.errors import at_least


class Divider(wiring.Component):
    """Quotients of several dividends by one divisor: floor(dividend * 2**shift / divisor), one set a clock.

    Each stage adds or subtracts the divisor once (one adder, no restoring multiplexer) and takes its quotient bit from
    the sign; the bits equal those of restoring division, so the quotient is exactly the floor. The divisor travels with
    the dividends and is stored once for all of them.

    Latency: ``quotient_bits`` enabled clocks. Throughput: one per clock. State is not reset, so that delays map to
    shift registers.

    Parameters
    ----------
    dividends : sequence of (int, int)
        Width (unsigned) and left shift (>= 0) of each dividend.
    divisor_bits : int
        Width (unsigned) of the divisor.
    quotient_bits : int
        The caller keeps dividend * 2**shift < divisor * 2**quotient_bits.

    Raises
    ------
    ValueError
        Without dividends, and for widths below 1 or shifts below 0.

    Members
    -------
    enable : In(1)
    divisor : In(divisor_bits)
    dividend_i : In(dividend_bits), quotient_i : Out(quotient_bits), i = 0, 1, ...
    """

    def __init__(self, dividends, *, divisor_bits, quotient_bits):
        at_least(1, dividends=len(dividends), divisor_bits=divisor_bits, quotient_bits=quotient_bits)
        for width, shift in dividends:
            at_least(1, dividend_bits=width)
            at_least(0, shift=shift)
        self._shifts = [shift for _, shift in dividends]
        self.latency = quotient_bits
        super().__init__(
            {
                "enable": In(1),
                "divisor": In(divisor_bits),
                **{f"dividend_{i}": In(width) for i, (width, _) in enumerate(dividends)},
                **{f"quotient_{i}": Out(quotient_bits) for i in range(len(dividends))},
            }
        )

    def elaborate(self, platform):
        m = Module()
        stages, width = self.latency, len(self.divisor) + 1
        divisors = [self.divisor]
        for stage in range(1, stages):
            divisors.append(Signal(width - 1, name=f"divisor_{stage}", reset_less=True))
            with m.If(self.enable):
                m.d.sync += divisors[stage].eq(divisors[stage - 1])

        for i, shift in enumerate(self._shifts):
            dividend = Signal(stages + width, name=f"shifted_{i}")
            m.d.comb += dividend.eq(getattr(self, f"dividend_{i}") << shift)
            # Dividend bits leave on the left as quotient bits enter on the right.
            digits, remainder, negative = dividend[:stages], dividend[stages:], Const(0)
            for stage, divisor in enumerate(divisors):
                next_remainder = Signal(width, name=f"remainder_{i}_{stage}", reset_less=True)
                next_digits = Signal(stages, name=f"digits_{i}_{stage}", reset_less=True)
                subtract = Signal(name=f"subtract_{i}_{stage}")
                operand = Signal(width, name=f"operand_{i}_{stage}")
                total = Signal(width, name=f"total_{i}_{stage}")
                m.d.comb += [
                    subtract.eq(~negative),
                    operand.eq(Mux(subtract, ~Cat(divisor, 0), divisor)),
                    # |remainder| <= divisor, so sums modulo 2**width do; the extra low bit makes the carry in.
                    total.eq((Cat(1, digits[-1], remainder) + Cat(subtract, operand)) >> 1),
                ]
                with m.If(self.enable):
                    m.d.sync += [next_remainder.eq(total), next_digits.eq(Cat(~total[-1], digits))]
                digits, remainder, negative = next_digits, next_remainder, next_remainder[-1]
            m.d.comb += getattr(self, f"quotient_{i}").eq(digits)
        return m
