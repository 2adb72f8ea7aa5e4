"""Weighted means of pairs of values, by adders: even * (2**f - weight) + odd * weight, the two exchanged or not.

Each way has the same members: ``latency``, enabled clocks from values and weights to the total, which is registered;
`recoded`, what travels of a weight; `totals` of all pairs that have a weight in common.
"""

from abc import ABC, abstractmethod

from amaranth import Cat, Const, Module, Mux, Signal, signed

from hdl.arithmetic.cuts import RADIX4, SERIAL, TREE, Stages


class Blend(ABC):
    """What all ways have in common.

    Parameters
    ----------
    fraction_bits : int
        f, bits of a weight.
    """

    def __init__(self, fraction_bits):
        self._f = fraction_bits

    def recoded(self, weight, swapped):
        """What `totals` takes as weights: of a weight, and whether it is the even value's."""
        return Cat(weight, swapped)

    @abstractmethod
    def totals(self, m: Module, stages: Stages, name, pairs, weights, half):
        """The totals, f bits longer than the values, ``latency`` - 1 enabled clocks late: not yet registered.

        Parameters
        ----------
        m : Module
        stages : Stages
        name : str
            What the names of signals begin with.
        pairs : list of (even, odd)
            Unsigned values of one width.
        weights : Value
            `recoded`.
        half : bool
            Whether 2**(f-1) is added.
        """


class Serial(Blend):
    """An adder as wide as the values for each bit of the weight, one behind the other, in one clock.

    From 2**f - weight = 1 + sum of 2**i over the bits i of the weight that are 0: one copy of the first value and, for
    each bit of the weight, 2**i times one of the two. That is one look-up table a bit; ``half`` enters as the last
    one's carry, and exchanging inverts the weight's bits.
    """

    latency = 1

    def totals(self, m, stages, name, pairs, weights, half):
        weight, swapped = weights[:-1], weights[-1]
        found = []
        for index, (even, odd) in enumerate(pairs):
            width = len(even)
            first = Signal(width, name=f"{name}_{index}_first")
            m.d.comb += first.eq(Mux(swapped, odd, even))
            done, upper = [], first
            for i in range(self._f):
                chosen = Signal(width + 1, name=f"{name}_{index}_chosen_{i}")
                total = Signal(width + 1, name=f"{name}_{index}_sum_{i}")
                m.d.comb += chosen.eq(Mux(weight[i] ^ swapped, odd, even))
                # a - ~b is a + b + 1: the carry in is free.
                m.d.comb += total.eq(upper - ~chosen if half and i == self._f - 1 else upper + chosen)
                done.append(total[0])
                upper = total[1:]
            found.append(Cat(*done, upper))
        return found


class Radix4(Blend):
    """even * 2**f + w * (odd - even), w the odd value's weight, in digits of two bits, the highest first.

    Digits are Booth's, -2 to 2, but for the highest, which is 0 to 2 (0 or 1 for even f), since w is 2**f at most. What
    is added up so far stands for the two values weighted by what of w was taken, rounded, hence is never negative. A
    clock each for the difference with the highest digit and for two digits of the others.
    """

    _PER_CLOCK = 2

    @property
    def _low_digits(self):
        return self._f // 2

    @property
    def latency(self):
        return 1 - -self._low_digits // self._PER_CLOCK

    def recoded(self, weight, swapped):
        """The lower digits' bits, then two that tell of the highest digit whether it is 1, and 2."""
        f = self._f
        w = Mux(swapped, 2**f - weight, weight)[: f + 1]
        low, top = w[: 2 * self._low_digits], Cat(Const(0, 1), w)[2 * self._low_digits :]
        if f % 2:
            return Cat(low, top[0] ^ top[1], top[2] | (top[0] & top[1]))
        return Cat(low, top.any())

    def totals(self, m, stages, name, pairs, weights, half):
        low = weights[: 2 * self._low_digits]
        sums, differences = [], []
        for index, (even, odd) in enumerate(pairs):
            width = len(even)
            difference = Signal(signed(width + 1), name=f"{name}_{index}_difference")
            m.d.comb += difference.eq(odd - even)
            differences.append(difference)
            top = weights[2 * self._low_digits :]
            sums.append(self._highest(m, f"{name}_{index}", even, odd, difference, top, half))
        for digit in reversed(range(self._low_digits)):
            if (self._low_digits - 1 - digit) % self._PER_CLOCK == 0:
                step = f"{name}_{digit}"
                low = stages.after(f"{step}_digits", low[: 2 * digit + 2])
                sums = [stages.after(f"{step}_{index}_before", value) for index, value in enumerate(sums)]
                differences = [
                    stages.after(f"{step}_{index}_difference", value) for index, value in enumerate(differences)
                ]
            upper, middle, lower = low[2 * digit + 1], low[2 * digit], low[2 * digit - 1] if digit else Const(0, 1)
            # Of an even f no digit but the next has had the place for half the unit.
            rounds = half and self._f % 2 == 0 and digit == self._low_digits - 1
            sums = [
                self._next(m, f"{name}_{index}_{digit}", value, difference, upper, middle, lower, rounds)
                for index, (value, difference) in enumerate(zip(sums, differences))
            ]
        return sums

    def _highest(self, m, name, even, odd, difference, digit, half):
        """The sum with the highest digit: in units of 4**low_digits, of which half the unit is the lowest for odd f."""
        if self._f % 2 == 0:
            total = Signal(len(even), name=f"{name}_sum_{self._low_digits}")
            m.d.comb += total.eq(Mux(digit, odd, even))
            return total
        chosen, total = Signal(len(even) + 2, name=f"{name}_chosen"), Signal(len(even) + 2, name=f"{name}_sum")
        m.d.comb += [
            chosen.eq(Mux(digit[1], difference << 1, Mux(digit[0], difference, 0))),
            # a - ~b is a + b + 1: the carry in is free.
            total.eq((even << 1) - ~chosen if half else (even << 1) + chosen),
        ]
        return total[:-1]

    @staticmethod
    def _next(m, name, value, difference, upper, middle, lower, rounds):
        """value * 4 + digit * difference, the digit -2*upper + middle + lower, plus 2 where it ``rounds``."""
        product = Mux(middle ^ lower, difference, Mux(upper ^ middle, difference << 1, 0))
        chosen, total = Signal(len(value) + 2, name=f"{name}_chosen"), Signal(len(value) + 2, name=f"{name}_sum")
        m.d.comb += [
            chosen.eq(Mux(upper, ~product, product)),
            # Two bits are free: one of them takes what negation adds.
            total.eq(Cat(upper, Const(rounds, 1), value) + chosen),
        ]
        return total


class Tree(Blend):
    """The terms of `Serial` added two and two in the first clock, and then two of the sums a clock.

    Pairs of terms differ in weight by two, so that a term and twice the next are one adder.
    """

    _PER_CLOCK = 2

    @property
    def latency(self):
        return 1 - -(self._f // 2) // self._PER_CLOCK

    def totals(self, m, stages, name, pairs, weights, half):
        weight, swapped = weights[:-1], weights[-1]
        exponents = range(1, self._f, 2)
        found = []
        for index, (even, odd) in enumerate(pairs):

            def added(at, a, b, more, name=f"{name}_{index}"):
                total = Signal(max(len(a), len(b)) + 1, name=f"{name}_sum_{at}")
                operand = Signal.like(total, name=f"{name}_operand_{at}")
                # a - ~b is a + b + 1: the carry in is free.
                m.d.comb += [operand.eq(b), total.eq(a - ~operand if more else a + operand)]
                return total

            first, *terms = (Mux(bit ^ swapped, odd, even) for bit in (0, *weight))
            sums = [added("low", first, terms[0], half and self._f == 1)]
            for exponent in exponents:
                # Half the unit is twice the weight of the last pair, or once that of a last term.
                low, high = terms[exponent], terms[exponent + 1 : exponent + 2]
                sums.append(added(exponent, low, high[0] << 1, half and exponent == self._f - 2) if high else low)
            for at, exponent in enumerate(exponents):
                if at % self._PER_CLOCK == 0:
                    sums = [
                        stages.after(f"{name}_{index}_before_{exponent}_{place}", value)
                        for place, value in enumerate(sums)
                    ]
                total, value, *sums = sums
                upper = added(f"from_{exponent}", total[exponent:], value, half and exponent == exponents[-1])
                sums = [Cat(total[:exponent], upper)[: len(even) + exponent + 2], *sums]
            found.append(sums[0][: len(even) + self._f])
        return found


BLENDS = {SERIAL: Serial, RADIX4: Radix4, TREE: Tree}
