"""Sums of rows with ascending places: what products are made of, in look-up tables or DSP blocks."""

from dataclasses import dataclass

from amaranth import Cat, Const, Signal, Value, signed

from hdl.arithmetic.cuts import Stages
from hdl.arithmetic.fixedpoint import Q


@dataclass(frozen=True, eq=False)
class Row:
    """(value + carry) * 2**place, or less that where ``subtract``; ``value`` is signed, ``carry`` a bit or None."""

    place: int
    value: Value
    carry: Value | None = None
    subtract: bool = False


@dataclass(frozen=True)
class Registers:
    """Registers within a sum of rows: behind every ``adders`` of its adders, but for the last ones.

    Parameters
    ----------
    stages : Stages
    adders : int
    """

    stages: Stages
    adders: int


class RowSum:
    """A constant, and rows that are added to it one by one, into a module's combinational domain.

    Bits below a row's place are final before it is added.

    Parameters
    ----------
    m : Module
    name : str
        What the names of the signals begin with.
    constant : Const
    low, high : int
        The least and the greatest that it, or what the first row is added to in its place, can be.
    stages : Stages or None
        The registers, where there are any.
    """

    def __init__(self, m, name, constant, low, high, stages=None):
        self._m, self._name, self._stages = m, name, stages
        self._total, self._low, self._high = constant, low, high
        self._place, self._index, self._clocks, self._final = 0, 0, 0, []

    def add(self, row):
        """Add a `Row`; each one's place is that of the one before, or above it."""
        total, ready = self._total, row.place - self._place
        self._final.append((self._clocks, Cat(total, total[-1].replicate(ready))[:ready]))
        total = total[min(ready, len(total) - 1) :].as_signed()
        most = 1 << (len(row.value) - 1)
        self._low, self._high = (self._low >> ready) - most, (self._high >> ready) + most
        width = Q.covering(min(self._low, -1), self._high, 0).width
        added = Signal(signed(width), name=f"{self._name}_sum_{self._index}")
        if row.subtract:
            sum_ = total - row.value
        elif row.carry is None:
            sum_ = total + row.value
        else:
            # An extra low bit makes the carry in.
            sum_ = (Cat(Const(1, 1), total).as_signed() + Cat(row.carry, row.value).as_signed())[1:].as_signed()
        self._m.d.comb += added.eq(sum_)
        self._total, self._place, self._index = added, row.place, self._index + 1

    def register(self):
        """A register behind the last adder, all of its bits in it, as a DSP block has it."""
        self._clocks += 1
        self._total = self._stages.after(f"{self._name}_total_{self._clocks}", self._total)

    def result(self):
        """The expression of the sum."""
        final = [
            self._stages.after(f"{self._name}_final_{index}", bits, self._clocks - clock) if len(bits) and self._stages
            else bits
            for index, (clock, bits) in enumerate(self._final)
        ]  # fmt: skip
        return Cat(*final, self._total).as_signed()
