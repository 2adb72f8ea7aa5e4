"""Accumulators and dividers compute what they name, for all operands and any pauses."""

from amaranth import Module, Mux, Signal
from amaranth.asserts import AnySeq
from amaranth.hdl import Assert, Assume, Cover, Elaboratable
from polynomials import differences

from hdl.arithmetic.differences import DifferenceAccumulator
from hdl.arithmetic.divider import Divider
from hdl.arithmetic.linear import Accumulator

from .opened import Opened


class AccumulatorProof(Elaboratable):
    """The accumulator's value is a*x + b*y + c at every position of every frame; so it never overflows.

    Parameters
    ----------
    form : LinearForm
    """

    def __init__(self, form, lemmas=True):
        self._form, self._lemmas = form, lemmas

    def elaborate(self, platform):
        m = Module()
        form = self._form
        m.submodules.accumulator = accumulator = Accumulator(form)
        x, y = Signal(range(form.width)), Signal(range(form.height))
        last_column, last_row = x == form.width - 1, y == form.height - 1
        m.d.comb += [
            accumulator.step.eq(AnySeq(1)),
            accumulator.end_of_line.eq(last_column),
            accumulator.end_of_frame.eq(last_column & last_row),
            # Amaranth's sums and products are as wide as they must be.
            Assert(accumulator.value == form.a * x + form.b * y + form.c, "the value is the linear form's"),
        ]
        if self._lemmas:
            m.d.comb += Assert((x < form.width) & (y < form.height), "lemma: positions are in the frame")
        with m.If(accumulator.step):
            m.d.sync += x.eq(Mux(last_column, 0, x + 1))
            with m.If(last_column):
                m.d.sync += y.eq(Mux(last_row, 0, y + 1))
        return m


class DifferenceProof(Elaboratable):
    """The accumulator's value is the polynomial at every position of every frame; so no register overflows.

    Parameters
    ----------
    form : DifferenceForm
    """

    def __init__(self, form, lemmas=True):
        self._form, self._lemmas = form, lemmas

    def elaborate(self, platform):
        m = Module()
        form = self._form
        accumulator = DifferenceAccumulator(form)
        m.submodules.accumulator = opened = Opened(accumulator)
        x, y = Signal(range(form.width)), Signal(range(form.height))
        last_column, last_row = x == form.width - 1, y == form.height - 1
        exact = differences(form)

        def here(name):
            if "jump" in name:
                return _entry(exact[name], y)
            column = x if name == "value" else x // form.cell_width
            return _entry([_entry(row, column) for row in exact[name]], y)

        m.d.comb += [
            accumulator.step.eq(AnySeq(1)),
            accumulator.x.eq(x),
            accumulator.y.eq(y),
            accumulator.end_of_line.eq(last_column),
            accumulator.end_of_frame.eq(last_column & last_row),
            Assert(accumulator.value == here("value"), "the value is the polynomial's"),
        ]
        if self._lemmas:
            m.d.comb += Assert((x < form.width) & (y < form.height), "lemma: positions are in the frame")
            for name, sequence in form.registers.items():
                register = opened.registers[name]
                stored = (here(name) if sequence.order % 2 == 0 else -here(name)) >> sequence.fixed_bits
                same = stored[: len(register)] == register.as_unsigned()
                m.d.comb += Assert(same, f"lemma: {name} is the difference")
        with m.If(accumulator.step):
            m.d.sync += x.eq(Mux(last_column, 0, x + 1))
            with m.If(last_column):
                m.d.sync += y.eq(Mux(last_row, 0, y + 1))
        return m


def _entry(table, index):
    """table[index]; by multiplexers, since tools make a memory of a switch, whose contents induction takes as free."""
    if not len(index):
        return table[0]
    low, high = (_entry(table[odd::2] or table[:1], index[1:]) for odd in (0, 1))
    return Mux(index[0], high, low)


class DividerProof(Elaboratable):
    """Each quotient is floor(dividend * 2**shift / divisor), ``latency`` enabled clocks after its operands.

    Assumed is what the divider asks of its caller: dividend * 2**shift < divisor * 2**quotient_bits.

    Parameters
    ----------
    dividends, divisor_bits, quotient_bits
        As of `Divider`.
    """

    def __init__(self, dividends, *, divisor_bits, quotient_bits, lemmas=True):
        self._dividends, self._stages, self._with_lemmas = dividends, quotient_bits, lemmas
        self._divider = Divider(dividends, divisor_bits=divisor_bits, quotient_bits=quotient_bits)

    def elaborate(self, platform):
        m = Module()
        divider, stages = self._divider, self._stages
        m.submodules.divider = opened = Opened(divider)
        m.d.comb += [divider.enable.eq(AnySeq(1)), divider.divisor.eq(AnySeq(len(divider.divisor)))]
        dividends = [getattr(divider, f"dividend_{i}") for i in range(len(self._dividends))]
        for dividend, (width, shift) in zip(dividends, self._dividends):
            m.d.comb += [
                dividend.eq(AnySeq(width)),
                Assume((dividend << shift) < (divider.divisor << stages), "the quotient fits"),
            ]

        operands = [(1, divider.divisor, *dividends)]
        for stage in range(stages):
            operands.append(
                [
                    Signal.like(operand, name=f"operand_{stage}_{i}")
                    for i, operand in enumerate((Signal(), *operands[0][1:]))
                ]
            )
            with m.If(divider.enable):
                m.d.sync += [mine.eq(its) for mine, its in zip(operands[-1], operands[-2])]
            if self._with_lemmas:
                self._lemmas(m, opened.registers, stage, *operands[-1])

        valid, divisor, *dividends = operands[-1]
        for i, (dividend, (_, shift)) in enumerate(zip(dividends, self._dividends)):
            quotient, scaled = getattr(divider, f"quotient_{i}"), dividend << shift
            is_floor = (quotient * divisor <= scaled) & (scaled < (quotient + 1) * divisor)
            m.d.comb += [
                Assert(~valid | is_floor, f"quotient {i} is the floor"),
                Cover(valid & (quotient != 0) & (scaled != quotient * divisor), f"division {i} leaves a remainder"),
            ]
        return m

    def _lemmas(self, m, registers, stage, valid, divisor, *dividends):
        """After each stage the quotient's bits so far are those of the dividend's upper bits."""
        if stage < self._stages - 1:
            m.d.comb += Assert(~valid | (registers[f"divisor_{stage + 1}"] == divisor), f"lemma: the divisor, {stage}")
        for i, (dividend, (_, shift)) in enumerate(zip(dividends, self._dividends)):
            scaled = Signal(self._stages + len(divisor) + 1, name=f"scaled_{i}_{stage}")
            m.d.comb += scaled.eq(dividend << shift)
            to_come = self._stages - stage - 1
            remainder, digits = registers[f"remainder_{i}_{stage}"].as_signed(), registers[f"digits_{i}_{stage}"]
            restored = remainder + Mux(remainder < 0, divisor, 0)
            m.d.comb += Assert(
                ~valid
                | (restored >= 0)
                & (restored < divisor)
                & (digits[: stage + 1] * divisor + restored == scaled >> to_come)
                & (digits[stage + 1 :] == scaled[:to_come]),
                f"lemma: digits and remainder {i}, {stage}",
            )
